"""Packets per second and reduction of about the last second, from counters that only grow."""

from collections import deque
from typing import NamedTuple

from weberlink.protocol.states import State
from weberlink.system.scoring.session import Records

WINDOW_S = 1.0


class _Mark(NamedTuple):
    at: float
    updates: int
    engaged: int


class Pace:
    """What one side sent lately; fed with its records in order."""

    def __init__(self) -> None:
        self._marks: deque[_Mark] = deque()
        self._engaged = 0

    def add(self, records: Records) -> None:
        if not len(records):
            return
        first, last = records[0], records[-1]
        if not self._marks:
            self._marks.append(_Mark(float(first["at"]), int(first["updates_sent"]), 0))
        self._engaged += int((records["state"] == State.ENGAGED.value).sum())
        self._marks.append(_Mark(float(last["at"]), int(last["updates_sent"]), self._engaged))
        while len(self._marks) > 2 and self._marks[1].at <= self._marks[-1].at - WINDOW_S:
            self._marks.popleft()

    @property
    def packets_per_s(self) -> float | None:
        """None before two records."""
        if not self._marks or self._marks[-1].at <= self._marks[0].at:
            return None
        return (self._marks[-1].updates - self._marks[0].updates) / (self._marks[-1].at - self._marks[0].at)

    @property
    def reduction(self) -> float | None:
        """Against one packet a tick; None while not engaged."""
        if not self._marks or self._marks[-1].engaged <= self._marks[0].engaged:
            return None
        sent = self._marks[-1].updates - self._marks[0].updates
        return 1.0 - sent / (self._marks[-1].engaged - self._marks[0].engaged)
