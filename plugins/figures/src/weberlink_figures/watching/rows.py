"""Lists records for JSON: the felt error, and the rates of the last second."""

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.telemetry.reader import Records
from weberlink_figures.channel import engaged
from weberlink_figures.session import Layout


def listed(values: NDArray[Any], digits: int) -> list[float | None]:
    """Rounded numbers for JSON; None for those that are not finite."""
    wide = np.asarray(values, dtype=np.float64)
    numbers: list[float | None] = np.round(wide, digits).tolist()
    finite = np.isfinite(wide)
    if not finite.all():
        for place in np.flatnonzero(~finite).tolist():
            numbers[place] = None
    return numbers


def felt_message(master: Records, slave: Records, origin: float, layout: Layout) -> dict[str, Any]:
    """Message with the felt error of pairs of records [N]; of an arm, of the axis with most deadbands [N m]."""
    if not layout.joints:
        error, bound, deviation, _ = layout.from_slave[0].compare(slave, master)
    else:
        axes = len(layout.joints)
        errors, bounds = np.abs(master["output"] - slave["raw"])[:, :axes], layout.deadbands(slave)
        worst = (errors / bounds).argmax(axis=1)[:, None]
        error, bound = (np.take_along_axis(each, worst, axis=1)[:, 0] for each in (errors, bounds))
        deviation = error
    with np.errstate(divide="ignore", invalid="ignore"):
        deadbands = np.where(bound > 0.0, deviation / bound, np.nan)  # unknown where the bound is 0
    return {
        "type": "felt",
        "t": listed(slave["at"] - origin, 6),
        "deadbands": listed(deadbands, 4),
        "error_n": listed(error, 5),
        "bound_n": listed(bound, 5),
    }


WINDOW_S = 1.0


class _PaceMark(NamedTuple):
    at: float
    updates: int
    engaged: int


class Pace:
    """Packet rate and reduction of the last second of one channel of a side.

    Args:
        counter: of its updates, in the records.
    """

    def __init__(self, counter: str = "updates_sent") -> None:
        self._counter = counter
        self._marks: deque[_PaceMark] = deque()
        self._engaged = 0

    def add(self, records: Records) -> None:
        if not len(records):
            return
        first, last = records[0], records[-1]
        if not self._marks:
            self._marks.append(_PaceMark(float(first["at"]), int(first[self._counter]), 0))
        self._engaged += int(engaged(records).sum())
        self._marks.append(_PaceMark(float(last["at"]), int(last[self._counter]), self._engaged))
        while len(self._marks) > 2 and self._marks[1].at <= self._marks[-1].at - WINDOW_S:
            self._marks.popleft()

    @property
    def packets_per_s(self) -> float | None:
        """None before the second record."""
        if not self._marks or self._marks[-1].at <= self._marks[0].at:
            return None
        return (self._marks[-1].updates - self._marks[0].updates) / (self._marks[-1].at - self._marks[0].at)

    @property
    def reduction(self) -> float | None:
        """Share of ticks without a packet; None while not engaged."""
        if not self._marks or self._marks[-1].engaged <= self._marks[0].engaged:
            return None
        sent = self._marks[-1].updates - self._marks[0].updates
        return 1.0 - sent / (self._marks[-1].engaged - self._marks[0].engaged)
