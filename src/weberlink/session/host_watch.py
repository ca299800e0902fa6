"""Watches the host beside a session, and says in its report which missed ticks were the host's."""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from math import inf
from signal import SIGTERM
from subprocess import PIPE
from time import monotonic
from typing import Any

from weberlink.child_process import Child, python
from weberlink.config import SIDES
from weberlink.config.model import RealtimeSettings
from weberlink.figures.energy import Records
from weberlink.figures.host import HostShare
from weberlink.realtime.host import Steal, WakeUp, WatchOrder
from weberlink.realtime.process import HIGHEST_PRIORITY

INTERVAL_S = 0.002
"""Time between two wake-ups of a watcher, about; each costs some 25 us. A stall of this length and half a tick is
always seen, a shorter one in part of the cases. Many stalls last 1 to 5 ms, so 5 ms would be too long."""
LATE_TICKS = 0.5
"""Lateness of a watcher that counts as a stall, in ticks: a daemon is not late by so much without one."""
SETTLED_S = 0.5
"""Time from the end of a stall to its arrival here, at most [s]."""
LEAD_S = 0.05
"""From the start of the program to its first deadline, at least [s]."""
STOP_LIMIT_S = 1.0
TOO_SHORT = "the session was too short"


class HostWatch:
    """A process that watches the processors of a session's daemons; it starts once all of them tick.

    Args:
        sides: those that run here.
        realtime: settings of the daemons.
        period: of a tick [s].
    """

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

    def look(self, records: Mapping[str, Records]) -> None:
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
        watched = self._unknown is None
        return {
            "watched_s": monotonic() - self._began if watched else None,
            "stalls": self._share.stalls if watched else None,
            "longest_ms": 1e3 * self._share.longest if watched else None,
            "missed": self._share.missed if watched else None,
            "steal": None if steal is None or self._steal is None else steal.share_since(self._steal),
            "unknown": self._unknown,
        }

    def stop(self) -> None:
        """End the process; may be repeated."""
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
            self._process = Child(python("-m", "weberlink.realtime.host", order.to_json()), stdout=PIPE)
        except OSError as error:
            self._unknown = f"no process: {error.strerror}"

    def _read(self, process: Child) -> None:
        """Take what the process has written: a line on its scheduling class, then one for each stall."""
        ended = not process.running
        for line in process.lines():
            if line.startswith(b"{"):
                self._answered(json.loads(line))
            else:
                processor, *times = line.split()
                self._share.add_stall(int(processor), WakeUp(*map(float, times)))
        if ended and self._unknown in (None, TOO_SHORT):
            self._unknown = f"the watcher {process.how_it_ended}"

    def _answered(self, grant: dict[str, Any]) -> None:
        if grant["granted"]:
            self._unknown, self._began = None, monotonic()
        else:
            self._unknown = f"SCHED_FIFO {self._priority} {grant['detail'].partition(':')[0]}"


def farthest(deadlines: Iterable[float], period: float) -> float:
    """The phase in a period that is farthest from those of some deadlines, one or more [s]."""
    phases = sorted(deadline % period for deadline in deadlines)
    ends = [*phases[1:], phases[0] + period]
    width, begin = max((end - begin, begin) for begin, end in zip(phases, ends, strict=True))
    return (begin + 0.5 * width) % period
