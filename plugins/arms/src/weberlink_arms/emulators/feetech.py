"""Emulated SO-101 arms on their bus: six STS3215 servos, the joints they turn, a person's hand and a wall.

Half duplex without echo: one byte takes the time of ten bits, a request counts when its last byte has arrived, and each
answer begins a return delay after the previous frame. Requests with a wrong checksum are ignored. In a sync read each
servo waits for the answer of the one before it, so all behind a silent one are silent.

Joints do not act on each other: rotor inertia and dry friction of the STS3215 in TheRobotStudio's SO-101 model
(joints_properties.xml, whose damping includes the back EMF of the motor), and stops at the ends of their ranges. The
weight is that of `weberlink_mujoco.arms.models`.
"""

from collections import deque
from collections.abc import Mapping
from math import copysign, inf, pi, sin, sqrt
from typing import Annotated, ClassVar, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from weberlink.hardware.emulator import WireFaults
from weberlink_arms.emulators.feetech_servo import EmulatedServo
from weberlink_arms.feetech import packet
from weberlink_arms.feetech.arm import LOWER, NAMES, UPPER, Six
from weberlink_arms.feetech.packet import BROADCAST, OVERHEAD, Frame, FrameReader
from weberlink_arms.feetech.registers import CENTRE, COUNTS_PER_TURN, MODEL, RAD_PER_COUNT
from weberlink_mujoco.arms.models import load

STEP: Final = 0.001
GAP_STEPS: Final = 1000
"""Most steps per call; the rest of a longer silence is skipped."""
QUEUE: Final = 64
INERTIA_KG_M2: Final = 0.028
FRICTION_NM: Final = 0.052
VISCOUS_N_M_S: Final = 0.02
STOP_N_M_RAD: Final = 50.0
GRIPPER_MIDDLE: Final = 0.5 * UPPER[-1]
"""Of the emulated gripper, whose servo is in the middle of its turn there [rad]."""

Joint = Literal["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]


class Wall(BaseModel):
    """Something that a joint meets at an angle."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    joint: Joint
    angle_rad: float = Field(ge=-3.2, le=3.2, description="where it begins")
    stiffness_nm_rad: float = Field(default=20.0, gt=0.0, le=200.0)
    below: bool = Field(default=False, description="the wall lies at smaller angles")


class FeetechEmulatorOptions(BaseModel):
    """Options of an emulated SO-101. Tuples: shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll,
    gripper."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    ids: tuple[int, int, int, int, int, int] = Field(default=(1, 2, 3, 4, 5, 6), description="of the servos")
    baud: int = Field(default=1_000_000, gt=0, description="rate of the bus [bit/s]")
    calibrated: bool = Field(default=True, description="ranges are set, as by LeRobot's calibration")
    supply_v: float = Field(default=7.4, ge=3.0, le=16.0)
    rated_v: float = Field(default=7.4, ge=4.0, le=14.0, description="of the servos")
    stall_nm: Six = Field(default=(1.91,) * 6, description="stall torques at rated_v")
    start_rad: Six = Field(default=(0.0, 0.0, 0.0, 0.0, 0.0, GRIPPER_MIDDLE), description="angles when power comes on")
    friction_nm: Annotated[float, Field(ge=0.0, le=5.0)] = Field(default=FRICTION_NM, description="dry, of each joint")
    hand_n_m_rad: float = Field(default=0.0, ge=0.0, le=50.0, description="stiffness of the hand on each joint")
    hand_rad: Six = Field(default=(0.0,) * 6, description="amplitudes of the hand's motion about the start")
    hand_s: Six = Field(default=(4.0, 5.0, 6.0, 7.0, 8.0, 3.0), description="periods of it")
    weight: bool = Field(
        default=False, description="the arm has weight, and a person holds it until all torque is on; needs mujoco"
    )
    walls: tuple[Wall, ...] = Field(default=(), description="what the joints meet")


class FeetechEmulator:
    """Sans-I/O: bytes and `now` go in, messages come out. See `weberlink.hardware.emulator`."""

    Options: ClassVar[type[BaseModel]] = FeetechEmulatorOptions
    transport: ClassVar[str] = "serial"
    OWN_FAULTS: ClassVar[Mapping[str, str]] = {
        "overload": "a servo reports overload and pushes with its protective torque; 1 to 6",
        "dead": "a servo does not receive or answer, its motor keeps its order; 1 to 6, 0 for none",
        "supply": "volts of the supply from now on; 7.4 as it was",
        "wrong_model": "every servo reports this model number; 0: its own",
        "restart": "power cycle, which also ends `dead`; any value",
        "push": "torque of a person on shoulder_lift from now on, in N m",
    }

    def __init__(self, options: FeetechEmulatorOptions | None = None) -> None:
        self._options = options = FeetechEmulatorOptions() if options is None else options
        self.faults = WireFaults()
        self.servos = [self._servo(axis, id_) for axis, id_ in enumerate(options.ids)]
        self._byte_s = 10.0 / options.baud
        self._reader = FrameReader()
        self._quiet_from = 0.0
        self._requests: deque[tuple[float, Frame]] = deque(maxlen=QUEUE)
        self._replies: deque[tuple[float, bytes]] = deque(maxlen=QUEUE)
        self._injected: deque[tuple[str, float]] = deque()
        self._steps: int | None = None
        self._gravity = load("so101").gravity if options.weight else None
        self.held = options.weight
        """Whether a person still holds the arm against its weight."""
        self._began = 0
        self.dead = 0
        """Number of the servo that neither hears nor answers; 0 for none."""
        self.packets = 0
        """Requests carried out."""
        self.pushes = [0.0] * 6
        """Torques of a person beside the hand [N m]."""
        self.motor_nm = [0.0] * 6
        """Torques of the motors [N m]."""
        self.outside_nm = [0.0] * 6
        """Torques of hand, person and walls on the joints [N m]."""
        self.most_motor_nm = 0.0
        """Largest torque of a motor since the start [N m]."""

    @property
    def angles(self) -> list[float]:
        """Of all axes, the gripper's 0 where it is closed [rad]."""
        return [servo.angle + _middle(axis) for axis, servo in enumerate(self.servos)]

    @property
    def torques_on(self) -> list[bool]:
        return [servo.torque_on for servo in self.servos]

    @property
    def bad_checksums(self) -> int:
        return self._reader.bad_checksums

    def receive(self, data: bytes, now: float) -> None:
        self.advance(now)
        begin = max(now, self._quiet_from)
        self._quiet_from = begin + len(data) * self._byte_s
        at = begin
        for frame in self._reader.feed(data):
            at = min(self._quiet_from, at + (OVERHEAD + len(frame.parameters)) * self._byte_s)
            self._requests.append((at, frame))

    def advance(self, now: float) -> None:
        if self._steps is None:
            self._steps = self._began = int(now / STEP)
        while self._injected:
            self._suffer(*self._injected.popleft())
        while self._requests and self._requests[0][0] <= now:
            due, request = self._requests.popleft()
            self._move_to(due)
            self._perform(request)
        self._move_to(now)

    def replies(self, now: float) -> list[bytes]:
        left = []
        while self._replies and self._replies[0][0] <= now:
            left.append(self._replies.popleft()[1])
        return left

    def next_timer(self) -> float | None:
        soonest = min(each[0][0] if each else inf for each in (self._requests, self._replies))
        return soonest if soonest < inf else None

    def inject(self, name: str, value: float) -> None:
        """Cause one of its own faults at the next `advance`; callable from any thread.

        Raises:
            ValueError: unknown fault or value.
        """
        if name not in self.OWN_FAULTS:
            raise ValueError(f"no fault is called {name!r}; there are {', '.join(self.OWN_FAULTS)}")
        least = {"overload": 1, "dead": 0}.get(name)
        if least is not None and value not in range(least, 7):
            raise ValueError(f"{name}: expected a servo from {least} to 6, got {value:g}")
        self._injected.append((name, value))

    def _suffer(self, name: str, value: float) -> None:
        match name:
            case "overload":
                self.servos[int(value) - 1].overload()
            case "dead":
                self.dead = int(value)
            case "supply":
                for servo in self.servos:
                    servo.supply = value
            case "wrong_model":
                for servo in self.servos:
                    servo["model"] = int(value) or MODEL
            case "push":
                self.pushes[1] = value
            case _:
                self.dead = 0
                self._requests.clear()
                self._replies.clear()
                for servo in self.servos:
                    servo.restart()

    def _servo(self, axis: int, id_: int) -> EmulatedServo:
        options = self._options
        least, largest = 0, COUNTS_PER_TURN - 1
        if options.calibrated:
            least = CENTRE + round((LOWER[axis] - _middle(axis)) / RAD_PER_COUNT)
            largest = CENTRE + round((UPPER[axis] - _middle(axis)) / RAD_PER_COUNT)
        servo = EmulatedServo(id_, least, largest, options.supply_v, options.stall_nm[axis], options.rated_v)
        servo.angle = options.start_rad[axis] - _middle(axis)
        servo.restart()
        return servo

    def _hearing(self) -> list[EmulatedServo]:
        return [servo for number, servo in enumerate(self.servos, start=1) if number != self.dead]

    def _perform(self, request: Frame) -> None:
        self.packets += 1
        self._obey(request)
        self.held = self.held and not all(self.torques_on)

    def _obey(self, request: Frame) -> None:
        hearing = self._hearing()
        if request.code == packet.SYNC_WRITE and request.id == BROADCAST:
            self._sync_write(request.parameters, hearing)
        elif request.code == packet.SYNC_READ and request.id == BROADCAST:
            self._sync_read(request.parameters, hearing)
        else:
            for servo in hearing:
                if request.id == servo.id or (request.id == BROADCAST and request.code in (packet.PING, packet.WRITE)):
                    answer = servo.answer(request)
                    if request.id == servo.id or request.code == packet.PING:
                        self._say(servo, answer)

    def _sync_read(self, parameters: bytes, hearing: list[EmulatedServo]) -> None:
        by_id = {servo.id: servo for servo in hearing}
        for id_ in parameters[2:]:
            if (servo := by_id.get(id_)) is None:
                return
            self._say(servo, Frame(id_, servo.error, servo.read(parameters[0], parameters[1])))

    def _sync_write(self, parameters: bytes, hearing: list[EmulatedServo]) -> None:
        if len(parameters) < 3 or not parameters[1]:
            return
        address, size = parameters[0], parameters[1]
        for servo in hearing:
            for at in range(2, len(parameters) - size, size + 1):
                if parameters[at] == servo.id:
                    servo.write(address, parameters[at + 1 : at + 1 + size])

    def _say(self, servo: EmulatedServo, answer: Frame | None) -> None:
        if answer is None:
            return
        data = packet.encode(answer)
        self._quiet_from += servo.return_delay + len(data) * self._byte_s
        self._replies.append((self._quiet_from, data))

    def _move_to(self, now: float) -> None:
        """Advance the mechanics to a time, on the grid of steps."""
        assert self._steps is not None
        end = int(now / STEP)
        begin = max(self._steps, end - GAP_STEPS)
        self._steps = max(end, self._steps)
        for number in range(begin, end):
            weights = self._weights()
            for axis, servo in enumerate(self.servos):
                self._step(axis, servo, weights[axis], (number - self._began) * STEP)

    def _weights(self) -> tuple[float, ...]:
        """Torques of the weight on the joints [N m]."""
        if self._gravity is None or self.held:
            return (0.0,) * len(self.servos)
        return tuple([-torque for torque in self._gravity(tuple(self.angles))])

    def _step(self, axis: int, servo: EmulatedServo, weight: float, time: float) -> None:
        motor = self.motor_nm[axis] = servo.torque(STEP)
        outside = self.outside_nm[axis] = self.pushes[axis] + self._hand(axis, servo, time) + self._wall(axis, servo)
        self.most_motor_nm = max(self.most_motor_nm, abs(motor))
        speed = servo.speed + (motor + outside + weight) * STEP / INERTIA_KG_M2
        rub = (self._options.friction_nm + VISCOUS_N_M_S * abs(speed)) * STEP / INERTIA_KG_M2
        servo.speed = copysign(max(0.0, abs(speed) - rub), speed)
        servo.angle += servo.speed * STEP

    def _hand(self, axis: int, servo: EmulatedServo, time: float) -> float:
        options = self._options
        stiffness = options.hand_n_m_rad
        if not stiffness:
            return 0.0
        phase = 2.0 * pi / options.hand_s[axis]
        place = options.start_rad[axis] - _middle(axis) + options.hand_rad[axis] * sin(phase * time)
        return stiffness * (place - servo.angle) - 2.0 * sqrt(stiffness * INERTIA_KG_M2) * servo.speed

    def _wall(self, axis: int, servo: EmulatedServo) -> float:
        place = servo.angle + _middle(axis)
        torque = STOP_N_M_RAD * (max(0.0, LOWER[axis] - place) - max(0.0, place - UPPER[axis]))
        for wall in self._options.walls:
            if wall.joint == NAMES[axis]:
                depth = place - wall.angle_rad
                depth = min(depth, 0.0) if wall.below else max(depth, 0.0)
                torque -= wall.stiffness_nm_rad * depth
        return torque


def _middle(axis: int) -> float:
    """Angle of an axis where its servo is in the middle of its turn [rad]."""
    return GRIPPER_MIDDLE if NAMES[axis] == "gripper" else 0.0


class So101LeaderEmulatorOptions(FeetechEmulatorOptions):
    """Options of an emulated leader: a person moves it."""

    stall_nm: Six = Field(default=(2.16, 1.91, 2.16, 1.37, 1.37, 1.37), description="stall torques at rated_v")
    hand_n_m_rad: float = Field(default=5.0, ge=0.0, le=50.0, description="stiffness of the hand on each joint")
    hand_rad: Six = Field(default=(0.4, 0.3, 0.3, 0.3, 0.4, 0.5), description="amplitudes of the hand's motion")


class So101LeaderEmulator(FeetechEmulator):
    """An emulated SO-101 leader arm with a hand on it."""

    Options: ClassVar[type[BaseModel]] = So101LeaderEmulatorOptions


class So101FollowerEmulatorOptions(FeetechEmulatorOptions):
    """Options of an emulated follower: it has weight, as its driver expects."""

    weight: bool = Field(default=True, description="the arm has weight, and a person holds it until all torque is on")


class So101FollowerEmulator(FeetechEmulator):
    """An emulated SO-101 follower arm."""

    Options: ClassVar[type[BaseModel]] = So101FollowerEmulatorOptions
