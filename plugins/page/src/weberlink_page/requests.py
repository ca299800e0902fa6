"""Requests of pages: who may make them, what answers them, and those that go to the daemons of a session."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from hmac import compare_digest
from typing import Any

from pydantic import ValidationError

from weberlink.session.control_socket import LINK_SETTINGS
from weberlink.session.emergency import NO_SESSION
from weberlink_figures.watching.control import Answer, ask_daemon, change, refusal
from weberlink_page.access import new_token
from weberlink_page.front import UNPROVEN
from weberlink_page.messages import REQUEST
from weberlink_page.session import PageSession
from weberlink_page.viewer import Viewer

LONGEST_MESSAGE = 4096  # longest message of a page [bytes]: it only asks for changes
URGENT = frozenset({"drive", "emergency"})
"""Requests that wait for no earlier one of their page; their handlers must not take long."""
READ_ONLY = "this page is read-only: open the address that weberlink printed, the key in it permits changes"
INHERIT_TIMES, INHERIT_AGAIN_S = 150, 0.2
"""How often, and how soon again, a new session is asked to take the settings of the one before."""

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


class SessionControl:
    """Passes requests on to the daemons of this host, which check them.

    `link_changed` is called with a session when another link is in force.

    Attributes:
        links: emulated links in force, by session, as far as they are known.
        agreed: changes that the daemons accepted, by session; they may hold a little later.
    """

    def __init__(
        self,
        sessions: Mapping[str, PageSession],
        link_changed: Callable[[PageSession], None],
        tell: Callable[[str], None],
    ) -> None:
        self._sessions, self._link_changed, self._tell = sessions, link_changed, tell
        self.links: dict[str, dict[str, Any]] = {}
        self.agreed: dict[str, dict[str, Any]] = {}

    async def change(self, name: str | None, request: Mapping[str, Any]) -> Answer:
        """Change settings or the emulated link of a session that runs."""
        session = self._sessions.get(name or "")
        answer = await change(session, request)
        if session is not None:
            self.take(session, answer)
            if answer["accepted"]:
                settings = {key: value for key, value in request.items() if key not in LINK_SETTINGS}
                self.agreed.setdefault(session.name, {}).update(settings)
        return answer

    def forget(self, name: str) -> None:
        """Drop what is known of a session."""
        self.links.pop(name, None)
        self.agreed.pop(name, None)

    def take(self, session: PageSession, answer: Answer) -> None:
        """Note settings and link in force that a daemon told."""
        if isinstance(answer.get("settings"), dict):
            session.settings = answer["settings"]
            session.generation = answer.get("generation", session.generation)
        link = answer.get("link")
        if isinstance(link, dict) and self.links.get(session.name) != link:
            self.links[session.name] = link
            self._link_changed(session)

    async def inherit(self, former: str, name: str) -> None:
        """Apply the settings of a former session to a new session once it accepts them."""
        kept = self._in_force(former)
        answer = refusal("it did not begin")
        for _ in range(INHERIT_TIMES):
            await asyncio.sleep(INHERIT_AGAIN_S)
            session = self._sessions.get(name)
            if session is None or len(session.sources) < 2:
                continue
            present = self._in_force(name)
            changed = {key: value for key, value in kept.items() if value is not None and present.get(key) != value}
            if session.ended or not changed:
                return
            answer = await self.change(name, changed)
            if answer["accepted"]:
                return
        self._tell(f"session {name} does not take over the settings: {answer['why']}")

    def _in_force(self, name: str) -> dict[str, Any]:
        """Settings and emulated link of a session: agreed, in force or as configured."""
        session = self._sessions.get(name)
        if session is None:
            return {}
        told = session.hello()
        return {**told["settings"], **self.agreed.get(name, {}), **(self.links.get(name, told["link"]) or {})}

    async def stop(self, name: str | None, why: str) -> Answer:
        """End a session in order."""
        session = self._sessions.get(name or "")
        if session is None or session.ended:
            return refusal(f"{NO_SESSION} to stop")
        return await asyncio.to_thread(ask_daemon, session.ring, {"stop": why})  # which ends the other side, too
