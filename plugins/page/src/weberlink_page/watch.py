"""Finds sessions, reads their records, queues messages for all pages, and takes their requests."""

import asyncio
import os
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from weberlink.session.emergency import EmergencyStop, Scope
from weberlink_figures.watching.control import Answer, ask_daemon, refusal
from weberlink_figures.watching.rings import RingOpener, RingSource, find_rings
from weberlink_page.driving import Driving
from weberlink_page.front import ANSWER_S, LONGEST_AGE_MS, LOOK_S as LOOK_STOP_S
from weberlink_page.launcher import SessionLauncher
from weberlink_page.messages import Rooms
from weberlink_page.requests import Requests, SessionControl
from weberlink_page.session import PageSession, events_message
from weberlink_page.viewer import Topic, Viewer, put_all

if TYPE_CHECKING:
    from weberlink_page.recording import RecordingService

LOOK_S = 0.05  # period of reading the rings while a page is open
LOOK_DRIVEN_S = 1.0 / 60.0  # period while a page drives, which is to see its handle move
LOOK_ALONE_S = 0.25  # period without a page; the rings hold ten seconds
FIND_S = 0.25
FIGURES_S = 0.5
ASK_TIMES = 5
ASK_AGAIN_S = 1.0
ENDED_KEPT = 4  # ended sessions that can still be viewed


class SessionWatcher:
    """All sessions and all pages.

    Args:
        where: folder of the rings; None for those of this user.
        only: name of the session to follow; None for all.

    Attributes:
        requests: what pages may ask for; other parts of the monitor add theirs.
        launcher: of the session that pages may start; None where they may not.
        recording: of the recordings that pages start.
    """

    def __init__(self, where: Path | None, only: str | None, tell: Callable[[str], None]) -> None:
        self.sessions: dict[str, PageSession] = {}  # the newest last
        self.viewers: list[Viewer] = []
        self._where = where
        self._only = only
        self._tell = tell
        self._opener = RingOpener(tell)
        self._find_at = self._figures_at = 0.0
        self._asked_at: dict[str, int] = {}
        """The count of changes in the records when the daemons of a session were last asked for their settings."""
        self._told_events: dict[str, int] = {}
        self._asking: set[asyncio.Task[None]] = set()
        self.requests = Requests()
        self.control = SessionControl(self.sessions, self._greet_all, tell)
        self.driving = Driving(self.sessions, self.viewers_of)
        self.launcher: SessionLauncher | None = None
        self.recording: RecordingService | None = None
        self.requests.handlers |= {
            "change": lambda viewer, request: self.control.change(viewer.watching, request),
            "drive": self.driving.drive,
            "session": self._session,
            "emergency": self._emergency,
        }

    @property
    def newest(self) -> PageSession | None:
        """The session to show by default: running before ended, then the one that began last."""
        ranked = sorted(self.sessions.values(), key=lambda session: not session.ended)
        return ranked[-1] if ranked else None

    async def run(self) -> None:
        """Run until cancelled."""
        due = monotonic()
        try:
            while True:
                self.look(monotonic())
                period = LOOK_DRIVEN_S if self.driving.is_any else LOOK_S if self.viewers else LOOK_ALONE_S
                due = max(monotonic(), due + period)
                await asyncio.sleep(due - monotonic())
        finally:
            for task in self._asking:
                task.cancel()
            for session in self.sessions.values():
                session.close()

    def look(self, now: float) -> None:
        """One look at everything."""
        if now >= self._find_at:
            self._find_at = now + FIND_S
            self._find()
        is_figures_time = now >= self._figures_at
        if is_figures_time:
            self._figures_at = now + FIGURES_S
        if self.recording is not None:
            self.recording.look(now)
        for session in list(self.sessions.values()):
            if not session.ended:
                self._follow(session, is_figures_time=is_figures_time)
            self._tell_events(session)
        self.driving.look(now)
        self._assign()
        self._forget()

    def join(self, viewer: Viewer) -> None:
        """Add a page, and greet it if there is a session to see."""
        self.viewers.append(viewer)
        self._assign()
        if viewer.watching is None:
            viewer.greet({"type": "hello", "session": None} | self._own_part(viewer))
        if self.launcher is not None:
            viewer.put("launcher", self.launcher.message)

    def leave(self, viewer: Viewer) -> None:
        if viewer in self.viewers:
            self.viewers.remove(viewer)
        self.driving.leave(viewer)

    def tell_all(self, topic: Topic, document: dict[str, Any]) -> None:
        """Tell every page."""
        put_all(self.viewers, topic, document)

    def overview(self) -> list[dict[str, Any]]:
        """All sessions, the newest first."""
        newest = self.newest
        return [
            {
                "session": session.name,
                "sides": list(session.sources),
                "live": not session.ended,
                "newest": session is newest,
                "rate_hz": session.rate_hz,
                "file": session.description.get("file"),
            }
            for session in reversed(self.sessions.values())
        ]

    async def _session(self, viewer: Viewer, request: dict[str, Any]) -> Answer:
        """Start or stop a session."""
        launcher = self.launcher
        if request["do"] == "start":
            if launcher is None:
                return refusal("this monitor starts no sessions; weberlink try does")
            return launcher.request_start(request.get("scene"), request.get("stops"))
        if launcher is not None:
            if launcher.is_starting:
                return launcher.request_stop()
            launcher.expect_end(viewer.watching)
        return await self.control.stop(viewer.watching, "stopped from the page")

    @property
    def scope(self) -> Scope:
        """The sessions that a page may stop: those that are watched here."""
        folder = None if self._where is None else str(self._where)
        return Scope(folder, self._only, None if self.launcher is None else os.getpid())

    def stopped(self, at: float) -> None:
        """Note an emergency stop of this moment: no start from before it is done."""
        if self.launcher is not None:
            self.launcher.on_emergency(at)

    async def _emergency(self, viewer: Viewer, request: dict[str, Any]) -> Answer:
        """Stop the session of a page: its other way, beside that of the front."""
        now = monotonic()
        at = now - 1e-3 * min(max(request.get("age_ms", 0.0), 0.0), LONGEST_AGE_MS)
        self.stopped(at)
        stop = EmergencyStop(self.scope, viewer.watching, at)
        while not stop.advance(monotonic()) and monotonic() < now + ANSWER_S:
            await asyncio.sleep(LOOK_STOP_S)
        answer = stop.answer()
        stop.close()
        return answer

    def put(self, session: PageSession) -> None:
        """Add a session, or replace an earlier one of that name."""
        self._drop(session.name)
        self.sessions[session.name] = session
        if self.launcher is not None:
            self.launcher.note_running(session.name)
        for viewer in self.viewers_of(session.name):
            self._introduce(viewer, session)

    def admit(self, name: str, source: RingSource) -> None:
        """Add a side to its session, or begin a session with it."""
        session = self.sessions.get(name)
        if session is None or source.side in session.sources:
            self.put(PageSession(name, source))
        else:
            session.admit(source)
            self._greet_all(session)
            self.driving.announce(name)

    def _find(self) -> None:
        for name, rings in find_rings(self._where).items():
            # With a launcher, the sessions that it has started.
            if self._only in (None, name) if self.launcher is None else name in self.launcher.started:
                for ring in rings.values():
                    source = self._opener.open(ring)
                    if source is not None:
                        self.admit(name, source)
                        self._tell(f"session {name}: {source.side} at {source.rate_hz:g} Hz")

    def _follow(self, session: PageSession, *, is_figures_time: bool) -> None:
        viewers = self.viewers_of(session.name)
        for message in session.rows(show=bool(viewers)):
            put_all(viewers, "rows", message)
        self._keep_settings(session)
        if session.ended:
            self._tell(f"session {session.name}: over")
            self.driving.announce(session.name)
        self._tell_events(session)
        if viewers and (is_figures_time or session.ended):
            put_all(viewers, "final" if session.ended else "figures", session.figures())

    def _tell_events(self, session: PageSession) -> None:
        events = session.log.since(self._told_events.get(session.name, 0))
        self._told_events[session.name] = session.log.count
        if events:
            put_all(self.viewers_of(session.name), "events", events_message(session.name, events))

    def _assign(self) -> None:
        """Assign each page its session: the one it asked for, or the newest."""
        newest = self.newest
        for viewer in self.viewers:
            session = self.sessions.get(viewer.pinned or "", newest)
            if session is not None and viewer.watching != session.name:
                self._introduce(viewer, session)

    def _greeting(self, viewer: Viewer, session: PageSession) -> dict[str, Any]:
        hello = session.hello()
        hello["readonly"] = hello["readonly"] or not viewer.may_change
        hello["link"] = self.control.links.get(session.name, hello["link"])
        hello |= self._own_part(viewer)
        return hello if self.recording is None else hello | self.recording.hello(session, viewer)

    def _greet_all(self, session: PageSession) -> None:
        for viewer in self.viewers_of(session.name):
            viewer.put("again", self._greeting(viewer, session))

    def _own_part(self, viewer: Viewer) -> dict[str, Any]:
        """The part of a greeting that depends on the page."""
        nothing: Rooms = {"start": False, "scenes": [], "scene": None}
        rooms = nothing if self.launcher is None else self.launcher.rooms
        return {"token": self.requests.token if viewer.may_change else None, "rooms": rooms}

    def _introduce(self, viewer: Viewer, session: PageSession) -> None:
        """Switch a page to a session and send its last seconds."""
        viewer.watching = session.name
        self.driving.leave(viewer)
        viewer.greet(self._greeting(viewer, session))
        self.driving.tell(viewer)
        for message in session.backlog():
            viewer.put("rows", message)
        if session.log.events:
            viewer.put("events", events_message(session.name, list(session.log.events)))
        viewer.put("final" if session.ended else "figures", session.figures())
        if self.recording is not None:
            self.recording.introduced(session, viewer)

    def viewers_of(self, name: str) -> list[Viewer]:
        """The pages that are shown this session."""
        return [viewer for viewer in self.viewers if viewer.watching == name]

    def _forget(self) -> None:
        watched = {viewer.watching for viewer in self.viewers}
        over = [session for session in self.sessions.values() if session.ended and session.name not in watched]
        for session in over[:-ENDED_KEPT]:
            self._drop(session.name)

    def _drop(self, name: str) -> None:
        session = self.sessions.pop(name, None)
        if session is not None:
            session.close()
            self.control.forget(name)
            for noted in (self._asked_at, self._told_events):
                noted.pop(name, None)

    def _keep_settings(self, session: PageSession) -> None:
        """Ask a daemon for its settings at the beginning, and when its records report a change."""
        count = session.settings_count
        if count is None or count == self._asked_at.get(session.name):
            return
        self._asked_at[session.name] = count
        task = asyncio.get_running_loop().create_task(self._ask_settings(session))
        self._asking.add(task)
        task.add_done_callback(self._asking.discard)

    async def _ask_settings(self, session: PageSession) -> None:
        for _ in range(ASK_TIMES):
            answer = await asyncio.to_thread(ask_daemon, session.ring, {})
            self.control.take(session, answer)
            if "settings" in answer or session.ended:
                return
            await asyncio.sleep(ASK_AGAIN_S)
