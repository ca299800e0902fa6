"""The options that computed robots share: workspace, sensor, stiffness."""

from typing import Self

from pydantic import Field, model_validator

from weberlink.control.contract import LEAST_CONTACT
from weberlink.geometry.vector import Vector, check_home, cube
from weberlink.options import Options
from weberlink.slave.robots.contract import RobotSpec

SOFTEST, STIFFEST = 1e-3, 1e9
"""Range of the stiffness of a computed robot [N/m]."""
UNSTATED = 2500.0  # Stiffness of a computed robot that is built without a device [N/m]


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
