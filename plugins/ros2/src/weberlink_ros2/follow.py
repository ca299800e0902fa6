"""Follows one running session of this host, and hands the records of its sides to a bridge as they are written."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from signal import SIGHUP, SIGINT, SIGTERM, signal
from threading import Event
from time import monotonic
from typing import TYPE_CHECKING

from weberlink_figures.watching.rings import RingOpener, RingSource, find_rings

if TYPE_CHECKING:
    from weberlink_ros2.topics import TopicBridge

NICENESS = 5
FIND_S = 0.25  # period of looking for rings

Tell = Callable[[str], None]


class SessionFollower:
    """Follows one session at a time: the named one, else the newest that runs; when it has ended, the next one.

    `tell` is called with lines for the user; `where` is the folder of the rings, None for those of this user.
    """

    def __init__(self, bridge: "TopicBridge", only: str | None, tell: Tell, where: Path | None = None) -> None:
        self._bridge, self._only, self._tell, self._where = bridge, only, tell, where
        self._opener = RingOpener(tell)
        self._find_at = 0.0
        self.session: str | None = None  # that is followed
        self._sources: dict[str, RingSource] = {}  # its sides on this host that run

    def look(self, now: float) -> None:
        """One round: find sides, and hand on what they have written since the last one."""
        if now >= self._find_at:
            self._find_at = now + FIND_S
            self._find()
        for side, source in list(self._sources.items()):
            records = source.read()
            if len(records):
                self._bridge.put(source, records)
            if source.drained:
                lost = self._bridge.end(source)
                words = f"; {lost} records were overwritten before they were read" if lost else ""
                self._tell(f"session {self.session}: {side} is over{words}")
                source.close()
                del self._sources[side]
        if not self._sources:
            self.session = None
        self._bridge.look(now)

    def close(self) -> None:
        """Stop reading; the bridge remains open."""
        for source in self._sources.values():
            source.close()
        self._sources.clear()

    def _find(self) -> None:
        rings = find_rings(self._where)
        wanted = [self.session] if self.session is not None else [self._only] if self._only is not None else list(rings)
        for name in reversed(wanted):
            for side, ring in rings.get(name, {}).items():
                if side not in self._sources and (source := self._opener.open(ring)) is not None:
                    self.session, self._sources[side] = name, source
                    self._bridge.begin(name, source)
                    self._tell(f"session {name}: {side} at {source.rate_hz:g} Hz")
            if self.session is not None:
                return


def run(bridge: "TopicBridge", only: str | None, period_s: float, tell: Tell) -> None:
    """Follow sessions as `SessionFollower` until a signal, from the main thread; then close the bridge."""
    over = Event()
    for number in (SIGINT, SIGTERM, SIGHUP):
        signal(number, lambda _number, _frame: over.set())
    os.nice(NICENESS)  # the daemons of the same host come first
    follower = SessionFollower(bridge, only, tell)
    try:
        follower.look(monotonic())
        if follower.session is None:
            tell("waiting for a session; start one, for example: weberlink try")
        due = monotonic()
        while not over.wait(max(0.0, due - monotonic())):
            follower.look(monotonic())
            due = max(monotonic(), due + period_s)
    finally:
        follower.close()
        bridge.close()


def tell(name: str, text: str) -> None:
    """Print a line for the user of the bridge with this name."""
    print(f"weberlink bridge {name}: {text}", file=sys.stderr, flush=True)  # noqa: T201
