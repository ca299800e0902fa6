"""Emulated arms on a bus of Dynamixel motors: their currents, watchdogs and faults; Koch and OMX."""

from abc import abstractmethod
from collections.abc import Sequence
from random import Random
from typing import ClassVar, Final, Literal

from pydantic import Field

from weberlink_arms.dynamixel.layouts import KOCH_FOLLOWER, KOCH_LEADER, OMX_LEADER
from weberlink_arms.dynamixel.leader import HAND_N_M_S
from weberlink_arms.dynamixel.motor_models import CurrentLaw
from weberlink_arms.dynamixel.packet import FRAMING, HIGHEST_ID
from weberlink_arms.dynamixel.registers import BAUD_RATES
from weberlink_arms.emulators.arm import ArmEmulator, Joint, JointArmOptions
from weberlink_arms.emulators.dynamixel.servo import Measured, Servo, amperes
from weberlink_arms.servo.layout import ArmLayout
from weberlink_mujoco.arms.models import load

OVERLOAD: Final = 1 << 5
LINK_KG_M2: Final = 0.001  # inertia of what an axis carries; a guess between those of the joints of the Koch's model
STOP_N_M_RAD: Final = 20.0
STOP_N_M_S: Final = 0.1


class DynamixelArmEmulator(ArmEmulator):
    """An arm whose motors have currents; a subclass moves it.

    `noise_a` is the standard deviation of the measured current of a motor [A], `seed` that of the noise; `law` is what
    the current registers mean, that of each model if None; `constant` the true torque constants over those of the data
    sheets.
    """

    STEP = 0.0005
    OWN_FAULTS: ClassVar = {
        "overload": "a joint raises its alarm and goes limp; 1 is the first joint, the gripper is the last number",
        "low_voltage": "the supply of every motor falls below its limit; any value",
        "trip_watchdog": "the bus watchdog of every motor with its torque on trips; any value",
        "stuck_encoder": "a joint measures a constant angle from now on; 0 for none",
        "dead": "a joint does not receive or answer, its motor keeps its order; 0 for none",
        "restart": "power cycle, which also ends `dead`; any value",
        "wrong_model": "every motor reports this model number, 1060 is an XL430-W250; 0: its own",
    }
    NUMBERED: ClassVar = {"overload": 1, "stuck_encoder": 0, "dead": 0}

    def __init__(
        self,
        layout: ArmLayout,
        ids: Sequence[int],
        *,
        baud: int,
        noise_a: float,
        seed: int,
        law: CurrentLaw | None = None,
        constant: float = 1.0,
    ) -> None:
        self._layout, self._models, self._constant = layout, layout.motors, constant
        self._random = Random(seed)  # noqa: S311 - noise of a sensor
        self._noise = noise_a
        self.currents = [0.0] * len(ids)  # present ones of the motors [A]
        self.largest_current = 0.0  # of any motor since the start [A]
        self._stuck: dict[int, float] = {}
        super().__init__(FRAMING, [self._servo(index, id_, baud, law) for index, id_ in enumerate(ids)], baud)

    @property
    @abstractmethod
    def angles(self) -> Sequence[float]:
        """Of all axes, the gripper's 0 where it is closed [rad]."""

    @property
    @abstractmethod
    def velocities(self) -> Sequence[float]:
        """[rad/s]"""

    @abstractmethod
    def _move(self, time: float) -> None:
        """Advance the mechanics by `STEP` under `motor_nm`."""

    @property
    def watchdog_trips(self) -> int:
        """Of all servos since the start."""
        return sum(servo.watchdog_trips for servo in self.servos)

    def _deadline(self) -> float:
        deadlines: list[float] = [servo.deadline for servo in self.servos]
        return min(deadlines)

    def _watch(self, now: float) -> None:
        for servo in self.servos:
            servo.watch(now)

    def _fail(self, name: str, value: float) -> None:
        index = int(value) - 1
        match name:
            case "overload":
                self.servos[index].alarm(OVERLOAD)
            case "stuck_encoder":
                self._stuck = {} if index < 0 else {index: self._place(index)[0]}
            case "low_voltage":
                for servo in self.servos:
                    servo.lose_supply()
            case "trip_watchdog":
                for servo in self.servos:
                    servo.trip()

    def _servo(self, index: int, id_: int, baud: int, law: CurrentLaw | None) -> Servo:
        model = self._models[index]
        # A motor that measures no current has a load only.
        law = model.law if law is None or not model.controls_current else law
        return Servo(id_, lambda: self._measured(index), baud=baud, model=model, law=law)

    def _place(self, index: int) -> tuple[float, float]:
        """Angle [rad] and velocity [rad/s] of a motor."""
        sign, offset = self._layout.sign[index], self._layout.offset_rad[index]
        return sign * (self.angles[index] - offset), sign * self.velocities[index]

    def _measured(self, index: int) -> Measured:
        """Sensor values of a servo, with noise."""
        current = self.currents[index] + self._random.gauss(0.0, self._noise)
        if index in self._stuck:
            return Measured(self._stuck[index], 0.0, current)
        return Measured(*self._place(index), current)

    def _step(self, time: float) -> None:
        currents = []
        for index, (servo, model) in enumerate(zip(self.servos, self._models, strict=True)):
            angle, velocity = self._place(index)
            currents.append(amperes(servo.drive, self._stuck.get(index, angle), velocity, model))
        self.currents = currents
        self.largest_current = max(self.largest_current, *currents, -min(currents))
        self.motor_nm = [
            sign * self._constant * model.constant * current
            for sign, model, current in zip(self._layout.sign, self._models, currents, strict=True)
        ]
        self._move(time)


class DynamixelJointsOptions(JointArmOptions):
    """Options of an arm whose joints do not act on each other."""

    HIGHEST_ID = HIGHEST_ID
    BAUD_RATES = BAUD_RATES

    gravity: bool = Field(default=False, description="the arm has the weight of its model")
    current_law: Literal["motor", "supply"] | None = Field(
        default=None, description="what the current registers mean; that of each motor if not given"
    )
    constant_ratio: float = Field(default=1.0, gt=0.1, lt=10.0, description="of the true torque constant to the stated")
    current_noise_ma: float = Field(
        default=3.0, ge=0.0, le=1000.0, description="standard deviation of the measured current of a motor"
    )
    seed: int = Field(default=0, description="of that noise")


class KochLeaderEmulatorOptions(DynamixelJointsOptions):
    """Options of the emulated Koch leader. Lists: shoulder_pan, ..., wrist_roll, gripper."""

    LAYOUT: ClassVar[ArmLayout] = KOCH_LEADER

    hand_n_m_rad: float = Field(default=1.0, ge=0.0, le=50.0, description="stiffness of the hand on each axis")
    hand_rad: tuple[float, ...] = Field(
        default=(0.4, 0.3, 0.4, 0.4, 0.4, 0.4), description="amplitudes of the hand's motion about the start"
    )


class OmxLeaderEmulatorOptions(KochLeaderEmulatorOptions):
    """Options of the emulated OMX leader. Lists: shoulder_pan, ..., wrist_roll, gripper."""

    LAYOUT: ClassVar[ArmLayout] = OMX_LEADER


class KochFollowerEmulatorOptions(DynamixelJointsOptions):
    """Options of the emulated Koch follower. Lists: shoulder_pan, ..., wrist_roll, gripper."""

    LAYOUT: ClassVar[ArmLayout] = KOCH_FOLLOWER


class DynamixelJoints(DynamixelArmEmulator):
    """An arm whose joints do not act on each other."""

    Options: ClassVar[type[DynamixelJointsOptions]]

    def __init__(self, options: DynamixelJointsOptions | None = None) -> None:
        options = self.Options() if options is None else options
        layout = options.LAYOUT
        self.joints = [
            Joint(
                options, axis, each.rotor_kg_m2 + LINK_KG_M2, each.coulomb_n_m, each.viscous_n_m_s, STOP_N_M_RAD,
                STOP_N_M_S, HAND_N_M_S,
            )
            for axis, each in enumerate(layout.motors)
        ]  # fmt: skip
        self._gravity = load(layout.name).gravity if options.gravity else None
        super().__init__(
            layout,
            options.bus_ids,
            baud=options.baud,
            noise_a=1e-3 * options.current_noise_ma,
            seed=options.seed,
            law=None if options.current_law is None else CurrentLaw(options.current_law),
            constant=options.constant_ratio,
        )

    @property
    def angles(self) -> list[float]:
        return [joint.angle for joint in self.joints]

    @property
    def velocities(self) -> list[float]:
        return [joint.velocity for joint in self.joints]

    @property
    def outside_nm(self) -> list[float]:
        """Torques of hand and walls on the axes [N m]."""
        return [joint.outside for joint in self.joints]

    def _move(self, time: float) -> None:
        weights = self._gravity(tuple(self.angles)) if self._gravity is not None else [0.0] * len(self.joints)
        for joint, torque, weight in zip(self.joints, self.motor_nm, weights, strict=True):
            joint.turn(torque - weight, time + self.STEP, self.STEP)


class KochLeaderEmulator(DynamixelJoints):
    """A Koch v1.1 leader in a person's hand."""

    Options = KochLeaderEmulatorOptions


class OmxLeaderEmulator(DynamixelJoints):
    """An OMX leader in a person's hand."""

    Options = OmxLeaderEmulatorOptions


class KochFollowerEmulator(DynamixelJoints):
    """A Koch v1.1 follower."""

    Options = KochFollowerEmulatorOptions
