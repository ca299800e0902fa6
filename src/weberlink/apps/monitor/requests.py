"""Requests of pages, by type: who may make them, and what answers them."""

from collections.abc import Awaitable, Callable
from hmac import compare_digest
from typing import Any, NamedTuple

from weberlink.apps.monitor.access import new_token
from weberlink.apps.monitor.viewer import Viewer
from weberlink.watching.control import Answer, refusal

Handler = Callable[[Viewer, dict[str, Any]], Awaitable[Answer | None]]
"""Answers a request without its `type` and `token`; None for no answer."""

Urgency = Callable[[dict[str, Any]], bool]

READ_ONLY = "this page is read-only: open the address that weberlink printed, the key in it permits changes"
UNPROVEN = "this is not the token of the monitor; open the address that it printed"


def always(_request: dict[str, Any]) -> bool:
    return True


def never(_request: dict[str, Any]) -> bool:
    return False


class _Known(NamedTuple):
    handler: Handler
    reads: bool
    urgent: Urgency


class Requests:
    """The types of requests and their handlers.

    Attributes:
        token: the key in the address that the monitor prints. A page that was opened without it
            only looks; every request that changes something must carry it.
    """

    def __init__(self) -> None:
        self.token = new_token()
        self._known: dict[str, _Known] = {}

    def add(self, kind: str, handler: Handler, *, reads: bool = False, urgent: Urgency = never) -> None:
        """Add a type of request.

        Args:
            kind: its type.
            handler: answers it.
            reads: whether it changes nothing; every page may make it then, without a token.
            urgent: whether a request waits for no earlier one of its page; its handler must not take long then.
        """
        self._known[kind] = _Known(handler, reads, urgent)

    def proves(self, token: object) -> bool:
        """Whether this is the token."""
        return isinstance(token, str) and compare_digest(token.encode(errors="replace"), self.token.encode())

    def is_urgent(self, document: object) -> bool:
        """Whether a message is to be answered at once, not after the earlier ones of its page."""
        known = self._find(document)
        return known is None or not isinstance(document, dict) or known.urgent(document)

    async def answer(self, viewer: Viewer, document: object) -> Answer | None:
        """Answer a message of a page.

        Returns:
            What the handler answers, with the type `answer` unless it names another, and `to`, the type of the request;
            a refusal with `why` if the message is no request, or the page may not make it.
        """
        known = self._find(document)
        if known is None or not isinstance(document, dict):
            return refusal(f'expected {{"type": ...}} with one of {", ".join(sorted(self._known))}')
        kind = document["type"]
        if not (known.reads or viewer.may_change):
            return refusal(READ_ONLY) | {"to": kind}
        if not (known.reads or self.proves(document.get("token"))):
            return refusal(UNPROVEN) | {"to": kind}
        request = {key: value for key, value in document.items() if key not in ("type", "token")}
        answer = await known.handler(viewer, request)
        return None if answer is None else {"type": "answer", "to": kind} | answer

    def _find(self, document: object) -> _Known | None:
        kind = document.get("type") if isinstance(document, dict) else None
        return self._known.get(kind) if isinstance(kind, str) else None
