"""The clock of a master, for the records of a slave on another host. Pure.

A slave's records say at every tick what the master's clock showed, counted from the master's tick 0, which the master's
own records date. `system.scoring.recorded` does the same with recordings; here records come in pieces, and time must
not wait for the end.
"""

import numpy as np

from weberlink.apps.monitor.pieces import joined
from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import FIELDS

COUNTERS = tuple(field.name for field in FIELDS if field.kind == "<u8" and field.name != "tick")
"""What a record counts since its daemon began."""
ANOTHER_CLOCK_S = 0.1
"""A jump of the peer's clock by more than this is another peer, or the same one started anew."""
MARGIN_S = 1.0
"""How much of the slave's time before the master's belongs to their session."""
HELD_S = 10.0
"""How long records wait until the clocks are related."""


class MastersClock:
    """Moves the slave's records in time.

    Args:
        rate_hz: of both sides.
        began: when the master's writer began, on the master's clock [s]; what the slave did well before is not of this
            session.
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
        """Whether the slave now follows another clock, and its records are none of this session any more."""

    def learn(self, master: Records) -> None:
        """Take records of the master."""
        if self._tick_0 is None and len(master):
            self._tick_0 = tick_0(master, self._rate_hz)

    def move(self, slave: Records) -> Records:
        """The next records of the slave that can be dated, in the master's time; others wait."""
        if self.lost:
            return slave[:0]
        held = joined((self._held, slave))[-int(HELD_S * self._rate_hz) :]
        known = np.flatnonzero(np.isfinite(held["peer_at"]))
        if self._tick_0 is None or (self._offset is None and not len(known)):
            self._held = held
            return held[:0]
        self._held = held[:0]
        held, known = self._of_this_master(held, known)
        if not len(held):
            return held
        return self._counted(self._dated(held, known, self._tick_0))

    def _of_this_master(
        self, held: Records, known: np.ndarray[tuple[int], np.dtype[np.intp]]
    ) -> tuple[Records, np.ndarray[tuple[int], np.dtype[np.intp]]]:
        """Without what belongs to another master: before this one at first, after it later on."""
        offsets = held["peer_at"][known] - held["at"][known]
        if self._offset is None:
            cuts = np.flatnonzero(np.abs(np.diff(offsets)) > ANOTHER_CLOCK_S)
            first = int(known[cuts[-1] + 1]) if len(cuts) else 0
            if first:
                self._before = held[first - 1 : first].copy()
            return held[first:], known[known >= first] - first
        strange = np.flatnonzero(np.abs(np.diff(offsets, prepend=self._offset[1])) > ANOTHER_CLOCK_S)
        if len(strange):
            self.lost = True
            end = int(known[strange[0]])
            return held[:end], known[known < end]
        return held, known

    def _dated(self, held: Records, known: np.ndarray[tuple[int], np.dtype[np.intp]], origin: float) -> Records:
        at = held["at"][known]
        offsets = held["peer_at"][known] - at
        if self._offset is not None:
            at, offsets = np.concatenate([[self._offset[0]], at]), np.concatenate([[self._offset[1]], offsets])
        if len(at):
            self._offset = (float(at[-1]), float(offsets[-1]))
        moved = held.copy()
        # Where the slave did not know it, its own clock runs on from the nearest tick where it did. The estimate of a
        # clock may step back by microseconds; time may not.
        moved["at"] = np.maximum.accumulate(
            np.maximum(held["at"] + np.interp(held["at"], at, offsets) + origin, self._latest)
        )
        self._latest = float(moved["at"][-1])
        return moved

    def _counted(self, moved: Records) -> Records:
        """Without what was long before the master, and with counters that begin after it."""
        first = int(np.searchsorted(moved["at"], self._earliest))
        if first:
            self._before = moved[first - 1 : first].copy()
        counted = moved[first:]
        if self._before is not None:
            for name in COUNTERS:
                counted[name] -= self._before[name][0]
        return counted


def tick_0(master: Records, rate_hz: float) -> float:
    """When the master's tick 0 was, on its clock [s]."""
    return float(np.median(master["at"] - master["tick"] / rate_hz))
