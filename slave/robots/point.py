"""The ideal haptic point: it reaches every command at once and feels the scene there, optionally with a rigid tool."""

from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.robots.contract import Quaternion
from weberlink.slave.robots.virtual import ComputedRobot, VirtualOptions, virtual_spec
from weberlink.slave.scenes.scene import Scene

if TYPE_CHECKING:
    from weberlink.slave.robots.tool import Tool


class ToolOptions(BaseModel):
    """A rigid tool at the tip, as up to 32 points; two points make a stick."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    points_m: tuple[Vector, ...] = Field(
        min_length=1, max_length=32, description="points of contact from the tip, in the initial orientation"
    )
    torque_n_m: float = Field(
        default=2.0, gt=0.0, description="range of its torque sensor; larger torques are limited to it"
    )


class PointOptions(VirtualOptions):
    """Options of `point`."""

    tool: ToolOptions | None = Field(
        default=None, description="a rigid tool of several points that can be turned; without it, the tip alone"
    )


class PointRobot(ComputedRobot):
    """No mass and no lag: the reference for all other robots."""

    Options = PointOptions

    def __init__(self, options: PointOptions, scene: Scene | None, tick_period: float) -> None:
        tool = options.tool
        torque = 0.0 if tool is None else tool.torque_n_m
        super().__init__(virtual_spec("point", options, float("inf"), tick_period, torque), options.home_m)
        self._scene = Scene([]) if scene is None else scene
        self._tool = None if tool is None else _tool(tool, self._scene)
        self._description = (
            "the ideal point"
            if tool is None
            else f"a rigid tool of {len(tool.points_m)} points, torque up to {tool.torque_n_m:g} N m"
        )

    def point(self, orientation: Quaternion, now: float) -> None:  # noqa: ARG002
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
        if self._tool is not None:
            return (commanded, *self._tool.wrench(commanded, elapsed))
        return commanded, self._scene.force(commanded, elapsed), ZERO


def _tool(options: ToolOptions, scene: Scene) -> "Tool":
    from weberlink.slave.robots.tool import Tool  # noqa: PLC0415 - for six degrees of freedom alone

    return Tool(options.points_m, scene)
