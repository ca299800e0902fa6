"""Requests of pages: who may make them, and what answers them."""

from collections.abc import Awaitable, Callable
from hmac import compare_digest
from typing import Any

from pydantic import ValidationError

from weberlink_figures.watching.control import Answer, refusal
from weberlink_page.access import new_token
from weberlink_page.front import UNPROVEN
from weberlink_page.messages import REQUEST
from weberlink_page.viewer import Viewer

LONGEST_MESSAGE = 4096  # longest message of a page [bytes]: it only asks for changes
URGENT = frozenset({"drive", "emergency"})
"""Requests that wait for no earlier one of their page; their handlers must not take long."""
READ_ONLY = "this page is read-only: open the address that weberlink printed, the key in it permits changes"

Handler = Callable[[Viewer, dict[str, Any]], Awaitable[Answer | None]]
"""Answers a request, which has no `type` and `token` any more; None for no answer."""


class Requests:
    """The handlers of requests.

    Attributes:
        token: the key in the address that the monitor prints. A page that was opened without it
            only looks; every request that changes something must carry it.
        handlers: by the type of request.
    """

    def __init__(self) -> None:
        self.token = new_token()
        self.handlers: dict[str, Handler] = {}

    def proves(self, token: object) -> bool:
        """Whether this is the token."""
        return isinstance(token, str) and compare_digest(token.encode(errors="replace"), self.token.encode())

    def read(self, viewer: Viewer, text: str) -> dict[str, Any]:
        """The request in a text, see `weberlink_page.messages`; a refusal, of type `answer`, if it is none or the page
        may not make it.
        """
        try:
            request: dict[str, Any] = REQUEST.validate_json(text)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            return refusal(f"{'.'.join(map(str, first['loc'])) or 'request'}: {first['msg']}")
        kind = request["type"]
        if not viewer.may_change:
            return refusal(READ_ONLY) | {"to": kind}
        if not self.proves(request.get("token")):
            return refusal(UNPROVEN) | {"to": kind}
        return request

    async def answer(self, viewer: Viewer, request: dict[str, Any]) -> Answer | None:
        """The handler's answer: of type `answer`, with `to`, the type of the request, unless it names its own."""
        kind = request["type"]
        handler = self.handlers.get(kind)
        if handler is None:
            return refusal(f"{kind}: this monitor does not do that") | {"to": kind}
        answer = await handler(viewer, {key: value for key, value in request.items() if key not in ("type", "token")})
        return answer if answer is None or answer.get("type") == "handle" else {"type": "answer", "to": kind} | answer
