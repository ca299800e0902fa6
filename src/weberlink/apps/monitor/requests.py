"""Requests of pages, by type: who may make them, and what answers them."""

from collections.abc import Awaitable, Callable
from typing import Any

from weberlink.apps.monitor.viewer import Viewer

Answer = dict[str, Any]
Handler = Callable[[Viewer, dict[str, Any]], Awaitable[Answer | None]]
"""Answers a request without its `type`; None for no answer."""

READ_ONLY = "this page is read-only: only the user who runs the session can change settings, on its host"


class Requests:
    """The types of requests and their handlers."""

    def __init__(self) -> None:
        self._handlers: dict[str, tuple[Handler, bool]] = {}

    def add(self, kind: str, handler: Handler, *, reads: bool = False) -> None:
        """Add a type of request; only pages that may change something make it, unless it only `reads`."""
        self._handlers[kind] = (handler, reads)

    async def answer(self, viewer: Viewer, document: object) -> Answer | None:
        """Answer a message of a page.

        Returns:
            What the handler answers, with the type `answer` unless it names another; a refusal with `why` if the
            message is no request, or the page may not make it.
        """
        kind = document.get("type") if isinstance(document, dict) else None
        known = self._handlers.get(kind) if isinstance(kind, str) else None
        if known is None or not isinstance(document, dict):
            return refusal(f'expected {{"type": ...}} with one of {", ".join(sorted(self._handlers))}')
        handler, reads = known
        if not (reads or viewer.may_change):
            return refusal(READ_ONLY)
        answer = await handler(viewer, {key: value for key, value in document.items() if key != "type"})
        return None if answer is None else {"type": "answer"} | answer


def refusal(why: str) -> Answer:
    """A request that was refused, with the reason."""
    return {"type": "answer", "accepted": False, "why": why}
