"""The one reader: finds sessions, follows them, and fills the queues of the pages that look at them.

Owns which sessions there are and which of them a page sees. Knows nothing of HTTP.
"""

import asyncio
import json
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any

from weberlink.apps.monitor import changes
from weberlink.apps.monitor.feed import Feed, RingFeed
from weberlink.apps.monitor.finding import Found, find
from weberlink.apps.monitor.session import Session
from weberlink.apps.monitor.viewer import Kind, Viewer
from weberlink.telemetry.ring import RingFormatError

LOOK_S = 0.05
"""From one look at the rings to the next while somebody watches."""
LOOK_ALONE_S = 0.25
"""The same while nobody does; the rings hold ten seconds."""
FIND_S = 0.25
FIGURES_S = 0.5
ASK_TIMES = 5
ASK_AGAIN_S = 1.0
ENDED_KEPT = 4
"""Sessions that are over and can still be looked at."""


def to_json(document: dict[str, Any]) -> str:
    return json.dumps(document, allow_nan=False, separators=(",", ":"))


class Watch:
    """All sessions, and all pages.

    Args:
        where: folder of the rings; None for those of this user.
        only: name of the one session to follow; None for all.
        tell: told once, in a line, of what a person should know.
    """

    def __init__(self, where: Path | None, only: str | None, tell: Callable[[str], None]) -> None:
        self.sessions: dict[str, Session] = {}
        """The newest last."""
        self.viewers: list[Viewer] = []
        self._where = where
        self._only = only
        self._tell = tell
        self._known: set[tuple[str, int]] = set()
        """Ring files that were looked into, by path and inode."""
        self._find_at = 0.0
        self._figures_at = 0.0
        self._asking: set[asyncio.Task[None]] = set()

    @property
    def newest(self) -> Session | None:
        """The one that began last; what runs before what is over, and another host, if asked for, before this one."""
        ranked = sorted(self.sessions.values(), key=lambda session: (not session.ended, session.remote))
        return ranked[-1] if ranked else None

    async def run(self) -> None:
        """Watch until cancelled."""
        try:
            while True:
                self.look(monotonic())
                await asyncio.sleep(LOOK_S if self.viewers else LOOK_ALONE_S)
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
        for session in list(self.sessions.values()):
            if not session.ended:
                self._follow(session, is_figures_time)
        self._assign()
        self._forget()

    def join(self, viewer: Viewer) -> None:
        """Add a page, and greet it if there is a session to see."""
        self.viewers.append(viewer)
        self._assign()

    def leave(self, viewer: Viewer) -> None:
        self.viewers.remove(viewer)

    def overview(self) -> list[dict[str, Any]]:
        """The sessions, the newest first."""
        newest = self.newest
        return [
            {
                "session": session.name,
                "sides": list(session.feeds),
                "live": not session.ended,
                "newest": session is newest,
                "remote": session.remote,
                "rate_hz": session.rate_hz,
                "file": next((of.description.get("file") for of in session.feeds.values() if of.description), None),
            }
            for session in reversed(self.sessions.values())
        ]

    async def change(self, viewer: Viewer, document: object) -> dict[str, Any]:
        """Answer what a page sent."""
        request = changes.read_request(document)
        session = self.sessions.get(viewer.watching or "")
        ring = None if session is None else next((of.ring for of in session.feeds.values() if of.ring), None)
        if isinstance(request, str):
            answer: dict[str, Any] = {"accepted": False, "why": request}
        elif not viewer.may_change:
            answer = {"accepted": False, "why": "this page may look only; changes are for this user on this host"}
        elif session is None or session.ended or session.remote or ring is None:
            answer = {"accepted": False, "why": "there is no session on this host that could be changed"}
        else:
            answer = await changes.ask(ring, request)
            self._take_settings(session, answer)
        return {"type": "answer"} | answer

    def put(self, session: Session) -> None:
        """Add a session, in place of an earlier one of that name."""
        earlier = self.sessions.pop(session.name, None)
        if earlier is not None:
            earlier.close()
        self.sessions[session.name] = session
        for viewer in self._viewers_of(session.name):
            self._introduce(viewer, session)

    def admit(self, name: str, feed: Feed) -> None:
        """Take a feed of this host into its session, which begins with it if there is none that goes on."""
        session = self.sessions.get(name)
        if session is None or feed.side in session.feeds:
            self.put(Session(name, feed))
        else:
            session.admit(feed)
            for viewer in self._viewers_of(name):
                self._greet(viewer, session, Kind.AGAIN)

    def _find(self) -> None:
        for name, rings in find(self._where).items():
            if self._only in (None, name):
                for found in rings.values():
                    self._open(found)

    def _open(self, found: Found) -> None:
        key = (str(found.path), found.number)
        if key in self._known:
            return
        self._known.add(key)
        try:
            feed = RingFeed(found.path)
        except FileNotFoundError:
            return
        except (RingFormatError, OSError) as error:
            self._tell(f"passed over: {error}")
            return
        if not feed.alive:
            feed.close()
            return
        self.admit(found.session, feed)
        self._tell(f"session {found.session}: {feed.side} at {feed.rate_hz:g} Hz")

    def _follow(self, session: Session, is_figures_time: bool) -> None:
        viewers = self._viewers_of(session.name)
        for message in session.look(show=bool(viewers)):
            text = to_json(message)
            for viewer in viewers:
                viewer.put(Kind.ROWS, text)
        self._keep_settings(session)
        if session.ended:
            self._tell(f"session {session.name}: over")
        if viewers and (is_figures_time or session.ended):
            text = to_json(session.figures())
            for viewer in viewers:
                viewer.put(Kind.FINAL if session.ended else Kind.FIGURES, text)

    def _assign(self) -> None:
        """See that every page looks at the session that it should."""
        newest = self.newest
        for viewer in self.viewers:
            session = self.sessions.get(viewer.pinned or "", newest)
            if session is not None and viewer.watching != session.name:
                self._introduce(viewer, session)

    def _greet(self, viewer: Viewer, session: Session, kind: Kind) -> None:
        hello = session.hello()
        hello["readonly"] = hello["readonly"] or not viewer.may_change
        viewer.put(kind, to_json(hello))

    def _introduce(self, viewer: Viewer, session: Session) -> None:
        """Show a page another session, with its last seconds."""
        viewer.watching = session.name
        self._greet(viewer, session, Kind.HELLO)
        for message in session.backlog():
            viewer.put(Kind.ROWS, to_json(message))
        viewer.put(Kind.FINAL if session.ended else Kind.FIGURES, to_json(session.figures()))

    def _viewers_of(self, name: str) -> list[Viewer]:
        return [viewer for viewer in self.viewers if viewer.watching == name]

    def _forget(self) -> None:
        watched = {viewer.watching for viewer in self.viewers}
        over = [session for session in self.sessions.values() if session.ended and session.name not in watched]
        for session in over[:-ENDED_KEPT]:
            session.close()
            del self.sessions[session.name]

    def _keep_settings(self, session: Session) -> None:
        """Ask a daemon for the settings in force when its records say that they changed, and once at the beginning."""
        count = session.settings_count
        if session.remote or count is None or count == session.settings_asked_at:
            return
        session.settings_asked_at = count
        feeds = [of for of in session.feeds.values() if of.ring is not None]
        if feeds and feeds[0].ring is not None and feeds[0].description and feeds[0].description.get("changes"):
            task = asyncio.get_running_loop().create_task(self._ask_settings(session, feeds[0].ring))
            self._asking.add(task)
            task.add_done_callback(self._asking.discard)

    async def _ask_settings(self, session: Session, ring: Path) -> None:
        for _ in range(ASK_TIMES):
            answer = await changes.ask(ring, {})
            self._take_settings(session, answer)
            if "settings" in answer or session.ended:
                return
            await asyncio.sleep(ASK_AGAIN_S)

    @staticmethod
    def _take_settings(session: Session, answer: dict[str, Any]) -> None:
        if isinstance(answer.get("settings"), dict):
            session.settings = answer["settings"]
            session.generation = answer.get("generation", session.generation)
