"""Options of the robot `mujoco`; needs no MuJoCo, so that a schema can be made without it."""

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator

from weberlink.geometry.vector import Vector
from weberlink.options import Options
from weberlink.slave.guard import Workspace

CONTACTS = "contacts"  # value of `force` for the contacts of the end effector instead of a sensor of the file

LARGEST_WORKSPACE = 10.0  # half an edge [m]

AxisRange = tuple[float, float]


class RotationOptions(Options):
    """Orientation control and torque sensing about the site of the end effector."""

    stiffness_n_m_rad: float = Field(
        default=5.0, ge=1e-6, le=1e9, description="of the orientation control, equal about all axes"
    )
    torque: str = Field(
        default=CONTACTS,
        description="torque that is felt: `contacts` as for `force`, or the name of a torque sensor of the MJCF file, "
        "on a site that has a force sensor too",
    )
    torque_n_m: float = Field(
        default=2.0, ge=1e-4, le=1e4, description="range of the torque sensing; larger torques are limited to it"
    )


class MujocoOptions(Options):
    """Options of `mujoco`. Positions and forces are in the world frame of the MJCF file."""

    model: Path = Field(description="the MJCF file; a relative path starts at the folder of this file")
    end_effector: str = Field(default="tip", description="name of the site that follows the commands")
    force: str = Field(
        default=CONTACTS,
        description="force that is felt: `contacts` of the body of the end effector and of what hangs on it, or the "
        "name of a force sensor of the MJCF file",
    )
    force_n: float = Field(
        default=30.0, ge=0.05, le=1e4, description="range of the force sensing; larger forces are limited to it"
    )
    stiffness_n_m: float = Field(
        default=1000.0, ge=1e-3, le=1e9, description="of the position control, equal on all axes"
    )
    rotation: RotationOptions | None = Field(
        default=None, description="orientation control and torque sensing; without it, position and force only"
    )
    damping_ratio: float = Field(
        default=1.0, ge=0.0, le=2.0, description="of the position control at home; 1 is critical on every axis"
    )
    posture_hz: float = Field(
        default=2.0,
        ge=0.0,
        le=20.0,
        description="natural frequency at which redundant joints return to their pose at home",
    )
    keyframe: str | None = Field(default=None, description="initial state, of the MJCF file; joints at 0 if not given")
    home_m: Vector | None = Field(
        default=None, description="position until the first command; that of the initial state if not given"
    )
    workspace_m: Annotated[float, Field(gt=0.0, le=LARGEST_WORKSPACE)] | tuple[AxisRange, AxisRange, AxisRange] = Field(
        default=0.06,
        description="range of commands: half an edge of a cube about the origin, or lowest and highest position on "
        "x, y, z",
    )

    @field_validator("workspace_m", mode="before")
    @classmethod
    def _one_or_six(cls, workspace: object) -> object:
        match workspace:
            case float() | int() if 0.0 < workspace <= LARGEST_WORKSPACE:
                return float(workspace)
            case [[_, _], [_, _], [_, _]]:
                return workspace
        raise ValueError(f"expected half an edge, up to {LARGEST_WORKSPACE:g} m, or three intervals, got {workspace!r}")

    @field_validator("workspace_m")
    @classmethod
    def _rising(cls, workspace: float | tuple[AxisRange, ...]) -> float | tuple[AxisRange, ...]:
        if not isinstance(workspace, float):
            for axis, (low, high) in zip("xyz", workspace, strict=True):
                if not low < high:
                    raise ValueError(f"{axis}: expected the lower limit first, got [{low}, {high}]")
        return workspace

    @model_validator(mode="after")
    def _home_within(self) -> Self:
        if self.home_m is not None:
            self.check_home(self.home_m)
        return self

    @property
    def corners(self) -> Workspace:
        """Lowest and highest corner of the workspace [m]."""
        if isinstance(self.workspace_m, float):
            edge = self.workspace_m
            return (-edge, -edge, -edge), (edge, edge, edge)
        (x0, x1), (y0, y1), (z0, z1) = self.workspace_m
        return (x0, y0, z0), (x1, y1, z1)

    def check_home(self, home: Vector) -> None:
        """Raises ValueError if this home position is outside of the workspace."""
        low, high = self.corners
        if any(not a <= x <= b for a, x, b in zip(low, home, high, strict=True)):
            shown = "[" + ", ".join(f"{x:.4g}" for x in home) + "]"
            raise ValueError(
                f"home_m: {shown} is outside of workspace_m, {list(low)} to {list(high)}; change one of them"
            )
