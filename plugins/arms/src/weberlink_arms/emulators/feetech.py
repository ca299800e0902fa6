"""Emulated SO-101 arms on their bus: six STS3215 servos, the joints they turn, a person's hand and walls.

Joints do not act on each other: rotor inertia and dry friction of the STS3215 in TheRobotStudio's SO-101 model
(joints_properties.xml, whose damping includes the back EMF of the motor), and stops at the ends of their ranges. The
weight is that of the model of the arm.
"""

from math import sqrt
from typing import Annotated, ClassVar, Final

from pydantic import Field

from weberlink_arms.emulators.arm import ArmEmulator, Joint, JointArmOptions
from weberlink_arms.emulators.feetech_servo import EmulatedServo
from weberlink_arms.feetech.arm import SO101, Six
from weberlink_arms.feetech.packet import FRAMING, HIGHEST_ID
from weberlink_arms.feetech.registers import BAUD_RATES
from weberlink_arms.servo.layout import CENTRE, COUNTS_PER_TURN, RAD_PER_COUNT
from weberlink_mujoco.arms.models import load

INERTIA_KG_M2: Final = 0.028
FRICTION_NM: Final = 0.052
VISCOUS_N_M_S: Final = 0.02
STOP_N_M_RAD: Final = 50.0
# Angles of the emulated axes where their servos are in the middle of their turns [rad].
MIDDLES: Final = (0.0,) * 5 + (0.5 * SO101.upper[-1],)


class FeetechEmulatorOptions(JointArmOptions):
    """Options of an emulated SO-101. Tuples: shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll,
    gripper."""

    LAYOUT = SO101
    HIGHEST_ID = HIGHEST_ID
    BAUD_RATES = BAUD_RATES

    calibrated: bool = Field(default=True, description="ranges are set, as by LeRobot's calibration")
    supply_v: float = Field(default=7.4, ge=3.0, le=16.0)
    rated_v: float = Field(default=7.4, ge=4.0, le=14.0, description="of the servos")
    stall_nm: Six = Field(default=(1.91,) * 6, description="stall torques at rated_v")
    friction_nm: Annotated[float, Field(ge=0.0, le=5.0)] = Field(default=FRICTION_NM, description="dry, of each joint")
    weight: bool = Field(default=False, description="the arm has weight, and a person holds it until all torque is on")


class FeetechEmulator(ArmEmulator):
    """An emulated SO-101."""

    Options: ClassVar[type[FeetechEmulatorOptions]] = FeetechEmulatorOptions
    STEP = 0.001
    OWN_FAULTS: ClassVar = {
        "overload": "a servo reports overload and pushes with its protective torque; 1 to 6",
        "dead": "a servo does not receive or answer, its motor keeps its order; 1 to 6, 0 for none",
        "supply": "volts of the supply from now on; 7.4 as it was",
        "wrong_model": "every servo reports this model number; 0: its own",
        "restart": "power cycle, which also ends `dead`; any value",
        "push": "torque of a person on shoulder_lift from now on, in N m",
    }
    NUMBERED: ClassVar = {"overload": 1, "dead": 0}

    def __init__(self, options: FeetechEmulatorOptions | None = None) -> None:
        options = self.Options() if options is None else options
        damper = 2.0 * sqrt(options.hand_n_m_rad * INERTIA_KG_M2)
        body = (INERTIA_KG_M2, options.friction_nm, VISCOUS_N_M_S, STOP_N_M_RAD, 0.0, damper)
        self.joints = [Joint(options, axis, *body) for axis in range(len(SO101.axes))]
        super().__init__(FRAMING, [self._servo(options, *each) for each in enumerate(options.bus_ids)], options.baud)
        self._gravity = load(SO101.name).gravity if options.weight else None
        self.held = options.weight  # a person still holds the arm against its weight
        self.most_motor_nm = 0.0  # largest torque of a motor since the start [N m]

    @property
    def angles(self) -> list[float]:
        """Of all axes, the gripper's 0 where it is closed [rad]."""
        return [joint.angle for joint in self.joints]

    @property
    def torques_on(self) -> list[bool]:
        return [servo.torque_on for servo in self.servos]

    @property
    def outside_nm(self) -> list[float]:
        """Torques of hand, person and walls on the joints [N m]."""
        return [joint.outside for joint in self.joints]

    def _servo(self, options: FeetechEmulatorOptions, axis: int, id_: int) -> EmulatedServo:
        least, largest = 0, COUNTS_PER_TURN - 1
        if options.calibrated:
            least, largest = (
                CENTRE + round((end - MIDDLES[axis]) / RAD_PER_COUNT) for end in (SO101.lower[axis], SO101.upper[axis])
            )
        servo = EmulatedServo(id_, least, largest, options.supply_v, options.stall_nm[axis], options.rated_v)
        servo.angle = options.start[axis] - MIDDLES[axis]
        servo.restart(0.0)
        return servo

    def _performed(self) -> None:
        self.held = self.held and not all(self.torques_on)

    def _fail(self, name: str, value: float) -> None:
        match name:
            case "overload":
                self.servos[int(value) - 1].overload()
            case "push":
                self.joints[1].push = value
            case "supply":
                for servo in self.servos:
                    servo.supply = value

    def _step(self, time: float) -> None:
        weights = [0.0] * 6 if self._gravity is None or self.held else self._gravity(tuple(self.angles))
        for axis, (servo, joint) in enumerate(zip(self.servos, self.joints, strict=True)):
            motor = self.motor_nm[axis] = servo.torque(self.STEP)
            self.most_motor_nm = max(self.most_motor_nm, abs(motor))
            joint.turn(motor - weights[axis], time, self.STEP)
            servo.angle, servo.speed = joint.angle - MIDDLES[axis], joint.velocity


class So101LeaderEmulatorOptions(FeetechEmulatorOptions):
    """Options of an emulated leader: a person moves it."""

    stall_nm: Six = Field(default=(2.16, 1.91, 2.16, 1.37, 1.37, 1.37), description="stall torques at rated_v")
    hand_n_m_rad: float = Field(default=5.0, ge=0.0, le=50.0, description="stiffness of the hand on each axis")
    hand_rad: tuple[float, ...] = Field(
        default=(0.4, 0.3, 0.3, 0.3, 0.4, 0.5), description="amplitudes of the hand's motion about the start"
    )


class So101LeaderEmulator(FeetechEmulator):
    """An emulated SO-101 leader arm with a hand on it."""

    Options = So101LeaderEmulatorOptions


class So101FollowerEmulatorOptions(FeetechEmulatorOptions):
    """Options of an emulated follower: it has weight, as its driver expects."""

    weight: bool = Field(default=True, description="the arm has weight, and a person holds it until all torque is on")


class So101FollowerEmulator(FeetechEmulator):
    """An emulated SO-101 follower arm."""

    Options = So101FollowerEmulatorOptions
