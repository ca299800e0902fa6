"""An emulated Haply 2DIY: the board as its firmware behaves, and the linkage between its motors and a hand."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite
from struct import Struct
from typing import ClassVar, Literal

from pydantic import BaseModel, Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.emulator import Emulator
from weberlink.master.devices.operator import CircleStep, ReachStep, RestStep, Script, SlideStep
from weberlink.options import Options
from weberlink_devices.handle import Handle, HandleOptions
from weberlink_devices.haply.board import Pair
from weberlink_devices.haply.linkage import MOST_TORQUE_N_M, VERSIONS, HaplyFrame, Unreachable, degrees, radians

PATIENCE_S = 1.0
"""Longest wait of the firmware for the rest of a message [s]."""
STEP_S = 0.001
PORTS = 4
ANALOG_PINS = range(54, 66)
PWM_PINS = range(14)

_FLOAT = Struct("<f")
_ENCODER = Struct("<2f")


AROUND: tuple[Script, ...] = (
    ReachStep(motion="reach", to_m=ZERO),
    CircleStep(motion="circle", center_m=ZERO, radius_m=0.025, depth_m=0.0),
    SlideStep(motion="slide", points_m=((0.025, -0.04, 0.0), (0.025, 0.04, 0.0)), depth_m=0.0, passes=2),
    RestStep(motion="rest", duration_s=0.5),
)
"""A script in the plane."""


class PlanarHandleOptions(HandleOptions):
    """Options of a hand in the plane, without effect along z; it begins at the device's starting place."""

    script: tuple[Script, ...] = Field(default=AROUND, min_length=1)
    home_m: Vector = Field(default=ZERO, description="where it rests at first; the starting place if not given")
    workspace_m: float = Field(default=0.08, gt=0.0, le=1.0, description="half an edge of the cube about the origin")


class HaplyEmulatorOptions(Options):
    """Options of the emulated `haply_2diy`."""

    version: Literal["v3", "v2", "pantograph"] = "v3"
    answer_ms: float = Field(default=0.2, ge=0.0, le=100.0, description="from a message to its answer")
    handle: PlanarHandleOptions = PlanarHandleOptions()


@dataclass
class _Counter:
    """An encoder: the true angle at the setup, and the count shown for it."""

    sign: int
    counts_per_turn: float
    count: int
    began_deg: float

    def angle_deg(self, true_deg: float) -> float:
        turned = self.sign * (true_deg - self.began_deg) * self.counts_per_turn / 360.0
        return 360.0 * (self.count + round(turned)) / self.counts_per_turn


@dataclass
class _Setup:
    """The setup of the board, with signs and counters by port."""

    id: int
    motors: dict[int, int]
    encoders: dict[int, _Counter]
    analogs: int
    pwms: int


class HaplyEmulator(Emulator):
    """The emulated board and linkage.

    The torque of a motor stays until another comes: not even a reset or a new setup takes it away, and there is no
    watchdog. The handle is at its starting place until the board has been set up.
    """

    Options: ClassVar[type[BaseModel]] = HaplyEmulatorOptions
    transport: ClassVar[str] = "serial"
    fault_values: Mapping[str, range | float] = {"stuck_encoder": range(3)}
    OWN_FAULTS: ClassVar[Mapping[str, str]] = {
        "stuck_encoder": "an encoder gives the same angle from now on; 1 or 2, 0 for neither",
        "slip": "a byte is lost from each of so many answers",
        "restart": "the board forgets its setup, motors off; any value",
    }

    def __init__(self, options: HaplyEmulatorOptions) -> None:
        super().__init__()
        self._version = VERSIONS[options.version]
        self._frame = HaplyFrame(self._version.center)
        self.handle = Handle(self._held(options.handle))
        self._angles: Pair = self._version.bar.angles(self._frame.tip(self.handle.position))
        self.torques: Pair = (0.0, 0.0)
        """Present torques of motors 1 and 2 [N m]."""
        self.most_torque = 0.0
        """Largest torque so far [N m]."""
        self.force: Vector = ZERO
        """Force on the hand [N]."""
        self.setups = 0
        """Number of setups."""
        self._answer = options.answer_ms * 1e-3
        self._setup: _Setup | None = None
        self._waiting = b""
        self._waiting_since = 0.0
        self._replies: deque[tuple[float, bytes]] = deque()
        self._moved_at = -inf
        self._stuck = 0
        self._stuck_deg: Pair = (0.0, 0.0)
        self._slips = 0

    def apply_fault(self, name: str, value: float) -> None:
        match name:
            case "stuck_encoder":
                self._stuck, self._stuck_deg = int(value), degrees(self._angles)
            case "slip":
                self._slips = int(value)
            case "restart":
                self._setup, self._waiting = None, b""
                self._turn((0.0, 0.0))

    def receive(self, data: bytes, now: float) -> None:
        if not self._waiting:
            self._waiting_since = now
        self._waiting += data
        while self._waiting and (length := self._length(self._waiting)) <= len(self._waiting):
            message, self._waiting = self._waiting[:length], self._waiting[length:]
            self._waiting_since = now
            self._take(message, now)

    def advance(self, now: float) -> None:
        super().advance(now)
        if self._waiting and now - self._waiting_since > PATIENCE_S:
            self._waiting = b""
        if now - self._moved_at >= STEP_S:
            self._moved_at = now
            if self.setups:
                self._follow(self.handle.advance(self.force, now))

    def replies(self, now: float) -> list[bytes]:
        due = []
        while self._replies and self._replies[0][0] <= now:
            due.append(self._slipped(self._replies.popleft()[1]))
        return due

    def next_timer(self) -> float | None:
        moves = self._moved_at + STEP_S
        return min(moves, self._replies[0][0]) if self._replies else moves

    def _length(self, message: bytes) -> int:
        """Length of the message that begins here [bytes]; one more than there are while it is unknown."""
        setup, more = self._setup, len(message) + 1
        if len(message) < 2:
            return more
        match message[0]:
            case 0:
                return 2
            case 1:
                sections, end = _sections(message)
                return end + _ENCODER.size * len(_ports(sections[1][0])) if len(sections) == 4 else more
            case 2 if setup is not None and setup.id == message[1]:
                return 2 + setup.pwms + 4 * len(setup.motors)
            case 2:
                return 2
            case _:
                return 1

    def _take(self, message: bytes, now: float) -> None:
        match message[0]:
            case 0:
                self._setup = None
            case 1:
                self._set_up(message)
            case 2:
                self._command(message)
                self._replies.append((now + self._answer, self._reply(message[1])))

    def _set_up(self, message: bytes) -> None:
        sections, at = _sections(message)
        (motor_bits, turns), (encoder_bits, spins), (_, analogs), (_, pwms) = sections
        motors, encoders = _ports(motor_bits), _ports(encoder_bits)
        board, true_deg = self._version.board, degrees(self._angles)
        wired = {each.port: each.direction for each in board.motors}
        counters = {}
        for port, spin, (offset, counts) in zip(encoders, spins, _ENCODER.iter_unpack(message[at:]), strict=True):
            for each, angle in zip(board.encoders, true_deg, strict=True):
                if each.port == port:
                    sign = 1 if each.direction == spin else -1
                    counters[port] = _Counter(sign, counts, int(offset * counts / 360.0), angle)
        self._setup = _Setup(
            message[1],
            {port: 1 if wired.get(port, turn) == turn else -1 for port, turn in zip(motors, turns, strict=True)},
            counters,
            sum(pin in ANALOG_PINS for pin in analogs),
            sum(pin in PWM_PINS for pin in pwms),
        )
        self.setups += 1

    def _command(self, message: bytes) -> None:
        setup = self._setup
        if setup is None or setup.id != message[1]:
            return
        values = _FLOAT.iter_unpack(message[2 + setup.pwms :])
        told = {port: sign * value for (port, sign), (value,) in zip(setup.motors.items(), values, strict=True)}
        first, second = (told.get(each.port, 0.0) for each in self._version.board.motors)
        self._turn((_limited(first), _limited(second)))

    def _reply(self, id_: int) -> bytes:
        setup = self._setup
        if setup is None or setup.id != id_:
            return bytes((id_,))
        true_deg = [
            self._stuck_deg[index] if self._stuck == index + 1 else angle
            for index, angle in enumerate(degrees(self._angles))
        ]
        by_port = {each.port: angle for each, angle in zip(self._version.board.encoders, true_deg, strict=True)}
        angles = [counter.angle_deg(by_port[port]) for port, counter in setup.encoders.items()]
        return bytes((id_,)) + b"".join(map(_FLOAT.pack, [0.0] * setup.analogs + angles))

    def _held(self, options: HandleOptions) -> HandleOptions:
        if "home_m" in options.model_fields_set:
            return options
        home = self._version.bar.tip(radians(self._version.board.home_deg))
        return options.model_copy(update={"home_m": self._frame.position(home)})

    def _slipped(self, reply: bytes) -> bytes:
        if self._slips <= 0:
            return reply
        self._slips -= 1
        middle = len(reply) // 2
        return reply[:middle] + reply[middle + 1 :]

    def _follow(self, position: Vector) -> None:
        """Move the arms to the hand, as far as they reach."""
        try:
            self._angles = self._version.bar.angles(self._frame.tip(position))
        except Unreachable:
            return
        self._turn(self.torques)

    def _turn(self, torques: Pair) -> None:
        self.torques = torques
        self.most_torque = max(self.most_torque, abs(torques[0]), abs(torques[1]))
        try:
            self.force = self._frame.force(self._version.bar.jacobian(self._angles).force(torques))
        except Unreachable:
            self.force = ZERO


def _sections(message: bytes) -> tuple[list[tuple[int, bytes]], int]:
    """Head and items of the sections of a setup (motors, encoders, analog inputs, PWM outputs), and where they end."""
    sections, at = [], 2
    for is_count in (False, False, True, True):
        if at >= len(message):
            break
        head = message[at]
        size = head if is_count else len(_ports(head))
        sections.append((head, message[at + 1 : at + 1 + size]))
        at += 1 + size
    return sections, at


def _ports(bits: int) -> list[int]:
    return [port for port in range(1, PORTS + 1) if bits >> (port - 1) & 1]


def _limited(torque: float) -> float:
    """The torque within the limits of the firmware; 0 if it is not finite."""
    return min(MOST_TORQUE_N_M, max(-MOST_TORQUE_N_M, torque)) if isfinite(torque) else 0.0
