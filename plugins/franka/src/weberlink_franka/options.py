"""Options of the robot `franka`, checked against what its joints and its control loop allow."""

from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from weberlink.geometry.vector import Vector
from weberlink.options import Options

STIFFEST: Final = 3000.0  # of the tip [N/m]
SHORTEST_STALE_MS: Final = 5.0


class FrankaOptions(Options):
    """Options of `franka`. Frame: the robot's base (O), x forward, y left, z up; the tip is its end effector (EE)."""

    host: Annotated[str, Field(min_length=1)] = Field(
        default="127.0.0.1", description="address of the robot's control, not that of the arm's own port"
    )
    stiffness_n_m: float = Field(default=600.0, ge=10.0, le=STIFFEST, description="of the tip")
    stiffness_n_m_rad: float = Field(default=50.0, ge=1.0, le=200.0, description="of the orientation of the tool")
    damping_ratio: float = Field(default=1.0, ge=0.3, le=2.0, description="of tip and tool; 1 is critical")
    posture_hz: float = Field(
        default=0.5,
        ge=0.1,
        le=5.0,
        description="natural frequency at which the elbow returns to where it was at opening",
    )
    force_n: float = Field(
        default=30.0, ge=1.0, le=100.0, description="largest force of the tip's spring, and largest one reported"
    )
    torque_n_m: float = Field(
        default=0.0,
        ge=0.0,
        le=20.0,
        description="largest torque reported, where the tool is to be turned; 0 keeps the tool as it was at opening",
    )
    turning_n_m: float = Field(default=8.0, ge=0.5, le=20.0, description="largest torque of the tool's spring")
    reflex_n: float = Field(
        default=60.0, ge=5.0, le=200.0, description="force at the tip at which the robot itself stops with a reflex"
    )
    reflex_n_m: float = Field(
        default=60.0, ge=5.0, le=100.0, description="torque at a joint at which it does; a quarter for the wrist"
    )
    tare_n: float = Field(
        default=3.0,
        ge=0.0,
        le=20.0,
        description="largest force at opening that is taken for the offset of the estimate and subtracted",
    )
    workspace_m: tuple[Vector, Vector] = Field(
        default=((0.30, -0.30, 0.10), (0.70, 0.30, 0.75)), description="lowest and highest corner for commands"
    )
    speed_m_s: float = Field(default=1.0, gt=0.0, le=1.5, description="largest speed of the command")
    approach_m_s: float = Field(
        default=0.1, gt=0.0, le=0.5, description="speed towards the commands after opening or a pause"
    )
    approach_rad_s: float = Field(default=0.5, gt=0.0, le=2.0, description="the same for the orientation")
    stale_ms: float = Field(
        default=50.0,
        ge=SHORTEST_STALE_MS,
        le=1000.0,
        description="age of a command from which on the arm stops where it is",
    )
    lost_ms: float = Field(
        default=150.0,
        ge=50.0,
        le=5000.0,
        description="time without a state after which the robot counts as lost; by itself it stops after 20 ms",
    )
    priority: int = Field(
        default=80, ge=0, le=98, description="of the controller process in SCHED_FIFO, if permitted; 0 for none"
    )
    cpu: int | None = Field(default=None, ge=0, description="the only processor of the controller; any if not given")
    recover: bool = Field(
        default=False,
        description="clear a reflex or another error of the robot at opening, once; without it, opening fails and "
        "names the error",
    )

    @property
    def stale_s(self) -> float:
        return 1e-3 * self.stale_ms

    @property
    def lost_s(self) -> float:
        return 1e-3 * self.lost_ms

    @model_validator(mode="after")
    def check_workspace(self) -> Self:
        low, high = self.workspace_m
        if not all(a < b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"workspace_m: expected a lower and a higher corner, got {self.workspace_m}")
        return self

    @model_validator(mode="after")
    def check_reflex(self) -> Self:
        if self.reflex_n < self.force_n:
            raise ValueError(f"reflex_n: expected force_n, {self.force_n:g}, or more: the robot would stop before it")
        return self
