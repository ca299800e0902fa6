"""An emulated OpenMANIPULATOR-X on its bus: five servos, the arm, and the scene that its tip touches."""

from collections.abc import Sequence
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.settings import SceneSettings, build
from weberlink_arms.cartesian.arm import (
    COULOMB_N_M,
    LOWER,
    ROTOR_INERTIA_KG_M2,
    UPPER,
    VISCOUS_N_M_S,
    Joints,
    arm_pose,
)
from weberlink_arms.dynamixel.motor_models import XM430_W350
from weberlink_arms.dynamixel.packet import HIGHEST_ID
from weberlink_arms.dynamixel.registers import BAUD_RATES
from weberlink_arms.emulators.arm_dynamics import EmulatedArm, Gripper
from weberlink_arms.emulators.dynamixel.arm import ArmEmulator

EmulatedFriction = Annotated[float, Field(ge=0.0, le=100.0)]
EmulatedJointFriction = tuple[EmulatedFriction, EmulatedFriction, EmulatedFriction, EmulatedFriction]


class DynamixelEmulatorOptions(BaseModel):
    """Options of the emulated arm: by default as shipped, held by a person in the home pose until all torque is on."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    ids: tuple[int, int, int, int, int] = Field(
        default=(11, 12, 13, 14, 15), description="of joints 1 to 4 and of the gripper"
    )
    baud: int = Field(default=1_000_000, description="rate of the bus [bit/s]")
    start_rad: Joints = Field(default=(0.0, -1.05, 0.35, 0.70), description="joint angles when power comes on")
    held: bool = Field(
        default=True, description="a person holds the arm until torque is on in all four joints; otherwise it falls"
    )
    scene: SceneSettings = Field(default=(), description="what the tip touches, in the frame of the foot")
    coulomb_n_m: EmulatedJointFriction = Field(default=COULOMB_N_M, description="dry friction of the joints")
    viscous_n_m_s: EmulatedJointFriction = Field(default=VISCOUS_N_M_S, description="viscous friction of the joints")
    torque_constant_n_m_a: float = Field(
        default=XM430_W350.constant, gt=0.0, le=10.0, description="of the motors with their gears"
    )
    rotor_inertia_kg_m2: float = Field(
        default=ROTOR_INERTIA_KG_M2, ge=0.0, le=1.0, description="of each motor, seen at its joint"
    )
    current_noise_ma: float = Field(default=3.0, ge=0.0, description="standard deviation of the measured current")
    seed: int = Field(default=0, description="of that noise")

    @field_validator("ids")
    @classmethod
    def check_ids(cls, ids: tuple[int, ...]) -> tuple[int, ...]:
        if len(set(ids)) != len(ids) or not all(0 <= id_ <= HIGHEST_ID for id_ in ids):
            raise ValueError(f"expected five different ids from 0 to {HIGHEST_ID}")
        return ids

    @field_validator("baud")
    @classmethod
    def check_baud(cls, baud: int) -> int:
        if baud not in BAUD_RATES:
            raise ValueError(f"expected one of {', '.join(map(str, BAUD_RATES))}")
        return baud

    @field_validator("start_rad")
    @classmethod
    def check_start(cls, start: Joints) -> Joints:
        for number, (low, angle, high) in enumerate(zip(LOWER, start, UPPER, strict=True), start=1):
            if not low <= angle <= high:
                raise ValueError(f"joint {number}: expected {low:.2f} to {high:.2f} rad, got {angle}")
        return start

    @model_validator(mode="after")
    def check_scene(self) -> Self:
        tip = arm_pose(self.start_rad).tip
        for number, thing in enumerate(self.scene):
            if build([thing]).touch(tip):
                raise ValueError(f"scene[{number}]: expected the tip to start outside, it starts at {tip} m")
        return self


class DynamixelEmulator(ArmEmulator):
    """See `weberlink_arms.emulators.dynamixel.arm`."""

    Options = DynamixelEmulatorOptions

    def __init__(self, options: DynamixelEmulatorOptions | None = None) -> None:
        self._options = options = DynamixelEmulatorOptions() if options is None else options
        self.arm = EmulatedArm(
            build(options.scene) if options.scene else None,
            options.start_rad,
            coulomb=options.coulomb_n_m,
            viscous=options.viscous_n_m_s,
            rotor_inertia=options.rotor_inertia_kg_m2,
        )
        self.gripper = Gripper()
        self.held = options.held
        """Whether a person still holds the arm."""
        super().__init__(
            options.ids,
            (XM430_W350,) * 5,
            baud=options.baud,
            noise_a=1e-3 * options.current_noise_ma,
            seed=options.seed,
        )

    @property
    def tip(self) -> Vector:
        """In the frame of the foot [m]."""
        return self.arm.tip

    @property
    def tip_force(self) -> Vector:
        """Of the scene on the tip [N]."""
        return self.arm.force

    def _performed(self) -> None:
        self.held = self.held and not all(servo.torque_on for servo in self.servos[:4])

    def _place(self, index: int) -> tuple[float, float]:
        if index < 4:
            return self.arm.angles[index], self.arm.velocities[index]
        return self.gripper.angle, self.gripper.velocity

    def _move(self, currents: Sequence[float]) -> None:
        torques = [self._options.torque_constant_n_m_a * current for current in currents]
        if not self.held:
            self.arm.step(torques)
        self.gripper.step(torques[4])
