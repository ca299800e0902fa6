"""Options of computed robots: workspace, sensor, stiffness, and a tool."""

from typing import Self

from pydantic import Field, model_validator

from weberlink.control.contract import LEAST_CONTACT
from weberlink.geometry.vector import Vector, check_home, cube
from weberlink.options import Options
from weberlink.slave.robots.contract import RobotSpec

SOFTEST, STIFFEST = 1e-3, 1e9  # range of the stiffness of a computed robot [N/m]
UNSTATED = 2500.0  # stiffness of a computed robot that is built without a device [N/m]


class VirtualOptions(Options):
    """Workspace, home, force range and stiffness of a robot that is computed."""

    workspace_m: float = Field(default=0.06, ge=1e-3, le=1.0, description="half an edge of the cube about the origin")
    home_m: Vector = Field(default=(0.0, 0.0, 0.03), description="position until the first command")
    force_n: float = Field(
        default=30.0, ge=LEAST_CONTACT, le=1e4, description="range of its force sensor; larger forces are limited to it"
    )
    stiffness_n_m: float | None = Field(
        default=None,
        ge=SOFTEST,
        le=STIFFEST,
        description="stiffness towards the command; by default what the device can display",
    )

    @model_validator(mode="after")
    def check_home(self) -> Self:
        check_home(self.home_m, self.workspace_m)
        return self


def virtual_spec(name: str, options: VirtualOptions, tick_period: float, torque_n_m: float = 0.0) -> RobotSpec:
    return RobotSpec(
        name=name,
        axes="xyz",
        force_n=options.force_n,
        stiffness_n_m=UNSTATED if options.stiffness_n_m is None else options.stiffness_n_m,
        workspace_m=cube(options.workspace_m),
        rate_hz=1.0 / tick_period,
        force_sensing=True,
        torque_n_m=torque_n_m,
    )


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
