"""The ideal haptic point: it has no mass and no lag, and feels the scene through a spring, optionally with a tool."""

from typing import TYPE_CHECKING, ClassVar

from pydantic import Field

from weberlink.geometry.vector import ZERO, Vector, within
from weberlink.options import Options
from weberlink.slave.robots.computed import ComputedRobot
from weberlink.slave.robots.virtual import VirtualOptions, virtual_spec
from weberlink.slave.scenes.scene import Scene

if TYPE_CHECKING:
    from weberlink.geometry.rotation import Quaternion
    from weberlink.slave.robots.tool import Tool


class ToolOptions(Options):
    """A rigid tool at the tip, as up to 32 points; two points make a stick."""

    points_m: tuple[Vector, ...] = Field(
        min_length=1, max_length=32, description="points of contact from the tip, in the initial orientation"
    )
    torque_n_m: float = Field(
        default=2.0, ge=1e-4, le=1e4, description="range of its torque sensor; larger torques are limited to it"
    )


class PointOptions(VirtualOptions):
    """Options of `point`."""

    tool: ToolOptions | None = Field(
        default=None, description="a rigid tool of several points that can be turned; without it, the tip alone"
    )


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
        self._tool: Tool | None = None
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
            felt, torque = self._tool.wrench(commanded, elapsed)
        if felt == ZERO:
            return commanded, ZERO, torque
        x, y, z = force = within(felt, self.spec.force_n)
        compliance = self._compliance
        tip = (commanded[0] + compliance * x, commanded[1] + compliance * y, commanded[2] + compliance * z)
        return tip, force, torque
