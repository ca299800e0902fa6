"""Emulated Koch and OMX arms on their bus: motors, the joints that they turn, a person's hand and walls.

Joints are independent: rotor and link are one inertia, with dry and viscous friction and stops. The weight is that of
the arm's model (option `gravity`) or none. The hand holds every axis by a spring and a damper, and moves
it to and fro slowly. Each step is linearly implicit Euler, stable for any stiffness.
"""

from collections.abc import Sequence
from importlib import import_module
from math import copysign, pi, sin
from typing import Annotated, ClassVar, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from weberlink.geometry.joints import Joints
from weberlink_arms.dynamixel.layouts import KOCH_FOLLOWER, KOCH_LEADER, OMX_LEADER, ArmLayout
from weberlink_arms.dynamixel.motor_models import CurrentLaw
from weberlink_arms.dynamixel.packet import HIGHEST_ID
from weberlink_arms.dynamixel.registers import BAUD_RATES
from weberlink_arms.emulators.dynamixel.arm import STEP, ArmEmulator

LINK_KG_M2: Final = 0.001
"""Inertia of what an axis carries; a guess between those of the joints of the Koch's model."""
STOP_N_M_RAD: Final = 20.0
STOP_N_M_S: Final = 0.1
HAND_N_M_S: Final = 0.023
"""As in `weberlink_arms.dynamixel.leader`: fingers 0.1 m from the joint."""
HAND_S: Final = (4.0, 5.0, 6.0, 7.0, 8.0, 3.0)
"""Periods of the hand's motion [s]; different, so that the axes pass through many combinations."""

Positive = Annotated[float, Field(gt=0.0, le=1e3)]


class Wall(BaseModel):
    """Something that an axis meets at an angle."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    joint: str = Field(description="name of the axis")
    angle_rad: float = Field(ge=-6.3, le=6.3, description="where it begins")
    stiffness_nm_rad: float = Field(default=20.0, gt=0.0, le=200.0)
    below: bool = Field(default=False, description="the wall lies at smaller angles")

    def depth(self, angle: float) -> float:
        """How far an axis is in it, positive toward larger angles [rad]; 0 outside."""
        beyond = angle - self.angle_rad
        return min(beyond, 0.0) if self.below else max(beyond, 0.0)


class JointArmOptions(BaseModel):
    """Options of an emulated arm. Lists have one entry for each axis, the gripper last."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    LAYOUT: ClassVar[ArmLayout]

    ids: tuple[int, ...] | None = Field(default=None, description="of the motors; those of LeRobot if not given")
    baud: int = Field(default=1_000_000, description="rate of the bus [bit/s]")
    start_rad: tuple[float, ...] | None = Field(
        default=None, description="angles when power comes on; 0, and the gripper half open, if not given"
    )
    hand_n_m_rad: float = Field(default=0.0, ge=0.0, le=50.0, description="stiffness of the hand on each axis")
    hand_rad: tuple[float, ...] = Field(
        default=(0.0,) * 6, description="amplitudes of the hand's motion about the start"
    )
    hand_s: tuple[Positive, ...] = Field(default=HAND_S, description="periods of that motion")
    walls: tuple[Wall, ...] = Field(default=(), description="what the axes meet")
    gravity: bool = Field(default=False, description="the arm has the weight of its model")
    current_law: Literal["motor", "supply"] | None = Field(
        default=None, description="what the current registers mean; that of each motor if not given"
    )
    constant_ratio: float = Field(default=1.0, gt=0.1, lt=10.0, description="of the true torque constant to the stated")
    current_noise_ma: float = Field(
        default=3.0, ge=0.0, le=1000.0, description="standard deviation of the measured current of a motor"
    )
    seed: int = Field(default=0, description="of that noise")

    @property
    def start(self) -> Joints:
        """[rad]"""
        return (
            (*(0.0,) * len(self.LAYOUT.joints), 0.5 * self.LAYOUT.upper[-1])
            if self.start_rad is None
            else self.start_rad
        )

    @model_validator(mode="after")
    def check(self) -> Self:
        layout, count = self.LAYOUT, len(self.LAYOUT.ids)
        for name in ("ids", "start_rad", "hand_rad", "hand_s"):
            values = getattr(self, name)
            if values is not None and len(values) != count:
                raise ValueError(f"{name}: expected {count} values ({', '.join(layout.axes)}), got {len(values)}")
        ids = self.ids or layout.ids
        if len(set(ids)) != count or not all(0 <= id_ <= HIGHEST_ID for id_ in ids):
            raise ValueError(f"ids: expected {count} different ones from 0 to {HIGHEST_ID}, got {ids}")
        if self.baud not in BAUD_RATES:
            raise ValueError(f"baud: expected one of {', '.join(map(str, BAUD_RATES))}, got {self.baud}")
        for name, low, angle, high in zip(layout.axes, layout.lower, self.start, layout.upper, strict=True):
            if not low <= angle <= high:
                raise ValueError(f"start_rad: expected {low:.2f} to {high:.2f} rad for {name}, got {angle}")
        for wall in self.walls:
            if wall.joint not in layout.axes:
                raise ValueError(f"walls: expected a joint of {', '.join(layout.axes)}, got {wall.joint}")
        return self


class JointArmEmulator(ArmEmulator):
    """See `weberlink_arms.emulators.dynamixel.arm`."""

    def __init__(self, options: JointArmOptions) -> None:
        self._options, self._layout = options, options.LAYOUT
        axes = range(len(self._layout.ids))
        self._start = options.start
        self.angles, self.velocities = list(self._start), [0.0 for _ in axes]
        self._walls = [[wall for wall in options.walls if wall.joint == self._layout.axes[axis]] for axis in axes]
        self._gravity = (
            import_module("weberlink_mujoco.arms.models").load(self._layout.name).gravity if options.gravity else None
        )
        self._elapsed = 0.0
        self.outside_nm = [0.0 for _ in axes]
        """Torques of hand and walls on the axes [N m]."""
        law = None if options.current_law is None else CurrentLaw(options.current_law)
        super().__init__(
            options.LAYOUT,
            options.ids or options.LAYOUT.ids,
            baud=options.baud,
            noise_a=1e-3 * options.current_noise_ma,
            seed=options.seed,
            law=law,
            constant=options.constant_ratio,
        )

    def _move(self, torques: Sequence[float]) -> None:
        self._elapsed += STEP
        weight = self._gravity(tuple(self.angles)) if self._gravity is not None else (0.0,) * len(torques)
        for axis, torque in enumerate(torques):
            self._turn(axis, torque - weight[axis])

    def _turn(self, axis: int, torque: float) -> None:
        """Advance an axis by `STEP` under the torque of motor and weight [N m]."""
        model, angle, before = self._layout.motors[axis], self.angles[axis], self.velocities[axis]
        spring, damper, push = self._outside(axis, angle)
        rest = model.rotor_kg_m2 + LINK_KG_M2
        inertia = rest + STEP * (model.viscous_n_m_s + damper + STEP * spring)
        momentum = rest * before + STEP * (torque + push)
        velocity = copysign(max(0.0, abs(momentum) - STEP * model.coulomb_n_m), momentum) / inertia
        self.outside_nm[axis] = push - (damper + STEP * spring) * velocity
        self.velocities[axis] = velocity
        self.angles[axis] = angle + STEP * velocity

    def _outside(self, axis: int, angle: float) -> tuple[float, float, float]:
        """Springs [N m/rad] and dampers [N m s] on an axis, and their torque if it stood still [N m]."""
        options = self._options
        spring, damper, push = 0.0, 0.0, 0.0
        if options.hand_n_m_rad > 0.0:
            phase = 2.0 * pi * self._elapsed / options.hand_s[axis]
            meant = self._start[axis] + options.hand_rad[axis] * sin(phase)
            spring, damper = options.hand_n_m_rad, HAND_N_M_S
            push = spring * (meant - angle)
        for wall in self._walls[axis]:
            if depth := wall.depth(angle):
                spring += wall.stiffness_nm_rad
                push -= wall.stiffness_nm_rad * depth
        low, high = self._layout.lower[axis], self._layout.upper[axis]
        if not low <= angle <= high:
            beyond = angle - (low if angle < low else high)
            spring, damper, push = spring + STOP_N_M_RAD, damper + STOP_N_M_S, push - STOP_N_M_RAD * beyond
        return spring, damper, push


class KochLeaderEmulatorOptions(JointArmOptions):
    """Options of the emulated Koch leader. Lists: shoulder_pan, ..., wrist_roll, gripper."""

    LAYOUT: ClassVar[ArmLayout] = KOCH_LEADER

    hand_n_m_rad: float = Field(default=1.0, ge=0.0, le=50.0, description="stiffness of the hand on each axis")
    hand_rad: tuple[float, ...] = Field(
        default=(0.4, 0.3, 0.4, 0.4, 0.4, 0.4), description="amplitudes of the hand's motion about the start"
    )


class OmxLeaderEmulatorOptions(KochLeaderEmulatorOptions):
    """Options of the emulated OMX leader. Lists: shoulder_pan, ..., wrist_roll, gripper."""

    LAYOUT: ClassVar[ArmLayout] = OMX_LEADER


class KochFollowerEmulatorOptions(JointArmOptions):
    """Options of the emulated Koch follower. Lists: shoulder_pan, ..., wrist_roll, gripper."""

    LAYOUT: ClassVar[ArmLayout] = KOCH_FOLLOWER


class KochLeaderEmulator(JointArmEmulator):
    """A Koch v1.1 leader in a person's hand."""

    Options = KochLeaderEmulatorOptions

    def __init__(self, options: KochLeaderEmulatorOptions | None = None) -> None:
        super().__init__(options or KochLeaderEmulatorOptions())


class OmxLeaderEmulator(JointArmEmulator):
    """An OMX leader in a person's hand."""

    Options = OmxLeaderEmulatorOptions

    def __init__(self, options: OmxLeaderEmulatorOptions | None = None) -> None:
        super().__init__(options or OmxLeaderEmulatorOptions())


class KochFollowerEmulator(JointArmEmulator):
    """A Koch v1.1 follower."""

    Options = KochFollowerEmulatorOptions

    def __init__(self, options: KochFollowerEmulatorOptions | None = None) -> None:
        super().__init__(options or KochFollowerEmulatorOptions())
