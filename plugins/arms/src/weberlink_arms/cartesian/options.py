"""Options of the robot `dynamixel`, checked against what bus, mechanics and gains allow."""

from enum import StrEnum
from functools import lru_cache
from itertools import product
from math import ceil, hypot, radians
from typing import Annotated, Self

from pydantic import Field, model_validator

from weberlink.geometry.vector import Vector, add, scale
from weberlink_arms.cartesian.arm import (
    AXIS_X_M,
    COULOMB_N_M,
    LEAST_ROTOR_INERTIA_KG_M2,
    LOWER,
    ROTOR_INERTIA_KG_M2,
    UPPER,
    VISCOUS_N_M_S,
    ArmPose,
    Joints,
    Mechanics,
    inverse_nearest,
)
from weberlink_arms.cartesian.external_force import force_error
from weberlink_arms.cartesian.impedance import SLOWEST_HZ, ImpedanceGains, fastest_damping, stiffest
from weberlink_arms.dynamixel.motor_models import JointFriction
from weberlink_arms.dynamixel.options import MotorBusOptions
from weberlink_arms.dynamixel.registers import GOAL_CURRENT

FrictionValue = Annotated[float, Field(ge=0.0, le=1.0)]
JointValues = tuple[FrictionValue, FrictionValue, FrictionValue, FrictionValue]


class OnClose(StrEnum):
    """How the arm is left; `hold` is the default, since without torque it drops."""

    HOLD = "hold"
    LIMP = "limp"
    REST = "rest"


class DynamixelOptions(MotorBusOptions):
    """Options of `dynamixel`. Frame: origin in the middle of the foot, x forward, y left, z up."""

    SLOWEST_HZ = SLOWEST_HZ
    GOAL_SIZE = GOAL_CURRENT.size

    ids: tuple[int, int, int, int] = Field(default=(11, 12, 13, 14), description="of the motors of joints 1 to 4")
    rate_hz: float = Field(default=250.0, ge=SLOWEST_HZ, le=1000.0, description="of the bus")
    on_close: OnClose = Field(
        default=OnClose.HOLD,
        description="hold: the motors hold the arm, with at most max_current_ma; limp: it drops; rest: it goes home, "
        "then limp",
    )
    home_m: Vector = Field(default=(0.14, 0.0, 0.06), description="where `on_close: rest` puts the tip")
    workspace_m: tuple[Vector, Vector] = Field(
        default=((0.12, -0.12, 0.05), (0.26, 0.12, 0.25)), description="lowest and highest corner for commands"
    )
    pitch_deg: float | None = Field(
        default=None, ge=-90.0, le=90.0, description="of the gripper, positive down; that at opening if not given"
    )
    stiffness_n_m: float = Field(default=400.0, ge=1e-3, le=1e9, description="of the tip; bounded by damping and rate")
    damping_rate_s: float = Field(default=12.0, ge=1e-3, le=1e4, description="decay rate of motions [1/s]")
    rotor_inertia_kg_m2: float = Field(
        default=ROTOR_INERTIA_KG_M2,
        ge=LEAST_ROTOR_INERTIA_KG_M2,
        le=0.2,
        description="of each motor at its joint; the damping is proportional to it",
    )
    force_n: float = Field(
        default=5.0, gt=0.0, le=20.0, description="largest force of the tip's spring, and largest one reported"
    )
    max_current_ma: float = Field(default=1000.0, ge=650.0, le=3200.0, description="largest current of a motor")
    approach_m_s: float = Field(
        default=0.1, gt=0.0, le=0.5, description="speed towards the commands after opening or a pause"
    )
    torque_constant_n_m_a: float = Field(default=1.78, gt=0.1, lt=10.0, description="of the motors with their gears")
    torque_constant_error: float = Field(
        default=0.4, ge=0.0, lt=1.0, description="largest relative error of it; smaller after a calibration"
    )
    coulomb_n_m: JointValues = Field(default=COULOMB_N_M, description="dry friction of the joints")
    viscous_n_m_s: JointValues = Field(default=VISCOUS_N_M_S, description="viscous friction of the joints")
    force_cutoff_hz: float = Field(default=50.0, ge=0.0, le=1e4, description="of the low-pass on the force; 0 for none")

    @property
    def bus_ids(self) -> tuple[int, ...]:
        return self.ids

    @property
    def lower(self) -> Joints:
        """Range of the joints [rad]."""
        return LOWER

    @property
    def upper(self) -> Joints:
        return UPPER

    @property
    def gains(self) -> ImpedanceGains:
        return ImpedanceGains(self.stiffness_n_m, self.damping_rate_s, self.force_n, self.rotor_inertia_kg_m2)

    @property
    def pitch(self) -> float | None:
        """Of the gripper [rad]; None for that at opening."""
        return None if self.pitch_deg is None else radians(self.pitch_deg)

    @property
    def current(self) -> float:
        """Largest of a motor [A]."""
        return 1e-3 * self.max_current_ma

    @property
    def friction(self) -> JointFriction:
        return JointFriction(self.coulomb_n_m, self.viscous_n_m_s)

    @model_validator(mode="after")
    def check_gains(self) -> Self:
        fastest = fastest_damping(self.rate_hz, self.rotor_inertia_kg_m2)
        if self.damping_rate_s > fastest:
            raise ValueError(
                f"damping_rate_s: expected {fastest:.1f} or less at {self.rate_hz:g} Hz with rotor_inertia_kg_m2 "
                f"{self.rotor_inertia_kg_m2:g}"
            )
        most = stiffest(self.damping_rate_s, self.rate_hz, self.rotor_inertia_kg_m2)
        if self.stiffness_n_m > most:
            raise ValueError(
                f"stiffness_n_m: expected {most:.0f} or less, more is unstable at {self.rate_hz:g} Hz with "
                f"damping_rate_s {self.damping_rate_s:g}"
            )
        return self

    @model_validator(mode="after")
    def check_workspace(self) -> Self:
        low, high = self.workspace_m
        if not all(a < b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"workspace_m: expected a lower and a higher corner, got {self.workspace_m}")
        for corner in corners(self.workspace_m):
            if inverse_nearest(corner, radians(self.pitch_deg or 0.0)) is None:
                raise ValueError(f"workspace_m: expected corners that the arm reaches, it does not reach {corner}")
        if not all(a <= x <= b for a, x, b in zip(low, self.home_m, high, strict=True)):
            raise ValueError(f"home_m: expected a point within the workspace, got {self.home_m}")
        return self


def corners(workspace: tuple[Vector, Vector]) -> list[Vector]:
    """Corners of the box, and its middle [m]."""
    low, high = workspace
    middle = scale(add(low, high), 0.5)
    return [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])] + [middle]


@lru_cache(maxsize=8)
def worst_force_error(options: DynamixelOptions) -> tuple[float, float]:
    """Of the estimate at rest in the workspace: newtons, rounded up to a half as the grid is coarse, and share."""
    friction, share = options.friction, options.torque_constant_error
    newtons = max(force_error(there, friction, share)[0] for there in poses(options))
    return (0.5 * ceil(2.0 * newtons), share)


def poses(options: DynamixelOptions, count: int = 25) -> list[ArmPose]:
    """A grid over the workspace, with the reachable pitch nearest to the one wanted (0 if none is).

    Joint 1 does not change the other joints, so the grid is one of reach and height.
    """
    (x0, y0, low), (x1, y1, high) = options.workspace_m
    near = hypot(_least(x0 - AXIS_X_M, x1 - AXIS_X_M), _least(y0, y1))
    far = hypot(max(abs(x0 - AXIS_X_M), abs(x1 - AXIS_X_M)), max(abs(y0), abs(y1)))
    pitch = radians(options.pitch_deg or 0.0)
    points = product(_spread(AXIS_X_M + near, AXIS_X_M + far, count), _spread(low, high, count))
    found = (inverse_nearest((x, 0.0, z), pitch) for x, z in points)
    pose = Mechanics().pose
    return [pose(joints) for joints in found if joints is not None]


def _least(low: float, high: float) -> float:
    """Distance of a range from 0."""
    return max(low, -high, 0.0)


def _spread(low: float, high: float, count: int) -> list[float]:
    return [low + (high - low) * number / (count - 1) for number in range(count)]
