"""The emulated arm on a port in virtual time: what a cycle of control does to it, without a thread or a clock."""

from dataclasses import dataclass, field

from weberlink.arms.dynamixel import packet, registers
from weberlink.arms.dynamixel.packet import (
    Packet,
    PacketReader,
    StatusPacket,
    StatusPacketReader,
    encode_packet,
)
from weberlink.arms.dynamixel.registers import Register
from weberlink.arms.interpolation import Interpolation
from weberlink.geometry.vector import Vector
from weberlink.slave.emulators.dynamixel import DynamixelEmulator, DynamixelEmulatorOptions
from weberlink.slave.robots.dynamixel import options as of
from weberlink.slave.robots.dynamixel.exchange import ArmExchange, ArmSample


class VirtualTime:
    def __init__(self) -> None:
        self.now = 100.0

        self.stall_s = 0.0
        """How much longer than asked for the next pause lasts [s]."""

    def clock(self) -> float:
        return self.now

    def pause(self, time: float) -> None:
        self.now += time + self.stall_s
        self.stall_s = 0.0


class KilledError(BaseException):
    """The host ends here: nothing that comes after this is sent."""


class VirtualPort:
    """As `hardware.serial_port.SerialPort`, with the emulator at its other end; `faults` are those of the emulator.

    Args:
        emulator: the arm.
        time: passes while something is awaited.
        latency: of the adapter [s].
    """

    path = "/dev/virtual"

    def __init__(self, emulator: DynamixelEmulator, time: VirtualTime, latency: float = 0.0) -> None:
        self._emulator = emulator
        self._time = time
        self.latency = latency
        self._reader = PacketReader()
        self.closed = False
        self.killed_after: int | None = None
        """Instructions that still get out before the host is gone; None for all."""
        self.sent: list[Packet] = []
        """All instructions."""

    def write(self, data: bytes) -> None:
        assert not self.closed
        if self.killed_after is not None:
            if self.killed_after == 0:
                raise KilledError
            self.killed_after -= 1
        self.sent += self._reader.feed(data)
        self._emulator.receive(data, self._time.now)

    def read(self, until: float) -> bytes:
        assert not self.closed
        while True:
            said = self.drain()
            if said or self._time.now >= until:
                return said
            due = self._emulator.next_timer()
            self._time.now = min(until, max(self._time.now + 1e-6, due + self.latency if due is not None else until))

    def drain(self) -> bytes:
        emulator, faults = self._emulator, self._emulator.faults
        emulator.advance(self._time.now)
        replies = emulator.replies(self._time.now - self.latency)
        if faults.silent:
            return b""
        if faults.garble and replies:
            faults.garble -= 1
            replies[0] = replies[0][:-1] + bytes([replies[0][-1] ^ 0x55])
        return b"".join(replies)

    def close(self) -> None:
        self.closed = True


@dataclass
class Bench:
    """An arm, and the exchange that drives it at its rate.

    Args:
        options: of the robot.
        emulated: of the emulator.
        latency: of the adapter [s].
    """

    options: of.DynamixelOptions = field(default_factory=of.DynamixelOptions)
    emulated: DynamixelEmulatorOptions = field(default_factory=DynamixelEmulatorOptions)
    latency: float = 0.0

    def __post_init__(self) -> None:
        self.time = VirtualTime()
        self.emulator = DynamixelEmulator(self.emulated)
        self.emulator.advance(self.time.now)
        self.interpolation = Interpolation(0.006)
        self.port = self._connect()
        self.exchange = self._driving()

    def _driving(self) -> ArmExchange:
        return ArmExchange(self.options, self._connect, self.interpolation, self.time.clock, self.time.pause)

    def _connect(self) -> VirtualPort:
        self.port = VirtualPort(self.emulator, self.time, self.latency)
        return self.port

    def start_anew(self) -> None:
        """As after a host that was killed: nothing was left tidy."""
        self.exchange = self._driving()

    def run(self, command: Vector | None, seconds: float) -> list[ArmSample]:
        """Cycles at the rate of the bus."""
        period = 1.0 / self.options.rate_hz
        samples = []
        due = self.time.now
        for _ in range(round(seconds * self.options.rate_hz)):
            due = max(due + period, self.time.now)
            self.time.now = due
            samples.append(self.exchange.exchange(command))
        return samples

    def lead(self, goal: Vector, speed: float = 0.1) -> ArmSample:
        """Command a straight way there [m/s]; gives the last sample."""
        sample = self.run(None, 1.0 / self.options.rate_hz)[0]
        start = sample.tip
        way = sum((b - a) ** 2 for a, b in zip(start, goal, strict=True)) ** 0.5
        count = max(1, round(way / speed * self.options.rate_hz))
        for number in range(1, count + 1):
            x, y, z = (a + number / count * (b - a) for a, b in zip(start, goal, strict=True))
            (sample,) = self.run((x, y, z), 1.0 / self.options.rate_hz)
        return sample

    def wait(self, seconds: float) -> None:
        """Time passes, and nobody does anything."""
        self.time.now += seconds
        self.emulator.advance(self.time.now)

    def tell(self, request: Packet) -> list[StatusPacket]:
        """Somebody else on the bus says something; gives what is answered."""
        self.emulator.receive(encode_packet(request), self.time.now)
        self.wait(0.01)
        return StatusPacketReader().feed(b"".join(self.emulator.replies(self.time.now)))

    def read(self, joint: int, register: Register) -> int:
        """Joint 5 is the gripper."""
        (status,) = self.tell(packet.read(self.emulated.ids[joint - 1], register.address, register.size))
        return register.decode(status.parameters)

    def write(self, joint: int, register: Register, value: int) -> None:
        (status,) = self.tell(packet.write(self.emulated.ids[joint - 1], register.address, register.encode(value)))
        assert status.error == 0

    def torque(self) -> list[int]:
        """Whether it is on, for joints 1 to 4."""
        return [self.read(joint, registers.TORQUE_ENABLE) for joint in range(1, 5)]
