"""Who drives a session: one page at a time has the handle, and its targets go to the master's `pointer` device.

The first page that holds gets the handle. It keeps it while it holds, and `LEASE_S` after its last release, so that
a visitor can grasp again; then it is free. A page that leaves, also abruptly, releases it at once. Whatever happens to
this process, the device takes 100 ms of silence as a release.
"""

from collections.abc import Callable, Mapping
from time import monotonic
from typing import Any

from weberlink.config import MASTER
from weberlink.geometry.vector import Vector
from weberlink_figures.watching.control import Answer
from weberlink_figures.watching.session import WatchedSession
from weberlink_page.requests import READ_ONLY
from weberlink_page.viewer import Viewer
from weberlink_pointer.target_link import PointerSender

LEASE_S = 5.0  # how long a page keeps the handle after it has released it, or fallen silent
MOST_PER_S = 250.0
BURST = 25.0  # targets of one page that are passed on: per second, and at once. More are dropped; a release never is.
REMIND_S = 0.5  # least time between two refusals to the same page
NOT_DRIVEN = "the operator of this session is not the page"
TAKEN = "another visitor drives; wait until the handle is free"


class _Handle:
    """The handle of a session while a page has it."""

    def __init__(self, holder: Viewer, sender: PointerSender, now: float) -> None:
        self.holder = holder
        self.held = False
        self.used_at = self._counted_at = now
        self._sender = sender
        self._target: Vector = (0.0, 0.0, 0.0)
        self._allowance = BURST

    def pass_on(self, target: Vector, held: bool, now: float) -> None:
        """Send a target, unless there were too many, or a release of what is held."""
        self._allowance = min(BURST, self._allowance + MOST_PER_S * (now - self._counted_at))
        self._counted_at = now
        if (held and self._allowance >= 1.0) or (self.held and not held):
            self._allowance -= 1.0
            self.used_at = now
            self._target, self.held = target, held
            self._sender.send(target, held)  # one that the device has no room for is lost

    def release(self) -> None:
        """Let go, and close the connection."""
        if self.held:
            self.held = False
            self._sender.send(self._target, False)
        self._sender.close()


def pointer_pid(session: WatchedSession | None) -> int | None:
    """Process id of the daemon that takes targets; None if there is none on this host, or it has another device."""
    source = None if session is None else session.sources.get(MASTER)
    if source is None or source.drained or source.description is None:
        return None
    device = source.description.get("system", {}).get("master", {}).get("device", {})
    pid = source.description.get("pid")
    return pid if device.get("driver") == "pointer" and isinstance(pid, int) else None


class Driving:
    """The handles of all sessions; `viewers` gives the pages of one, `connect` a sender to the daemon of a process."""

    def __init__(
        self,
        sessions: Mapping[str, WatchedSession],
        viewers: Callable[[str], list[Viewer]],
        connect: Callable[[int], PointerSender] = PointerSender,
    ) -> None:
        self._sessions, self._viewers, self._connect = sessions, viewers, connect
        self._handles: dict[str, _Handle] = {}
        self._reminded: dict[Viewer, float] = {}

    async def drive(self, viewer: Viewer, request: dict[str, Any]) -> Answer | None:
        """Pass a target on to the device; the answer of a refused one is the state of the handle."""
        now, name, held = monotonic(), viewer.watching or "", request["held"]
        handle = self._handles.get(name)
        if handle is None and held and (pid := pointer_pid(self._sessions.get(name))) is not None:
            handle = self._handles[name] = _Handle(viewer, self._connect(pid), now)
            self.announce(name)
        if handle is not None and handle.holder is viewer:
            handle.pass_on(request["target"], held, now)
        elif held and now - self._reminded.get(viewer, -REMIND_S) >= REMIND_S:
            self._reminded[viewer] = now
            return self._state(viewer)
        return None

    def look(self, now: float) -> None:
        """Free the handles that were not used for long, and those of ended sessions."""
        for name, handle in list(self._handles.items()):
            if now - handle.used_at > LEASE_S or pointer_pid(self._sessions.get(name)) is None:
                self._free(name)

    def leave(self, viewer: Viewer) -> None:
        """Release what a page holds: it has gone, or shows another session."""
        self._reminded.pop(viewer, None)
        for name, handle in list(self._handles.items()):
            if handle.holder is viewer:
                self._free(name)

    def tell(self, viewer: Viewer) -> None:
        """Tell a page the state of the handle of its session."""
        viewer.put("handle", self._state(viewer))

    def announce(self, name: str) -> None:
        """Tell all pages of a session the state of its handle."""
        for viewer in self._viewers(name):
            self.tell(viewer)

    @property
    def is_any(self) -> bool:
        """Whether a page has a handle."""
        return bool(self._handles)

    def _free(self, name: str) -> None:
        self._handles.pop(name).release()
        self.announce(name)

    def _state(self, viewer: Viewer) -> Answer:
        name = viewer.watching or ""
        handle = self._handles.get(name)
        state, why = "free", None
        if pointer_pid(self._sessions.get(name)) is None:
            state, why = "none", NOT_DRIVEN
        elif not viewer.may_change:
            state, why = "none", READ_ONLY
        elif handle is not None and handle.holder is viewer:
            state = "yours"
        elif handle is not None:
            state, why = "taken", TAKEN
        return {"type": "handle", "state": state, "why": why}
