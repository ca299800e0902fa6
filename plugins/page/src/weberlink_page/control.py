"""Requests of pages to the daemons of a session, and what is known of the settings in force."""

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

from weberlink.session.control_socket import LINK_SETTINGS
from weberlink.session.emergency import NO_SESSION
from weberlink_figures.watching.control import Answer, ask_daemon, change, refusal
from weberlink_page.session import PageSession

INHERIT_TIMES = 150
INHERIT_AGAIN_S = 0.2  # how often, and how soon again, a new session is asked to take the settings of the one before


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
