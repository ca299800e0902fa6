"""A robot that is computed: its state between two readings, and the range of its sensor."""

from typing import ClassVar

from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import ZERO, Vector, within
from weberlink.slave.robots.contract import RobotFault, RobotReading, RobotSpec

LONGEST_GAP = 0.1  # Longest time that a model advances per reading; the rest of a longer silence is skipped [s]


@mypyc_attr(allow_interpreted_subclasses=True)
class ComputedRobot:
    """A robot that advances at each reading, with the command held constant since the last one.

    A subclass gives `_reset` and `_advance`.
    """

    COMPUTED: ClassVar[bool] = True

    def __init__(self, spec: RobotSpec, home: Vector) -> None:
        self.spec = spec
        self._home = self._commanded = home
        self._reading: RobotReading | None = None

    def open(self, now: float) -> None:
        self._reset()
        self._commanded = self._home
        self._reading = RobotReading(now, self._home, ZERO)

    def command(self, position: Vector, now: float) -> None:  # noqa: ARG002
        x, y, z = position
        if not x - x == y - y == z - z == 0.0:
            raise ValueError(f"{self.spec.name}: commanded a position that is not finite: {position}")
        self._commanded = position

    def latest(self, now: float) -> RobotReading:
        reading = self._reading
        if reading is None:
            raise RobotFault(f"{self.spec.name}: not open")
        if now <= reading.at:
            return reading
        position, force, torque = self._advance(self._commanded, now - reading.at)
        force = force if force == ZERO else within(force, self.spec.force_n)
        torque = torque if torque == ZERO else within(torque, self.spec.torque_n_m)
        self._reading = RobotReading(now, position, force, torque)
        return self._reading

    def close(self) -> None:
        self._reading = None

    def _reset(self) -> None:
        """Return to rest at home, without contact."""
        raise NotImplementedError

    def _advance(self, commanded: Vector, elapsed: float) -> tuple[Vector, Vector, Vector]:
        """Position [m], force [N] and torque [N m] after `elapsed` [s]."""
        raise NotImplementedError
