"""The check that encoder counts are plausible.

Encoders count from where they were switched on. After a loss of power, a reset of the counters or a broken encoder
cable the counts belong to another place, and the force would point the wrong way. Counts that no hand motion explains
are therefore rejected.
"""

from typing import NamedTuple, NoReturn

from weberlink.geometry.vector import Vector, confined, cube, distance
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.polhem.mechanism import Mechanism
from weberlink.master.devices.polhem.protocol import Counts

SPEED_M_S = 3.0  # largest speed of a hand
SLACK_M = 0.003  # tolerance for inexact times
SILENCE_S = 0.25  # after this time without an answer the device may have lost its power
AWAY_M = 0.05  # largest accepted motion of the handle while the device was unplugged
SHIFT_M = 0.01  # restarted counters are harmless within this distance of the home pose
NEAR_COUNTS = 100  # restarted counters are within this range at the next answer
STILL_M = 0.5  # an encoder counts as broken when the handle moves this far without a change of its count


class _Known(NamedTuple):
    """The last accepted counts and position, and the time when they were requested [s]."""

    counts: Counts
    position: Vector
    asked: float


class PositionValidator:
    """Turns counts into readings, and rejects implausible ones; `zero` are the counts of the home pose."""

    def __init__(self, mechanism: Mechanism, zero: Counts) -> None:
        self._mechanism = mechanism
        self._reach = mechanism.reach_m
        self._zero = zero
        self.counts: Counts = (0,) * len(zero)  # the last accepted ones, relative to the home pose
        self._last: _Known | None = None
        self._doubted: Vector | None = None
        self._lost: str | None = None
        self._still_for = [0.0, 0.0, 0.0]

    def _relative(self, counts: Counts) -> Counts:
        return tuple(count - zero for count, zero in zip(counts, self._zero, strict=True))

    def begin(self, counts: Counts, asked: float, answered: float, *, oriented: bool = True) -> DeviceReading:
        """Check the first counts of a connection, measured between two times [s].

        Without `oriented` the counts of the gimbal are not to be believed, and the reading has no orientation. Raises
        HardwareFault if the position is outside the workspace, or too far from the last one.
        """
        position, before, reach = self._mechanism.position(self._relative(counts)), self._last, self._reach
        if self._lost is not None:  # motion does not restore it
            raise HardwareFault(self._lost)
        if before is not None:
            gone = distance(position, before.position)
            if gone > AWAY_M or (gone > SHIFT_M and _nearer_zero(counts[:3], before.counts[:3])):
                self._lose(f"it came back {gone * 1e3:.0f} mm from where it was")
        elif max(map(abs, position)) > reach:
            place = ", ".join(f"{component * 1e3:.0f}" for component in position)
            raise HardwareFault(
                f"is not homed: it reports ({place}) mm, more than {reach * 1e3:.0f} mm from the middle; "
                "see `homing` in its options"
            )
        self._still_for = [0.0, 0.0, 0.0]
        return self._accept(_Known(counts, position, asked), answered, 0, oriented)

    def next(
        self, counts: Counts, asked: float, answered: float, buttons: int = 0, *, oriented: bool = True
    ) -> DeviceReading:
        """Check the next counts, measured between their request and the reading of the answer [s]; `oriented` as for
        `begin`.

        Raises BadReply if no hand moves that far in that time, HardwareFault if a second jump confirms the first: it
        has lost its home.
        """
        before = self._last
        assert before is not None
        position = self._mechanism.position(self._relative(counts))
        gone, elapsed = distance(position, before.position), answered - before.asked
        what = f"its position jumped by {gone * 1e3:.0f} mm in {elapsed * 1e3:.1f} ms"
        if self._doubted is not None and distance(position, self._doubted) < gone:
            self._lose(what)
        # Counters, those of the gimbal included, that look as if they had restarted at zero.
        began_again = (
            gone > SHIFT_M
            and _nearer_zero(counts[:3], before.counts[:3])
            and (len(counts) == 3 or _nearer_zero(counts[3:], before.counts[3:]))
        )
        if began_again and elapsed > SILENCE_S:
            self._lose(what)
        if gone > SLACK_M + SPEED_M_S * elapsed or (began_again and max(map(abs, counts[:3])) <= NEAR_COUNTS):
            self._doubted = position
            raise BadReply(what)
        for axis in range(3):
            self._still_for[axis] = self._still_for[axis] + gone if counts[axis] == before.counts[axis] else 0.0
            if self._still_for[axis] > STILL_M:
                self._lose(f"the encoder of motor {'ABC'[axis]} stands still while the others move, check its cable")
        return self._accept(_Known(counts, position, asked), answered, buttons, oriented)

    def _accept(self, known: _Known, answered: float, buttons: int, oriented: bool) -> DeviceReading:
        self._last, self._doubted, self.counts = known, None, self._relative(known.counts)
        position = confined(known.position, cube(self._reach))
        orientation = self._mechanism.orientation(self.counts) if oriented else None
        return DeviceReading(answered, position, orientation=orientation, buttons=buttons)

    def _lose(self, why: str) -> NoReturn:
        self._lost = f"has lost its home: {why}; close, put it in its home pose and home it again"
        raise HardwareFault(self._lost)


def _nearer_zero(counts: Counts, before: Counts) -> bool:
    """Whether counters are closer to zero than to where they were, or no farther from it."""
    return max(map(abs, counts)) <= max(abs(a - b) for a, b in zip(counts, before, strict=True))
