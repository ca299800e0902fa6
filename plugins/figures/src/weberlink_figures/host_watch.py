"""Watches the host beside a session, and says in its report which missed ticks were the host's."""

import json
import os
from collections import deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from signal import SIGTERM
from subprocess import PIPE
from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from weberlink.child_process import Child, python
from weberlink.config import SIDES
from weberlink.config.model import RealtimeSettings
from weberlink.realtime.process import HIGHEST_PRIORITY
from weberlink.telemetry.reader import Records
from weberlink_figures.host import Steal, WakeUp, WatchOrder

INTERVAL_S = 0.002
"""Time between two wake-ups of a watcher, about; each costs some 25 us. A stall of this length and half a tick is
always seen, a shorter one in part of the cases. Many stalls last 1 to 5 ms, so 5 ms would be too long."""
LATE_TICKS = 0.5  # lateness of a watcher that counts as a stall, in ticks: a daemon is not late by so much without one
SETTLED_S = 0.5  # time from the end of a stall to its arrival here, at most [s]
KEPT_S = 10.0  # how long a stall waits for the record of the tick after it [s]: as long as the telemetry holds
LEAD_S = 0.05  # from the start of the program to its first deadline, at least [s]
STOP_LIMIT_S = 1.0
TOO_SHORT = "the session was too short"


class Gap(NamedTuple):
    """Deadlines without a tick, in a row: the first of them [s], how many, and when the next tick began [s]."""

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
        self._until = -inf
        self.stalls = 0
        self.longest = 0.0

    def add_records(self, side: str, records: Records) -> None:
        """Take the next records of a side, in order."""
        if len(records):
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
    """The gaps between the records of a side; none where records were lost, since their time is not known there."""
    at = records["at"].astype(np.float64)
    counts = np.diff(records["ticks_missed"].astype(np.float64))
    found = np.flatnonzero((counts > 0) & (np.abs(np.diff(at) / period - (counts + 1)) < 0.5))
    resumed = at + 1e-6 * records["lateness_us"].astype(np.float64)
    return [Gap(float(at[index]) + period, int(counts[index]), float(resumed[index + 1])) for index in found]


def missed_by_host(gap: Gap, stalls: Collection[WakeUp], period: float) -> int:
    deadlines = gap.first + period * np.arange(gap.ticks)
    of_host = np.zeros(gap.ticks, dtype=bool)
    for stall in stalls:
        if stall.due < gap.resumed and stall.woken > gap.first:
            of_host |= (stall.ran < deadlines) & (deadlines <= stall.woken)
    return int(of_host.sum())


class HostWatch:
    """A process that watches the processors of a session's daemons; it starts once all of them tick."""

    def __init__(self, sides: Sequence[str], realtime: RealtimeSettings, period: float) -> None:
        allowed = os.sched_getaffinity(0)
        pinned = {} if realtime.cpus is None else {side: {realtime.cpus[SIDES.index(side)]} & allowed for side in sides}
        processors = {side: pinned.get(side) or allowed for side in sides}
        self._processors = frozenset().union(*processors.values())
        self._priority = min(realtime.priority + 1, HIGHEST_PRIORITY)
        self._period = round(1e9 * period) / 1e9  # as the ticker rounds it, so that the phases stay
        self._share = HostShare(processors, self._period)
        self._ticked: dict[str, float] = dict.fromkeys(sides, 0.0)
        self._started = False
        self._process: Child | None = None
        self._unknown: str | None = TOO_SHORT
        self._steal: Steal | None = None
        self._began = 0.0

    def add(self, records: Mapping[str, Records]) -> None:
        """Take the newest records of each side, and what the watchers have seen."""
        for side, new in records.items():
            if len(new):
                self._ticked[side] = float(new["at"][-1])
                self._share.add_records(side, new)
        if self._process is not None:
            self._read(self._process)
            self._share.settle(monotonic() - SETTLED_S)
        elif not self._started and all(self._ticked.values()):
            self._start()

    def end(self) -> dict[str, Any]:
        """Stop, and settle what is open.

        Returns:
            `watched_s`, `stalls`, `longest_ms`, `missed` (ticks of each side that are the host's), `steal` (share of
            the processors' time; None if it is not counted), and in `unknown` why the first four are None.
        """
        self.stop()
        self._share.settle(inf)
        steal = None if self._steal is None else Steal.read(self._processors)
        figures: dict[str, Any] = {
            "watched_s": monotonic() - self._began,
            "stalls": self._share.stalls,
            "longest_ms": 1e3 * self._share.longest,
            "missed": self._share.missed,
        }
        return (figures if self._unknown is None else dict.fromkeys(figures)) | {
            "steal": None if steal is None or self._steal is None else steal.share_since(self._steal),
            "unknown": self._unknown,
        }

    def stop(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            self._read(process)
            process.send_signal(SIGTERM)
            process.end(STOP_LIMIT_S)

    def _start(self) -> None:
        """Start with deadlines as far as possible from those of the daemons, so that no tick waits for a watcher."""
        interval = max(1, round(INTERVAL_S / self._period)) * self._period
        first = monotonic() + LEAD_S
        first += (farthest(self._ticked.values(), self._period) - first) % self._period
        order = WatchOrder(
            processors=tuple(sorted(self._processors)),
            priority=self._priority,
            first=first,
            interval=interval,
            least=LATE_TICKS * self._period,
        )
        self._started = True
        self._steal = Steal.read(self._processors)
        try:
            self._process = Child(python("-m", "weberlink_figures.host", order.to_json()), stdout=PIPE)
        except OSError as error:
            self._unknown = f"no process: {error.strerror}"

    def _read(self, process: Child) -> None:
        """Take what the process has written: a line on its scheduling class, then one for each stall."""
        ended = not process.running
        for line in process.lines():
            if line.startswith(b"{"):
                grant = json.loads(line)
                refused = f"SCHED_FIFO {self._priority} {grant['detail'].partition(':')[0]}"
                self._unknown, self._began = None if grant["granted"] else refused, monotonic()
            else:
                processor, *times = line.split()
                self._share.add_stall(int(processor), WakeUp(*map(float, times)))
        if ended and self._unknown in (None, TOO_SHORT):
            self._unknown = f"the watcher {process.how_it_ended}"


def farthest(deadlines: Iterable[float], period: float) -> float:
    """The phase in a period that is farthest from those of some deadlines, one or more [s]."""
    phases = sorted(deadline % period for deadline in deadlines)
    ends = [*phases[1:], phases[0] + period]
    width, begin = max((end - begin, begin) for begin, end in zip(phases, ends, strict=True))
    return (begin + 0.5 * width) % period
