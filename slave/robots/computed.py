"""Robots that are computed: what all have between two readings, and the ideal point, which has no mass and no lag."""

from typing import TYPE_CHECKING, Any, ClassVar

from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import ZERO, Vector, within
from weberlink.slave.robots.contract import RobotFault, RobotReading, RobotSpec
from weberlink.slave.robots.virtual import PointOptions, virtual_spec
from weberlink.slave.scenes.scene import Scene

if TYPE_CHECKING:
    from weberlink.geometry.rotation import Quaternion

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
        self._reading = RobotReading(now, *self._advance(self._commanded, now - reading.at))
        return self._reading

    def close(self) -> None:
        self._reading = None

    def _reset(self) -> None:
        """Return to rest at home, without contact."""
        raise NotImplementedError

    def _advance(self, commanded: Vector, elapsed: float) -> tuple[Vector, Vector, Vector]:
        """Position [m], and force [N] and torque [N m] within the ranges of the spec, after `elapsed` [s]."""
        raise NotImplementedError


@mypyc_attr(allow_interpreted_subclasses=True)
class PointRobot(ComputedRobot):
    """No mass and no lag: the reference for all other robots.

    A spring of stiffness K_c, `spec.stiffness_n_m`, holds its tip at the command. Through it, a contact of stiffness K
    is felt as min(K, K_c): a stiffer one as the spring, a softer one as it is.
    """

    Options: ClassVar[type[PointOptions]] = PointOptions

    def __init__(self, options: PointOptions, scene: Scene | None, tick_period: float) -> None:
        tool = options.tool
        torque = 0.0 if tool is None else tool.torque_n_m
        super().__init__(virtual_spec("point", options, tick_period, torque), options.home_m)
        things = () if scene is None else scene.objects
        self._scene = Scene([thing.softened(self.spec.stiffness_n_m) for thing in things])
        self._compliance = 1.0 / self.spec.stiffness_n_m
        self._tool: Any = None
        self._description = "the ideal point"
        if tool is not None:
            from weberlink.slave.robots import tool as rigid  # noqa: PLC0415 - for six degrees of freedom alone

            self._tool = rigid.Tool(tool.points_m, self._scene)
            self._description = f"a rigid tool of {len(tool.points_m)} points, torque up to {tool.torque_n_m:g} N m"

    def point(self, orientation: "Quaternion", now: float) -> None:  # noqa: ARG002
        """Set the orientation of the tool; no effect without one."""
        if self._tool is not None:
            self._tool.point(orientation)

    def description(self) -> str:
        """What touches the scene, in one line."""
        return self._description

    def _reset(self) -> None:
        if self._tool is not None:
            self._tool.reset()
        else:
            self._scene.reset()

    def _advance(self, commanded: Vector, elapsed: float) -> tuple[Vector, Vector, Vector]:
        if self._tool is None:
            felt, torque = self._scene.force(commanded, elapsed), ZERO
        else:
            felt, turning = self._tool.wrench(commanded, elapsed)
            torque = within(turning, self.spec.torque_n_m)
        if felt == ZERO:
            return commanded, ZERO, torque
        x, y, z = force = within(felt, self.spec.force_n)
        compliance = self._compliance
        tip = (commanded[0] + compliance * x, commanded[1] + compliance * y, commanded[2] + compliance * z)
        return tip, force, torque
