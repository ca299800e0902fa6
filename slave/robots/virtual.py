"""What computed robots share: options of workspace and sensor, and the state of a robot between two readings."""

from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from weberlink.geometry.vector import ZERO, Vector, is_finite, norm, scale
from weberlink.slave.robots.contract import RobotFault, RobotReading, RobotSpec

LONGEST_GAP = 0.1
"""Longest time that a mechanical model advances per reading [s]; the rest of a longer silence is skipped."""


STIFFEST = 1e9
"""Largest stiffness of a computed robot [N/m]."""
UNSTATED = 2500.0
"""Stiffness of a computed robot that is built without a device [N/m]."""


class VirtualOptions(BaseModel):
    """Workspace, home, force range and stiffness of a robot that is computed."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    workspace_m: float = Field(default=0.06, gt=0.0, le=1.0, description="half an edge of the cube about the origin")
    home_m: Vector = Field(default=(0.0, 0.0, 0.03), description="position until the first command")
    force_n: float = Field(
        default=30.0, gt=0.0, description="range of its force sensor; larger forces are limited to it"
    )

    stiffness_n_m: float | None = Field(
        default=None,
        gt=0.0,
        le=STIFFEST,
        description="stiffness towards the command; by default what the device can display",
    )

    @model_validator(mode="after")
    def check_home(self) -> Self:
        if max(map(abs, self.home_m)) > self.workspace_m:
            raise ValueError(
                f"home_m: expected a point within the workspace of +-{self.workspace_m} m, got {self.home_m}"
            )
        return self


def virtual_spec(name: str, options: VirtualOptions, tick_period: float, torque_n_m: float = 0.0) -> RobotSpec:
    edge, stiffness = options.workspace_m, options.stiffness_n_m
    return RobotSpec(
        name=name,
        axes="xyz",
        force_n=options.force_n,
        stiffness_n_m=UNSTATED if stiffness is None else stiffness,
        workspace_m=((-edge, -edge, -edge), (edge, edge, edge)),
        rate_hz=1.0 / tick_period,
        force_sensing=True,
        torque_n_m=torque_n_m,
    )


class ComputedRobot:
    """A robot that advances at each reading, with the command held constant since the last one.

    A subclass gives `_reset` and `_advance`.
    """

    def __init__(self, spec: RobotSpec, home: Vector) -> None:
        self.spec = spec
        self._home = self._commanded = home
        self._reading: RobotReading | None = None

    def open(self, now: float) -> None:
        self._reset()
        self._commanded = self._home
        self._reading = RobotReading(now, self._home, ZERO)

    def command(self, position: Vector, now: float) -> None:  # noqa: ARG002
        if not is_finite(position):
            raise ValueError(f"{self.spec.name}: commanded a position that is not finite: {position}")
        self._commanded = position

    def latest(self, now: float) -> RobotReading:
        reading = self._reading
        if reading is None:
            raise RobotFault(f"{self.spec.name}: not open")
        if now <= reading.at:
            return reading
        position, force, torque = self._advance(self._commanded, now - reading.at)
        if torque is not ZERO:
            torque = saturated(torque, self.spec.torque_n_m)
        self._reading = RobotReading(now, position, saturated(force, self.spec.force_n), torque)
        return self._reading

    def close(self) -> None:
        self._reading = None

    def _reset(self) -> None:
        """Return to rest at home, without contact."""
        raise NotImplementedError

    def _advance(self, commanded: Vector, elapsed: float) -> tuple[Vector, Vector, Vector]:
        """Position [m], force [N] and torque [N m] after `elapsed` [s]."""
        raise NotImplementedError


def saturated(force: Vector, limit: float) -> Vector:
    """The reading of a sensor of range `limit` [N]: the direction is kept, the length is limited."""
    if force is ZERO:
        return force
    length = norm(force)
    return force if length <= limit else scale(force, limit / length)
