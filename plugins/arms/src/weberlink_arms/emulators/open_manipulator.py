"""An emulated OpenMANIPULATOR-X on its bus: five servos, the arm, and the scene that its tip touches."""

from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from weberlink.geometry.vector import ZERO, Vector, add, dot, scale, subtract
from weberlink.slave.scenes.settings import SceneSettings, build
from weberlink_arms.cartesian.arm import (
    COULOMB_N_M,
    LOWER,
    ROTOR_INERTIA_KG_M2,
    UPPER,
    VISCOUS_N_M_S,
    Joints,
    Mechanics,
)
from weberlink_arms.dynamixel.layouts import OPEN_MANIPULATOR_X
from weberlink_arms.dynamixel.motor_models import XM430_W350
from weberlink_arms.dynamixel.packet import HIGHEST_ID
from weberlink_arms.dynamixel.registers import BAUD_RATES
from weberlink_arms.emulators.arm import EmulatedBusOptions
from weberlink_arms.emulators.dynamixel.arm import DynamixelArmEmulator
from weberlink_mujoco.arms.models import MODELS, compiled, mujoco, read

STEP = DynamixelArmEmulator.STEP
GRIPPER_N_M, GRIPPER_N_M_S = 0.02, 0.02  # dry and viscous friction of the gripper; guesses
FINGER_M_RAD = 0.015  # way of a finger in the model
EmulatedFriction = Annotated[float, Field(ge=0.0, le=100.0)]
EmulatedJointFriction = tuple[EmulatedFriction, EmulatedFriction, EmulatedFriction, EmulatedFriction]


class DynamixelEmulatorOptions(EmulatedBusOptions):
    """Options of the emulated arm: by default as shipped, held by a person in the home pose until all torque is on."""

    LAYOUT = OPEN_MANIPULATOR_X
    HIGHEST_ID = HIGHEST_ID
    BAUD_RATES = BAUD_RATES

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

    @field_validator("start_rad")
    @classmethod
    def check_start(cls, start: Joints) -> Joints:
        for number, (low, angle, high) in enumerate(zip(LOWER, start, UPPER, strict=True), start=1):
            if not low <= angle <= high:
                raise ValueError(f"joint {number}: expected {low:.2f} to {high:.2f} rad, got {angle}")
        return start

    @model_validator(mode="after")
    def check_scene(self) -> Self:
        tip = Mechanics().pose(self.start_rad).tip
        for number, thing in enumerate(self.scene):
            if build([thing]).touch(tip):
                raise ValueError(f"scene[{number}]: expected the tip to start outside, it starts at {tip} m")
        return self


class DynamixelEmulator(DynamixelArmEmulator):
    """The arm in motion by MuJoCo: weight, rotors, friction, stops, and a scene that its tip touches."""

    Options = DynamixelEmulatorOptions

    def __init__(self, options: DynamixelEmulatorOptions | None = None) -> None:
        options = DynamixelEmulatorOptions() if options is None else options
        path = MODELS[OPEN_MANIPULATOR_X.name]
        self._package = mujoco()
        model = self._model = compiled(read(path), path)
        self._data = self._package.MjData(model)
        self._scene = build(options.scene) if options.scene else None
        self._site = self._package.mj_name2id(model, self._package.mjtObj.mjOBJ_SITE, "tip")
        self._jacobian = np.zeros((3, model.nv))
        model.opt.timestep = STEP
        model.dof_armature[:4] = options.rotor_inertia_kg_m2
        model.dof_frictionloss[:5] = (*options.coulomb_n_m, GRIPPER_N_M)
        model.dof_damping[:5] = (*options.viscous_n_m_s, GRIPPER_N_M_S)
        closed = OPEN_MANIPULATOR_X.offset_rad[4]
        self._data.qpos[:] = (*options.start_rad, closed, FINGER_M_RAD * closed, FINGER_M_RAD * closed)
        self.tip_force: Vector = ZERO  # of the scene on the tip during the last step [N]
        self.held = options.held  # a person holds joints 1 to 4 in their place
        self._look()
        super().__init__(
            OPEN_MANIPULATOR_X, options.bus_ids, baud=options.baud, noise_a=1e-3 * options.current_noise_ma,
            seed=options.seed, constant=options.torque_constant_n_m_a / XM430_W350.constant,
        )  # fmt: skip

    @property
    def angles(self) -> list[float]:
        return self._angles

    @property
    def velocities(self) -> list[float]:
        return self._velocities

    @property
    def tip(self) -> Vector:
        """In the frame of the foot [m]."""
        self._package.mj_kinematics(self._model, self._data)
        x, y, z = self._data.site_xpos[self._site].tolist()
        return x, y, z

    def _look(self) -> None:
        self._angles: list[float] = self._data.qpos[:5].tolist()
        self._velocities: list[float] = self._data.qvel[:5].tolist()

    def _performed(self) -> None:
        self.held = self.held and not all(servo.torque_on for servo in self.servos[:4])

    def _move(self, time: float) -> None:  # noqa: ARG002
        package, model, data = self._package, self._model, self._data
        before = data.qpos[:4].copy()
        package.mj_step1(model, data)
        data.qfrc_applied[:5] = self.motor_nm
        data.qfrc_applied[:] += self._touched()
        package.mj_step2(model, data)
        if self.held:
            data.qpos[:4], data.qvel[:4] = before, 0.0
        self._look()

    def _touched(self) -> Any:
        """Torques of the scene on all degrees of freedom [N m]: springs and friction as they will be after the step."""
        self.tip_force = ZERO
        x, y, z = self._data.site_xpos[self._site].tolist()
        touches = () if self._scene is None else self._scene.touch((x, y, z))
        if not touches:
            return 0.0
        self._package.mj_jacSite(self._model, self._data, self._jacobian, None, self._site)
        vx, vy, vz = (self._jacobian @ self._data.qvel).tolist()
        for touch in touches:
            speed = dot(touch.normal, (vx, vy, vz))
            push = max(0.0, touch.stiffness * (touch.depth - STEP * speed) - touch.damping * speed)
            slide = subtract((vx, vy, vz), scale(touch.normal, speed))
            rub = subtract(touch.drag, scale(slide, STEP * touch.grip))
            self.tip_force = add(self.tip_force, add(scale(touch.normal, push), rub))
        return self._jacobian.T @ self.tip_force
