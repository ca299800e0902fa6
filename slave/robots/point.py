"""The ideal haptic point: it is where it is told to be, at once, and feels the scene there."""

from codec.vector import ZERO, Vector, is_finite
from slave.robots.contract import RobotFault, RobotReading
from slave.robots.virtual import VirtualOptions, saturated, virtual_spec
from slave.scenes.scene import Scene


class PointOptions(VirtualOptions):
    """Options of `point`."""


class PointRobot:
    """No mass, no lag: the reference against which every other robot is compared."""

    Options = PointOptions

    def __init__(self, options: PointOptions, scene: Scene | None, tick_period: float) -> None:
        self.spec = virtual_spec("point", options, float("inf"), tick_period)
        self._options = options
        self._scene = scene
        self._commanded = options.home_m
        self._reading: RobotReading | None = None

    def open(self, now: float) -> None:
        if self._scene is not None:
            self._scene.reset()
        self._commanded = self._options.home_m
        self._reading = RobotReading(now, self._commanded, ZERO)

    def command(self, position: Vector, now: float) -> None:  # noqa: ARG002
        if not is_finite(position):
            raise ValueError(f"point: commanded a position that is not finite: {position}")
        self._commanded = position

    def latest(self, now: float) -> RobotReading:
        reading = self._reading
        if reading is None:
            raise RobotFault("point: not open")
        if now <= reading.at:
            return reading
        force = ZERO if self._scene is None else self._scene.force(self._commanded, now - reading.at)
        self._reading = RobotReading(now, self._commanded, saturated(force, self.spec.force_n))
        return self._reading

    def close(self) -> None:
        self._reading = None
