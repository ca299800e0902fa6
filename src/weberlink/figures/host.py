"""The host's share of the missed ticks of a session: those of which a watcher of the same processor was late too."""

from collections import deque
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from weberlink.figures.energy import Records
from weberlink.realtime.host import WakeUp

KEPT_S = 10.0
"""How long a stall waits for the record of the tick after it [s]: as long as the telemetry holds."""


class Gap(NamedTuple):
    """Deadlines without a tick, in a row.

    Args:
        first: the first of them [s].
        ticks: how many.
        resumed: when the next tick began [s].
    """

    first: float
    ticks: int
    resumed: float


@dataclass
class _Side:
    processors: frozenset[int]
    last: Records | None = None
    waiting: list[Gap] = field(default_factory=list)
    of_host: int = 0


class HostShare:
    """Joins missed ticks and stalls of the host.

    A stall is a wake-up of a watcher that came late. It began after the watcher had last run, and lasted from the
    watcher's deadline at the latest until it ran again. A missed tick is the host's if its daemon was absent during the
    certain part of such a stall, and the tick's deadline fell into the stall at its longest. So at most one interval of
    the watcher is attributed wrongly, where a daemon was late by itself when a stall began. A stall that falls between
    two deadlines of the watcher is not seen: its ticks are not the host's.

    Args:
        processors: those on which the daemon of each side may run.
        period: of a tick [s].

    Attributes:
        stalls: how often the host stalled; processors that stall at the same time count once.
        longest: certain part of the longest stall [s].
    """

    def __init__(self, processors: Mapping[str, Collection[int]], period: float) -> None:
        self._period = period
        self._sides = {side: _Side(frozenset(numbers)) for side, numbers in processors.items()}
        self._stalls: deque[tuple[int, WakeUp]] = deque()
        self._until = -np.inf
        self.stalls = 0
        self.longest = 0.0

    def add_records(self, side: str, records: Records) -> None:
        """Take the next records of a side, in order."""
        if not len(records):
            return
        facts = self._sides[side]
        joined = records if facts.last is None else np.concatenate([facts.last, records])
        facts.last = records[-1:].copy()
        facts.waiting += gaps(joined, self._period)

    def add_stall(self, processor: int, stall: WakeUp) -> None:
        """Take the next late wake-up of a watcher."""
        self._stalls.append((processor, stall))
        self.stalls += stall.due >= self._until
        self._until = max(self._until, stall.woken)
        self.longest = max(self.longest, stall.late)

    def settle(self, before: float) -> None:
        """Decide on the gaps that had ended by a time [s] by which the stalls are known, too."""
        for side in self._sides.values():
            stalls = [stall for processor, stall in self._stalls if processor in side.processors]
            ended = [gap for gap in side.waiting if gap.resumed < before]
            side.waiting = [gap for gap in side.waiting if gap.resumed >= before]
            side.of_host += sum(missed_by_host(gap, stalls, self._period) for gap in ended)
        while self._stalls and self._stalls[0][1].woken < before - KEPT_S:
            self._stalls.popleft()

    @property
    def missed(self) -> dict[str, int]:
        """Missed ticks of each side that are the host's, among those settled."""
        return {name: side.of_host for name, side in self._sides.items()}


def gaps(records: Records, period: float) -> list[Gap]:
    """The gaps between the records of a side; none where records were lost, since their time is not known there.

    Args:
        records: in order, shape (n,).
        period: of a tick [s].
    """
    at = records["at"].astype(np.float64)
    counts = np.diff(records["ticks_missed"].astype(np.float64))
    found = np.flatnonzero((counts > 0) & (np.abs(np.diff(at) / period - (counts + 1)) < 0.5))
    resumed = at + 1e-6 * records["lateness_us"].astype(np.float64)
    return [Gap(float(at[index]) + period, int(counts[index]), float(resumed[index + 1])) for index in found]


def missed_by_host(gap: Gap, stalls: Collection[WakeUp], period: float) -> int:
    """How many ticks of a gap are the host's."""
    deadlines = gap.first + period * np.arange(gap.ticks)
    of_host = np.zeros(gap.ticks, dtype=bool)
    for stall in stalls:
        if stall.due < gap.resumed and stall.woken > gap.first:
            of_host |= (stall.ran < deadlines) & (deadlines <= stall.woken)
    return int(of_host.sum())
