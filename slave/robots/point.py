"""The ideal haptic point: it is where it is told to be, at once, and feels the scene there; so does a tool on it."""

from dataclasses import replace
from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, Field

from weberlink.geometry.vector import ZERO, Vector, is_finite
from weberlink.slave.robots.contract import Quaternion, RobotFault, RobotReading
from weberlink.slave.robots.virtual import VirtualOptions, saturated, virtual_spec
from weberlink.slave.scenes.scene import Scene

if TYPE_CHECKING:
    from weberlink.slave.robots.tool import Tool


class ToolOptions(BaseModel):
    """What is held by the tip, at most 32 points of it; a stick is two of them."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    points_m: tuple[Vector, ...] = Field(
        min_length=1, max_length=32, description="where it touches, from the tip, as it is held level"
    )
    torque_n_m: float = Field(default=2.0, gt=0.0, description="range of its torque sensor; more is cut to it")


class PointOptions(VirtualOptions):
    """Options of `point`."""

    tool: ToolOptions | None = Field(
        default=None, description="a rigid tool of several points, which can be turned; without it, the tip alone"
    )


class PointRobot:
    """No mass, no lag: the reference against which every other robot is compared."""

    Options = PointOptions

    def __init__(self, options: PointOptions, scene: Scene | None, tick_period: float) -> None:
        self.spec = virtual_spec("point", options, float("inf"), tick_period)
        self._options = options
        self._scene = scene
        self._tool = None if options.tool is None else _tool(options.tool, scene)
        if options.tool is not None:
            self.spec = replace(self.spec, torque_n_m=options.tool.torque_n_m)
        self._commanded = options.home_m
        self._reading: RobotReading | None = None

    def open(self, now: float) -> None:
        if self._tool is not None:
            self._tool.reset()
        elif self._scene is not None:
            self._scene.reset()
        self._commanded = self._options.home_m
        self._reading = RobotReading(now, self._commanded, ZERO)

    def command(self, position: Vector, now: float) -> None:  # noqa: ARG002
        if not is_finite(position):
            raise ValueError(f"point: commanded a position that is not finite: {position}")
        self._commanded = position

    def point(self, orientation: Quaternion, now: float) -> None:  # noqa: ARG002
        """Without a tool there is nothing to be turned, as the spec says."""
        if self._tool is not None:
            self._tool.point(orientation)

    def latest(self, now: float) -> RobotReading:
        reading = self._reading
        if reading is None:
            raise RobotFault("point: not open")
        if now <= reading.at:
            return reading
        if self._tool is not None:
            return self._touched(self._tool, now, now - reading.at)
        force = ZERO if self._scene is None else self._scene.force(self._commanded, now - reading.at)
        self._reading = RobotReading(now, self._commanded, saturated(force, self.spec.force_n))
        return self._reading

    def close(self) -> None:
        self._reading = None

    def description(self) -> str:
        """One line for a person: what touches."""
        tool = self._options.tool
        if tool is None:
            return "the ideal point"
        return f"a rigid tool of {len(tool.points_m)} points, torque up to {tool.torque_n_m:g} N m"

    def _touched(self, tool: "Tool", now: float, elapsed: float) -> RobotReading:
        force, torque = tool.wrench(self._commanded, elapsed)
        self._reading = RobotReading(
            now, self._commanded, saturated(force, self.spec.force_n), saturated(torque, self.spec.torque_n_m)
        )
        return self._reading


def _tool(options: ToolOptions, scene: Scene | None) -> "Tool":
    from weberlink.slave.robots.tool import Tool  # noqa: PLC0415

    return Tool(options.points_m, Scene([]) if scene is None else scene)
