"""The emulated arm on a port in virtual time: what a cycle of control does to it, without a thread or a clock."""

from typing import Any

from plugins.arms.tests import benches
from weberlink.geometry.vector import Vector, distance
from weberlink_arms.cartesian.exchange import ArmExchange, ArmSample
from weberlink_arms.cartesian.options import DynamixelOptions
from weberlink_arms.dynamixel import registers
from weberlink_arms.emulators.open_manipulator import DynamixelEmulator, DynamixelEmulatorOptions
from weberlink_arms.interpolation import Interpolation


class Bench(benches.Bench):
    """An arm, and the exchange that drives it at its rate."""

    def __init__(
        self,
        options: DynamixelOptions | None = None,
        emulated: DynamixelEmulatorOptions | None = None,
        latency: float = 0.0,
    ) -> None:
        super().__init__(options or DynamixelOptions(), DynamixelEmulator(emulated), latency)
        clock, pause = self.time.clock, self.time.pause
        self.exchange: Any = ArmExchange(self.options, self._connect, Interpolation(0.006), clock, pause)

    def lead(self, goal: Vector, speed: float = 0.1) -> ArmSample:
        """Command a straight way there [m/s]; gives the last sample."""
        (sample,) = self.run(None, 1.0 / self.options.rate_hz)
        start = sample.tip
        count = max(1, round(distance(start, goal) / speed * self.options.rate_hz))
        for number in range(1, count + 1):
            x, y, z = (a + number / count * (b - a) for a, b in zip(start, goal, strict=True))
            (sample,) = self.run((x, y, z), 1.0 / self.options.rate_hz)
        return sample

    def register(self, name: str) -> list[int]:
        """Of joints 1 to 4."""
        return super().register(name)[:4]

    def write(self, joint: int, name: str, value: int) -> None:
        register = registers.BY_NAME[name]
        assert self.emulator.servos[joint - 1].write(register.address, register.encode(value)) == 0
