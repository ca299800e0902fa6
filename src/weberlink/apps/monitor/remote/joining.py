"""One session of two hosts: the side that is shared by the other, and its counterpart on this one.

Owns which ring of this host belongs to it, and the two feeds that such a session is made of.
"""

from pathlib import Path
from typing import Any

import numpy as np

from weberlink.apps.monitor.feed import Feed, RingFeed
from weberlink.apps.monitor.finding import find
from weberlink.apps.monitor.remote.clock import MastersClock, tick_0
from weberlink.apps.monitor.remote.source import RemoteSource
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.ring import RingFormatError

CLOSE_S = 3.0
"""Newest records of two sides of one session are not further apart; telemetry takes its time, too."""
TAIL_S = 0.5
"""How much of the slave still belongs to a session whose master has ended."""


def counterpart(where: Path | None, source: RemoteSource) -> Path | None:
    """The ring of this host whose daemon is the other side of a remote one.

    What the slave knows of its master's clock is its age: that fits no master of this host but its own, or one that was
    started in the same few seconds with the same codec.
    """
    newest = source.newest
    if newest is None:
        return None
    other = SLAVE if source.begin.side == MASTER else MASTER
    for rings in reversed(find(where).values()):
        if other in rings and _belongs(rings[other].path, newest, source.begin):
            return rings[other].path
    return None


def _belongs(path: Path, newest: Any, begin: Any) -> bool:
    try:
        feed = RingFeed(path)
    except (RingFormatError, OSError):
        return False
    try:
        if not feed.alive or feed.rate_hz != begin.rate_hz or not _agree(feed.description, begin.description):
            return False
        local = feed.read()
    finally:
        feed.close()
    if not len(local):
        return False
    remote = np.array([newest], DTYPE)
    master, slave = (remote, local) if begin.side == MASTER else (local, remote)
    by_slave = float(slave["peer_at"][-1]) + tick_0(master, begin.rate_hz)
    return abs(by_slave - float(master["at"][-1])) < CLOSE_S  # not so where it is unknown, NaN


def _agree(one: dict[str, Any] | None, other: dict[str, Any] | None) -> bool:
    """Whether two descriptions can be those of one session; what is not known speaks against nothing."""
    if one is None or other is None:
        return True
    return all(one.get("system", {}).get(part) == other.get("system", {}).get(part) for part in ("codec", "axes"))


class JoinedMaster:
    """The master's feed, which the clock learns from.

    Args:
        feed: of the master.
        clock: for the slave.
    """

    def __init__(self, feed: Feed, clock: MastersClock) -> None:
        self.side, self.rate_hz, self.began = feed.side, feed.rate_hz, feed.began
        self.description = feed.description
        self.ring: Path | None = None
        self.ended_at: float | None = None
        """The time of its last record, once it has ended [s]."""
        self._feed = feed
        self._clock = clock
        self._newest = feed.began

    @property
    def written(self) -> int:
        return self._feed.written

    @property
    def lost(self) -> int:
        return self._feed.lost

    @property
    def drained(self) -> bool:
        return self._feed.drained

    def read(self) -> Records:
        records = self._feed.read()
        self._clock.learn(records)
        if len(records):
            self._newest = float(records["at"][-1])
        if self._feed.drained:
            self.ended_at = self._newest
        return records

    def close(self) -> None:
        self._feed.close()


class JoinedSlave:
    """The slave's feed, in the master's time; it ends a little after the master.

    Args:
        feed: of the slave.
        master: its counterpart.
        clock: that both share.
    """

    def __init__(self, feed: Feed, master: JoinedMaster, clock: MastersClock) -> None:
        self.side, self.rate_hz, self.began = feed.side, feed.rate_hz, master.began
        self.description = feed.description
        self.ring: Path | None = None
        self.written = 0
        self.drained = False
        self._feed = feed
        self._master = master
        self._clock = clock

    @property
    def lost(self) -> int:
        return self._feed.lost

    def read(self) -> Records:
        if self.drained:
            return np.empty(0, DTYPE)
        records = self._clock.move(self._feed.read())
        end = self._master.ended_at
        if end is not None:
            self.drained = len(records) > 0 and float(records["at"][-1]) > end + TAIL_S
            records = records[records["at"] <= end + TAIL_S]
        self.drained = self.drained or self._feed.drained or self._clock.lost
        self.written += len(records)
        return records

    def close(self) -> None:
        self._feed.close()


def join(local: Feed, remote: Feed) -> tuple[JoinedMaster, JoinedSlave]:
    """The two feeds of one session, on the master's clock."""
    master, slave = (local, remote) if local.side == MASTER else (remote, local)
    clock = MastersClock(master.rate_hz, master.began)
    joined = JoinedMaster(master, clock)
    return joined, JoinedSlave(slave, joined, clock)
