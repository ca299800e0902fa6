"""Joins a side of another host with the other side on this host: finds it, and dates both on the master's clock."""

from pathlib import Path
from typing import Any

import numpy as np

from weberlink.apps.monitor.remote.feeds import RemoteSide
from weberlink.apps.monitor.remote.messages import SideIntroduction
from weberlink.apps.monitor.rings import Feed, RingFeed, find_rings, joined
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.scoring.session import ANOTHER_CLOCK_S, MARGIN_S, Records
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import COUNTERS
from weberlink.telemetry.ring import RingFormatError

HELD_S = 10.0
"""How long records wait until the clocks are related."""
CLOSE_S = 3.0
"""Largest difference in time of the newest records of two sides of one session, as telemetry is late, too."""
TAIL_S = 0.5
"""How much of the slave still belongs to a session whose master has ended."""


def counterpart(where: Path | None, side: RemoteSide) -> Path | None:
    """The ring on this host of the other side of a remote one; None if there is none.

    The slave's records tell the age of its master's clock. That fits its own master, or another one that was started
    within the same few seconds with the same codec. A session that has both sides on this host is left out: if the
    remote side is one of them, the other one will be introduced too.
    """
    if side.newest is None:
        return None
    own = side.introduction.side
    other = SLAVE if own == MASTER else MASTER
    for rings in reversed(find_rings(where).values()):
        if other in rings and own not in rings and _belongs(rings[other].path, side.newest, side.introduction):
            return rings[other].path
    return None


def _belongs(path: Path, newest: Any, introduction: SideIntroduction) -> bool:
    try:
        feed = RingFeed(path)
    except (RingFormatError, OSError):
        return False
    try:
        same = feed.rate_hz == introduction.rate_hz and _agree(feed.description, introduction.description)
        local = feed.read() if feed.alive and same else np.empty(0, DTYPE)
    finally:
        feed.close()
    if not len(local):
        return False
    remote = np.array([newest], DTYPE)
    master, slave = (remote, local) if introduction.side == MASTER else (local, remote)
    by_slave = float(slave["peer_at"][-1]) + tick_0(master, introduction.rate_hz)
    return abs(by_slave - float(master["at"][-1])) < CLOSE_S  # False where it is unknown, NaN


def _agree(one: dict[str, Any] | None, other: dict[str, Any] | None) -> bool:
    """Whether two descriptions may belong to one session; an unknown one agrees with any."""
    if one is None or other is None:
        return True
    return all(one.get("system", {}).get(part) == other.get("system", {}).get(part) for part in ("codec", "axes"))


def join(local: Feed, remote: Feed) -> tuple["JoinedFeed", "JoinedFeed"]:
    """The two feeds of one session, master first, on the master's clock."""
    master, slave = (local, remote) if local.side == MASTER else (remote, local)
    clock = MasterClock(master.rate_hz, master.began)
    joined_master = JoinedFeed(master, clock, None)
    return joined_master, JoinedFeed(slave, clock, joined_master)


class JoinedFeed:
    """A side of a session of two hosts; the slave is dated on the master's clock and ends a little after it.

    Args:
        feed: of this side.
        clock: shared by both sides.
        master: the other side, if this is the slave.
    """

    ring: Path | None = None
    wall_offset_s: float | None = None
    in_order: bool | None = None

    def __init__(self, feed: Feed, clock: "MasterClock", master: "JoinedFeed | None") -> None:
        self.side, self.rate_hz = feed.side, feed.rate_hz
        self.began: float = feed.began if master is None else master.began
        self.written = 0
        self.drained = False
        self.newest: float = self.began
        """Time of the last record read [s]."""
        self._feed = feed
        self._clock = clock
        self._master = master

    @property
    def description(self) -> dict[str, Any] | None:
        return self._feed.description

    @property
    def lost(self) -> int:
        return self._feed.lost

    def read(self) -> Records:
        records = self._feed.read()
        if self._master is None:
            self._clock.learn(records)
            self.written, self.drained = self._feed.written, self._feed.drained
        else:
            records = self._of_slave(records)
            self.written += len(records)
        if len(records):
            self.newest = float(records["at"][-1])
        return records

    def _of_slave(self, records: Records) -> Records:
        assert self._master is not None
        if self.drained:
            return records[:0]
        records = self._clock.move(records)
        self.drained = self._feed.drained or self._clock.lost
        if self._master.drained:
            end = self._master.newest + TAIL_S
            self.drained = self.drained or (len(records) > 0 and float(records["at"][-1]) > end)
            records = records[records["at"] <= end]
        return records

    def close(self) -> None:
        self._feed.close()


class MasterClock:
    """Dates records of a slave on another host by the clock of its master.

    Each record of a slave has the time on the master's clock since the master's tick 0, which the master's own records
    date. `weberlink.system.scoring.recorded` does the same with recordings; here records come in pieces.

    Args:
        rate_hz: of both sides.
        began: when the master's writer began, on the master's clock [s]; earlier records of the slave are dropped.
    """

    def __init__(self, rate_hz: float, began: float) -> None:
        self._rate_hz = rate_hz
        self._earliest = began - MARGIN_S
        self._tick_0: float | None = None
        self._held: Records = np.empty(0, DTYPE)
        self._offset: tuple[float, float] | None = None
        """The last tick whose offset is known [s, slave's clock], and that offset [s]."""
        self._latest = -np.inf
        self._before: Records | None = None
        self.lost = False
        """Whether the slave now follows another master."""

    def learn(self, master: Records) -> None:
        """Take records of the master."""
        if self._tick_0 is None and len(master):
            self._tick_0 = tick_0(master, self._rate_hz)

    def move(self, slave: Records) -> Records:
        """Take records of the slave; returns those that can be dated, in the master's time, and holds the others."""
        if self.lost:
            return slave[:0]
        held = joined((self._held, slave))[-int(HELD_S * self._rate_hz) :]
        known = np.flatnonzero(np.isfinite(held["peer_at"]))
        if self._tick_0 is None or (self._offset is None and not len(known)):
            self._held = held
            return held[:0]
        self._held = held[:0]
        held = self._of_this_master(held, known)
        return self._counted(self._dated(held, self._tick_0)) if len(held) else held

    def _of_this_master(self, held: Records, known: np.ndarray[tuple[int], np.dtype[np.intp]]) -> Records:
        """Drop records that belong to an earlier or a later master."""
        offsets = held["peer_at"][known] - held["at"][known]
        if self._offset is None:
            jumps = np.flatnonzero(np.abs(np.diff(offsets)) > ANOTHER_CLOCK_S)
            first = int(known[jumps[-1] + 1]) if len(jumps) else 0
            if first:
                self._before = held[first - 1 : first].copy()
            return held[first:]
        jumps = np.flatnonzero(np.abs(np.diff(offsets, prepend=self._offset[1])) > ANOTHER_CLOCK_S)
        if len(jumps):
            self.lost = True
            return held[: int(known[jumps[0]])]
        return held

    def _dated(self, held: Records, origin: float) -> Records:
        known = held[np.isfinite(held["peer_at"])]
        at, offsets = known["at"], known["peer_at"] - known["at"]
        if self._offset is not None:
            at, offsets = np.concatenate([[self._offset[0]], at]), np.concatenate([[self._offset[1]], offsets])
        if len(at):
            self._offset = (float(at[-1]), float(offsets[-1]))
        moved = held.copy()
        # Where the offset is unknown, that of the nearest tick holds. The clock estimate may step back by microseconds;
        # time must not.
        moved["at"] = np.maximum.accumulate(
            np.maximum(held["at"] + np.interp(held["at"], at, offsets) + origin, self._latest)
        )
        self._latest = float(moved["at"][-1])
        return moved

    def _counted(self, moved: Records) -> Records:
        """Drop what was long before the master, and let counters begin after it."""
        first = int(np.searchsorted(moved["at"], self._earliest))
        if first:
            self._before = moved[first - 1 : first].copy()
        counted = moved[first:]
        if self._before is not None:
            for name in COUNTERS:
                counted[name] -= self._before[name][0]
        return counted


def tick_0(master: Records, rate_hz: float) -> float:
    """Time of the master's tick 0 on its clock [s]."""
    return float(np.median(master["at"] - master["tick"] / rate_hz))
