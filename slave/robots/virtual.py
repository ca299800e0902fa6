"""What the two computed robots share: the options of their workspace and sensor. Knows no mechanics."""

from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from weberlink.geometry.vector import Vector, norm, scale
from weberlink.slave.robots.contract import RobotSpec


class VirtualOptions(BaseModel):
    """Workspace, home and force range of a robot that exists only in the computer."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    workspace_m: float = Field(default=0.06, gt=0.0, le=1.0, description="half an edge of the cube about the origin")
    home_m: Vector = Field(default=(0.0, 0.0, 0.03), description="where it is until the first command")
    force_n: float = Field(default=30.0, gt=0.0, description="range of its force sensor; more is cut to it")

    @model_validator(mode="after")
    def check_home(self) -> Self:
        if max(map(abs, self.home_m)) > self.workspace_m:
            raise ValueError(
                f"home_m: expected a point within the workspace of +-{self.workspace_m} m, got {self.home_m}"
            )
        return self


def virtual_spec(name: str, options: VirtualOptions, stiffness_n_m: float, tick_period: float) -> RobotSpec:
    edge = options.workspace_m
    return RobotSpec(
        name=name,
        axes="xyz",
        force_n=options.force_n,
        stiffness_n_m=stiffness_n_m,
        workspace_m=((-edge, -edge, -edge), (edge, edge, edge)),
        rate_hz=1.0 / tick_period,
        force_sensing=True,
    )


def saturated(force: Vector, limit: float) -> Vector:
    """What a sensor of range `limit` [N] shows: the direction is kept, the length is cut."""
    length = norm(force)
    return force if length <= limit else scale(force, limit / length)
