"""Finds sessions, reads their records, queues messages for all pages, and takes their requests."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any, Protocol

from weberlink.apps.monitor import driving
from weberlink.apps.monitor.keeper import SessionKeeper
from weberlink.apps.monitor.requests import Requests, always
from weberlink.apps.monitor.viewer import Topic, Viewer, to_json
from weberlink.watching.control import Answer, SessionControl, ask_daemon, refusal, take_settings
from weberlink.watching.events import events_message
from weberlink.watching.rings import Feed, RingOpener, find_rings
from weberlink.watching.session import WatchedSession

LOOK_S = 0.05
"""Period of reading the rings while a page is open."""
LOOK_DRIVEN_S = 1.0 / 60.0
"""Period while a page drives, which is to see its handle move."""
LOOK_ALONE_S = 0.25
"""Period without a page; the rings hold ten seconds."""
FIND_S = 0.25
FIGURES_S = 0.5
HISTORY_S = 2.0
ASK_TIMES = 5
ASK_AGAIN_S = 1.0
ENDED_KEPT = 4
"""Ended sessions that can still be viewed."""


class Attachment(Protocol):
    """A part of the monitor with messages of its own, beside requests that it answers."""

    def look(self, now: float) -> None:
        """Called at each look at the sessions."""

    def hello(self, session: WatchedSession, viewer: Viewer) -> dict[str, Any]:
        """What it adds to the greeting of a session for a page."""

    def introduced(self, session: WatchedSession, viewer: Viewer) -> None:
        """Called when a page is shown another session, after the greeting."""


class SessionWatcher:
    """All sessions and all pages.

    Args:
        where: folder of the rings; None for those of this user.
        only: name of the session to follow; None for all.
        tell: called with lines for the user.
    """

    def __init__(self, where: Path | None, only: str | None, tell: Callable[[str], None]) -> None:
        self.sessions: dict[str, WatchedSession] = {}
        """The newest last."""
        self.viewers: list[Viewer] = []
        self._where = where
        self._only = only
        self._tell = tell
        self._opener = RingOpener(tell)
        self._find_at = 0.0
        self._figures_at = 0.0
        self._history_at = 0.0
        self._attached: list[Attachment] = []
        self._asking: set[asyncio.Task[None]] = set()
        self.requests = Requests()
        """What pages may ask for; other parts of the monitor add theirs."""
        self.control = SessionControl(self.sessions, self._greet_all, tell)
        self.driving = driving.Driving(self.sessions, self.viewers_of, driving.connect)
        self.keeper: SessionKeeper | None = None
        """Of the session that pages may start; None where they may not."""
        self.requests.add("change", self._change)
        self.requests.add("drive", self.driving.drive, urgent=always)
        self.requests.add("session", self._session, urgent=lambda request: request.get("do") == "emergency")
        self.requests.add("ping", _pong, reads=True, urgent=always)
        self.requests.add("subscribe", self._subscribe, reads=True)

    def attach(self, part: Attachment) -> None:
        """Add a part."""
        self._attached.append(part)

    @property
    def newest(self) -> WatchedSession | None:
        """The session to show by default: running before ended, then the one that began last."""
        ranked = sorted(self.sessions.values(), key=lambda session: not session.ended)
        return ranked[-1] if ranked else None

    async def run(self) -> None:
        """Run until cancelled."""
        due = monotonic()
        try:
            while True:
                self.look(monotonic())
                due = max(monotonic(), due + self._pause)
                await asyncio.sleep(due - monotonic())
        finally:
            self.control.close()
            for task in self._asking:
                task.cancel()
            for session in self.sessions.values():
                session.close()

    @property
    def _pause(self) -> float:
        """Time to the next look [s]."""
        if self.driving.is_any:
            return LOOK_DRIVEN_S
        return LOOK_S if self.viewers else LOOK_ALONE_S

    def look(self, now: float) -> None:
        """One look at everything."""
        if now >= self._find_at:
            self._find_at = now + FIND_S
            self._find()
        is_figures_time = now >= self._figures_at
        if is_figures_time:
            self._figures_at = now + FIGURES_S
        is_history_time = now >= self._history_at
        if is_history_time:
            self._history_at = now + HISTORY_S
        for part in self._attached:
            part.look(now)
        for session in list(self.sessions.values()):
            if not session.ended:
                self._follow(session, is_figures_time=is_figures_time, is_history_time=is_history_time)
            self._tell_events(session)
        self.driving.look(now)
        self._assign()
        self._forget()

    def join(self, viewer: Viewer) -> None:
        """Add a page, and greet it if there is a session to see."""
        self.viewers.append(viewer)
        self._assign()
        if viewer.watching is None:
            viewer.greet(to_json({"type": "hello", "session": None} | self._own_part(viewer)))
        if self.keeper is not None:
            viewer.put("keeper", to_json(self.keeper.message))

    def leave(self, viewer: Viewer) -> None:
        self.viewers.remove(viewer)
        self.driving.leave(viewer)

    def tell_all(self, topic: Topic, document: dict[str, Any]) -> None:
        """Tell every page."""
        text = to_json(document)
        for viewer in self.viewers:
            viewer.put(topic, text)

    def overview(self) -> list[dict[str, Any]]:
        """All sessions, the newest first."""
        newest = self.newest
        return [
            {
                "session": session.name,
                "sides": list(session.feeds),
                "live": not session.ended,
                "newest": session is newest,
                "rate_hz": session.rate_hz,
                "file": session.description.get("file"),
            }
            for session in reversed(self.sessions.values())
        ]

    async def _change(self, viewer: Viewer, request: dict[str, Any]) -> Answer:
        """Change settings of the session that a page shows."""
        return await self.control.change(viewer.watching, request)

    async def _session(self, viewer: Viewer, request: dict[str, Any]) -> Answer:
        """Start or stop a session, or stop it at once."""
        do, keeper, name = request.get("do"), self.keeper, viewer.watching
        if do == "start":
            if keeper is None:
                return refusal("this monitor starts no sessions; weberlink try does")
            return keeper.request_start(request.get("scene"))
        if do == "stop":
            return await self._stop(name)
        if do == "emergency":
            return await self.emergency(name)
        return refusal('"do" is start, stop or emergency')

    async def _stop(self, name: str | None) -> Answer:
        if self.keeper is not None:
            if self.keeper.is_starting:
                return self.keeper.request_stop()
            self.keeper.expect_end(name)
        return await self.control.stop(name, "stopped from the page")

    async def emergency(self, name: str | None) -> Answer:
        """Force to zero at once, at both ends of a session; of all sessions of this host if none of that name runs."""
        if self.keeper is not None:
            for session in self.control.halted_by(name):
                self.keeper.expect_end(session.name)
        return await self.control.emergency(name)

    def put(self, session: WatchedSession) -> None:
        """Add a session, or replace an earlier one of that name."""
        earlier = self.sessions.pop(session.name, None)
        if earlier is not None:
            earlier.close()
        self.sessions[session.name] = session
        if self.keeper is not None:
            self.keeper.note_running(session.name)
        for viewer in self.viewers_of(session.name):
            self._introduce(viewer, session)

    def admit(self, name: str, feed: Feed) -> None:
        """Add a feed to its session, or begin a session with it."""
        session = self.sessions.get(name)
        if session is None or feed.side in session.feeds:
            self.put(WatchedSession(name, feed))
        else:
            session.admit(feed)
            self._greet_all(session)
            self.driving.announce(name)

    def _find(self) -> None:
        for name, rings in find_rings(self._where).items():
            if self._follows(name):
                for ring in rings.values():
                    feed = self._opener.open(ring)
                    if feed is not None:
                        self.admit(name, feed)
                        self._tell(f"session {name}: {feed.side} at {feed.rate_hz:g} Hz")

    def _follows(self, name: str) -> bool:
        """Whether a session is to be shown: with a keeper, one that it has started."""
        return self._only in (None, name) if self.keeper is None else name in self.keeper.started

    def _follow(self, session: WatchedSession, *, is_figures_time: bool, is_history_time: bool) -> None:
        viewers = self.viewers_of(session.name)
        for message in session.look(show=bool(viewers)):
            text = to_json(message)
            for viewer in viewers:
                viewer.put("rows", text)
        self._keep_settings(session)
        if session.ended:
            self._tell(f"session {session.name}: over")
            self.driving.announce(session.name)
        self._tell_events(session)
        if is_history_time or session.ended:
            self._tell_history(session, viewers)
        if viewers and (is_figures_time or session.ended):
            text = to_json(session.figures())
            for viewer in viewers:
                viewer.put("final" if session.ended else "figures", text)

    def _tell_events(self, session: WatchedSession) -> None:
        events = session.log.since(session.told_events)
        session.told_events = session.log.count
        if events:
            text = to_json(events_message(session.name, events))
            for viewer in self.viewers_of(session.name):
                viewer.put("events", text)

    @staticmethod
    def _tell_history(session: WatchedSession, viewers: list[Viewer]) -> None:
        wanting = [viewer for viewer in viewers if viewer.wants_history]
        if wanting:
            text = to_json(session.history)
            for viewer in wanting:
                viewer.put("history", text)

    async def _subscribe(self, viewer: Viewer, request: dict[str, Any]) -> dict[str, Any] | None:
        """Begin or end the messages with the history."""
        if not isinstance(request.get("history"), bool):
            return refusal('expected {"type": "subscribe", "history": true} or false')
        viewer.wants_history = request["history"]
        session = self.sessions.get(viewer.watching or "")
        if session is not None:
            self._tell_history(session, [viewer])
        return None

    def _assign(self) -> None:
        """Assign each page its session: the one it asked for, or the newest."""
        newest = self.newest
        for viewer in self.viewers:
            session = self.sessions.get(viewer.pinned or "", newest)
            if session is not None and viewer.watching != session.name:
                self._introduce(viewer, session)

    def _greeting(self, viewer: Viewer, session: WatchedSession) -> str:
        hello = session.hello()
        hello["readonly"] = hello["readonly"] or not viewer.may_change
        hello["link"] = self.control.links.get(session.name, hello["link"])
        hello |= self._own_part(viewer)
        for part in self._attached:
            hello |= part.hello(session, viewer)
        return to_json(hello)

    def _greet_all(self, session: WatchedSession) -> None:
        for viewer in self.viewers_of(session.name):
            viewer.put("again", self._greeting(viewer, session))

    def _own_part(self, viewer: Viewer) -> dict[str, Any]:
        """The part of a greeting that depends on the page."""
        rooms = {"start": False, "scenes": [], "scene": None} if self.keeper is None else self.keeper.rooms
        return {"token": self.requests.token if viewer.may_change else None, "rooms": rooms}

    def _introduce(self, viewer: Viewer, session: WatchedSession) -> None:
        """Switch a page to a session and send its last seconds."""
        viewer.watching = session.name
        self.driving.leave(viewer)
        viewer.greet(self._greeting(viewer, session))
        self.driving.tell(viewer)
        for message in session.backlog():
            viewer.put("rows", to_json(message))
        if session.log.events:
            viewer.put("events", to_json(events_message(session.name, list(session.log.events))))
        self._tell_history(session, [viewer])
        viewer.put("final" if session.ended else "figures", to_json(session.figures()))
        for part in self._attached:
            part.introduced(session, viewer)

    def viewers_of(self, name: str) -> list[Viewer]:
        """The pages that are shown this session."""
        return [viewer for viewer in self.viewers if viewer.watching == name]

    def _forget(self) -> None:
        watched = {viewer.watching for viewer in self.viewers}
        over = [session for session in self.sessions.values() if session.ended and session.name not in watched]
        for session in over[:-ENDED_KEPT]:
            session.close()
            self.control.forget(session.name)
            del self.sessions[session.name]

    def _keep_settings(self, session: WatchedSession) -> None:
        """Ask a daemon for its settings at the beginning, and when its records report a change."""
        count = session.settings_count
        if count is None or count == session.settings_asked_at:
            return
        session.settings_asked_at = count
        task = asyncio.get_running_loop().create_task(self._ask_settings(session))
        self._asking.add(task)
        task.add_done_callback(self._asking.discard)

    async def _ask_settings(self, session: WatchedSession) -> None:
        for _ in range(ASK_TIMES):
            answer = await ask_daemon(session.ring, {})
            take_settings(session, answer)
            self.control.take_link(session, answer)
            if "settings" in answer or session.ended:
                return
            await asyncio.sleep(ASK_AGAIN_S)


async def _pong(_viewer: Viewer, request: dict[str, Any]) -> Answer:
    """Echo the time of a page, so that it can measure the round trip."""
    return {"type": "pong", "at": request.get("at"), "now": monotonic()}
