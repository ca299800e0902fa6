"""Requests to the daemons: live changes, the emulated link, an orderly stop."""

import asyncio
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from weberlink.session.control_socket import LiveChangeError, ask
from weberlink.session.emergency import NO_SESSION
from weberlink.watching.rings import RingSource
from weberlink.watching.session import WatchedSession

ANSWER_S = 2.0
"""How long a daemon may take to answer."""
LINK_KEYS = frozenset({"delay_ms", "jitter_ms", "loss"})
"""Settings of the emulated link: each side applies them to what it sends."""
INHERIT_TIMES = 150
INHERIT_AGAIN_S = 0.2
"""How often, and how soon again, a new session is asked to take the settings of the one before."""

Answer = dict[str, Any]


def refusal(why: str) -> Answer:
    """A request that was refused, with the reason."""
    return {"type": "answer", "accepted": False, "why": why}


class SessionControl:
    """Passes requests on to the daemons of this host, which check them.

    Args:
        sessions: by name.
        link_changed: called with a session when another link is in force.
        tell: called with lines for the user.

    Attributes:
        links: emulated links in force, by session, as far as they are known.
        agreed: changes that the daemons accepted, by session; they may hold a little later.
    """

    def __init__(
        self,
        sessions: Mapping[str, WatchedSession],
        link_changed: Callable[[WatchedSession], None],
        tell: Callable[[str], None],
    ) -> None:
        self._sessions, self._link_changed, self._tell = sessions, link_changed, tell
        self.links: dict[str, dict[str, Any]] = {}
        self.agreed: dict[str, dict[str, Any]] = {}

    async def change(self, name: str | None, request: dict[str, Any]) -> Answer:
        """Change settings of both sides of a session that runs, or of the emulated link in both directions."""
        if not request:
            return refusal("nothing to change; name weber, predictor, delay_ms, jitter_ms or loss")
        session = self._running(name)
        return refusal(f"{NO_SESSION} to change") if session is None else await self._apply(session, request)

    async def _apply(self, session: WatchedSession, request: dict[str, Any]) -> Answer:
        """Apply settings to a session: one side agrees with the other on those of the codec; the link needs both."""
        link = {key: value for key, value in request.items() if key in LINK_KEYS}
        settings = {key: value for key, value in request.items() if key not in LINK_KEYS}
        answer: Answer = {}
        if settings:
            answer = await asyncio.to_thread(ask_daemon, session.ring, settings)
            self.take(session, answer)
            if answer.get("accepted"):
                self.agreed.setdefault(session.name, {}).update(settings)
        if link and answer.get("accepted", True):
            answers = await asyncio.to_thread(_ask_sides, session, link)
            for each in answers.values():
                self.take(session, each)
            answer |= _joined(answers)
        return answer

    def forget(self, name: str) -> None:
        """Drop what is known of a session."""
        self.links.pop(name, None)
        self.agreed.pop(name, None)

    def take(self, session: WatchedSession, answer: Answer) -> None:
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
            answer = await self._apply(session, changed)
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
        session = self._running(name)
        if session is None:
            return refusal(f"{NO_SESSION} to stop")
        return await asyncio.to_thread(ask_daemon, session.ring, {"stop": why})  # which ends the other side, too

    def _running(self, name: str | None) -> WatchedSession | None:
        session = self._sessions.get(name or "")
        return None if session is None or session.ended else session


def _ask_sides(session: WatchedSession, request: dict[str, Any]) -> dict[RingSource, Answer]:
    """The answers of the sides of a session that run on this host; they are asked at the same time."""
    running = [source for source in session.sources.values() if not source.drained]
    if not running:
        return {}
    *others, last = running
    with ThreadPoolExecutor(max(1, len(others))) as threads:  # the last one in this thread
        asked = {each: threads.submit(ask_daemon, each.ring, request) for each in others}
        answer = ask_daemon(last.ring, request)
        return {each: future.result() for each, future in asked.items()} | {last: answer}


def _joined(answers: Mapping[RingSource, Answer]) -> Answer:
    """One answer for several daemons; it is a refusal, which names the side, unless all of them accepted."""
    joined: Answer = {key: value for answer in answers.values() for key, value in answer.items()}
    refused = {each: answer.get("why") for each, answer in answers.items() if not answer.get("accepted")}
    if refused or not answers:
        reasons = dict.fromkeys(f"{each.side}: {why}" for each, why in refused.items())
        return joined | {"accepted": False, "why": "; ".join(reasons) or NO_SESSION}
    joined.pop("why", None)
    return joined


def ask_daemon(ring: Path, request: dict[str, Any]) -> Answer:
    """The daemon's answer; a refusal with the reason if it cannot be reached. Blocks."""
    try:
        return ask(ring, request, ANSWER_S)
    except LiveChangeError as error:
        return {"accepted": False, "why": str(error)}
