"""An emulated OpenMANIPULATOR-X on its bus: five servos, the arm, and the scene that its tip touches.

Mechanics advance on a fixed grid of steps, and instructions and watchdogs take effect when they are due, independent of
when `advance` is called. Temperature, backlash and cables are not modelled.
"""

from collections import deque
from collections.abc import Mapping
from math import inf
from random import Random
from typing import Annotated, ClassVar, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from weberlink.arms.dynamixel.packet import HIGHEST_ID
from weberlink.arms.dynamixel.registers import BAUD_RATES, OPENMANIPULATOR_X_MODEL
from weberlink.arms.emulators.dynamixel.bus import ServoBus
from weberlink.arms.emulators.dynamixel.servo import TORQUE_N_M_PER_A, Measured, Servo, amperes
from weberlink.geometry.vector import Vector
from weberlink.hardware.emulator import WireFaults
from weberlink.slave.emulators.arm_dynamics import STEP, EmulatedArm, Gripper
from weberlink.slave.robots.dynamixel.arm import (
    COULOMB_N_M,
    LOWER,
    ROTOR_INERTIA_KG_M2,
    UPPER,
    VISCOUS_N_M_S,
    Joints,
    arm_pose,
)
from weberlink.slave.scenes.settings import SceneSettings, build

GAP_STEPS = round(1.0 / STEP)
"""Most steps per call; the rest of a longer silence is skipped."""
OVERLOAD = 1 << 5
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
        default=TORQUE_N_M_PER_A, gt=0.0, le=10.0, description="of the motors with their gears"
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


class DynamixelEmulator:
    """Sans-I/O: bytes and `now` go in, messages come out. See `weberlink.hardware.emulator`."""

    Options = DynamixelEmulatorOptions
    transport: ClassVar[str] = "serial"
    OWN_FAULTS: ClassVar[Mapping[str, str]] = {
        "overload": "a joint raises its alarm and goes limp; 1 to 4, 5 for the gripper",
        "trip_watchdog": "the bus watchdog of every motor with its torque on trips; any value",
        "stuck_encoder": "a joint measures a constant angle from now on; 1 to 5, 0 for none",
        "dead": "a joint does not receive or answer, its motor keeps its order; 1 to 5, 0 for none",
        "restart": "power cycle, which also ends `dead`; any value",
        "wrong_model": "every motor reports this model number, 1060 is an XL430-W250; 0: its own",
    }

    def __init__(self, options: DynamixelEmulatorOptions | None = None) -> None:
        self._options = options = DynamixelEmulatorOptions() if options is None else options
        self.faults = WireFaults()
        self._random = Random(options.seed)  # noqa: S311 - noise of a sensor
        self._noise = 1e-3 * options.current_noise_ma
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
        self.currents = [0.0] * 5
        """Present currents of joints 1 to 4 and gripper [A]."""
        self.largest_current = 0.0
        """Of any motor since the start [A]."""
        self._stuck: dict[int, float] = {}
        self._injected: deque[tuple[str, float]] = deque()
        self.servos = tuple(self._servo(index, id_) for index, id_ in enumerate(options.ids))
        """Joints 1 to 4, gripper."""
        self.bus = ServoBus(self.servos, options.baud)
        self._steps: int | None = None

    @property
    def tip(self) -> Vector:
        """In the frame of the foot [m]."""
        return self.arm.tip

    @property
    def tip_force(self) -> Vector:
        """Of the scene on the tip [N]."""
        return self.arm.force

    @property
    def watchdog_trips(self) -> int:
        """Of all servos since the start."""
        return sum(servo.watchdog_trips for servo in self.servos)

    def receive(self, data: bytes, now: float) -> None:
        self.advance(now)
        self.bus.receive(data, now)

    def advance(self, now: float) -> None:
        if self._steps is None:
            self._steps = int(now / STEP)
        while self._injected:
            self._suffer(*self._injected.popleft(), now)
        while True:
            request, deadline = self.bus.next_request, self._deadline()
            due = min(request, deadline)
            if due > now:
                break
            self._move_to(due)
            if request <= deadline:
                self.bus.perform(due)
                self.held = self.held and not all(servo.torque_on for servo in self.servos[:4])
            else:
                for servo in self.servos:
                    servo.watch(due)
        self._move_to(now)

    def replies(self, now: float) -> list[bytes]:
        return self.bus.leaving(now)

    def next_timer(self) -> float | None:
        soonest = min(self.bus.next_request, self.bus.next_reply, self._deadline())
        return soonest if soonest < inf else None

    def inject(self, name: str, value: float) -> None:
        """Cause one of its own faults at the next `advance`; callable from any thread.

        Raises:
            ValueError: unknown fault or value.
        """
        if name not in self.OWN_FAULTS:
            raise ValueError(f"no fault is called {name!r}; there are {', '.join(self.OWN_FAULTS)}")
        least = {"overload": 1, "stuck_encoder": 0, "dead": 0}.get(name)
        if least is not None and value not in range(least, 6):
            raise ValueError(f"{name}: expected a joint from {least} to 5, got {value:g}")
        if name == "wrong_model" and not 0 <= value <= 0xFFFF:
            raise ValueError(f"{name}: expected a model number, got {value:g}")
        self._injected.append((name, value))

    def _suffer(self, name: str, value: float, now: float) -> None:
        index = int(value) - 1
        match name:
            case "overload":
                self.servos[index].alarm(OVERLOAD)
            case "trip_watchdog":
                for servo in self.servos:
                    servo.trip()
            case "stuck_encoder":
                self._stuck = {} if index < 0 else {index: self._angle(index)}
            case "dead":
                self.bus.dead = set() if index < 0 else {self.servos[index].id}
            case "wrong_model":
                for servo in self.servos:
                    servo.rename(int(value) or OPENMANIPULATOR_X_MODEL)
            case _:
                self.bus.restart()
                for servo in self.servos:
                    servo.reboot(now)

    def _deadline(self) -> float:
        """When a bus watchdog would trip next."""
        return min([servo.deadline for servo in self.servos])

    def _servo(self, index: int, id_: int) -> Servo:
        return Servo(id_, lambda: self._measured(index), baud=self._options.baud)

    def _angle(self, index: int) -> float:
        return self.arm.angles[index] if index < 4 else self.gripper.angle

    def _measured(self, index: int) -> Measured:
        """Sensor values of a servo, with noise."""
        current = self.currents[index] + self._random.gauss(0.0, self._noise)
        if index in self._stuck:
            return Measured(self._stuck[index], 0.0, current)
        velocity = self.arm.velocities[index] if index < 4 else self.gripper.velocity
        return Measured(self._angle(index), velocity, current)

    def _move_to(self, now: float) -> None:
        """Advance the mechanics to a time, on the grid of steps."""
        assert self._steps is not None
        end = int(now / STEP)
        begin = max(self._steps, end - GAP_STEPS)
        self._steps = max(end, self._steps)
        for _ in range(begin, end):
            self._step()

    def _step(self) -> None:
        arm, gripper = self.arm, self.gripper
        angles, velocities = [*arm.angles, gripper.angle], (*arm.velocities, gripper.velocity)
        for index, angle in self._stuck.items():
            angles[index] = angle
        self.currents = currents = [
            amperes(servo.drive, angle, velocity)
            for servo, angle, velocity in zip(self.servos, angles, velocities, strict=True)
        ]
        self.largest_current = max(self.largest_current, *currents, -min(currents))
        torques = [self._options.torque_constant_n_m_a * current for current in currents]
        if not self.held:
            arm.step(torques)
        gripper.step(torques[4])
