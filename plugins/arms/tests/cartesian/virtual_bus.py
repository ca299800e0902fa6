"""The emulated arm on a port in virtual time: what a cycle of control does to it, without a thread or a clock."""

from dataclasses import dataclass, field

from plugins.arms.tests.virtual import VirtualPort, VirtualTime
from weberlink.arms.interpolation import Interpolation
from weberlink.geometry.vector import Vector
from weberlink_arms.cartesian import options as of
from weberlink_arms.cartesian.exchange import ArmExchange, ArmSample
from weberlink_arms.dynamixel import registers
from weberlink_arms.emulators.open_manipulator import DynamixelEmulator, DynamixelEmulatorOptions


@dataclass
class Bench:
    """An arm, and the exchange that drives it at its rate."""

    options: of.DynamixelOptions = field(default_factory=of.DynamixelOptions)
    emulated: DynamixelEmulatorOptions = field(default_factory=DynamixelEmulatorOptions)
    latency: float = 0.0

    def __post_init__(self) -> None:
        self.time = VirtualTime()
        self.emulator = DynamixelEmulator(self.emulated)
        self.emulator.advance(self.time.now)
        self.interpolation = Interpolation(0.006)
        self.port = self._connect()
        self.exchange = ArmExchange(self.options, self._connect, self.interpolation, self.time.clock, self.time.pause)

    def _connect(self) -> VirtualPort:
        self.port = VirtualPort(self.emulator, self.time, self.latency)
        return self.port

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

    def register(self, name: str) -> list[int]:
        """Of joints 1 to 4."""
        return [servo.registers[name] for servo in self.emulator.servos[:4]]

    def write(self, joint: int, name: str, value: int) -> None:
        register = registers.BY_NAME[name]
        assert self.emulator.servos[joint - 1].write(register.address, register.encode(value)) == 0
