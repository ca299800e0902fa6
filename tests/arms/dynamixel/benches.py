"""Emulated arms on a port in virtual time, and the exchange that drives them at the rate of their bus."""

from collections.abc import Callable
from typing import Any

from tests.slave.robots.dynamixel.virtual_bus import VirtualPort, VirtualTime
from weberlink.arms.dynamixel.arm_exchange import ArmExchange, Gravity, TorqueExchange, no_gravity
from weberlink.arms.emulators.dynamixel.arm import ArmEmulator
from weberlink.arms.threaded_arm import ArmSample
from weberlink.master.devices.dynamixel_leader import DynamixelLeaderOptions
from weberlink.slave.robots.dynamixel_follower import DynamixelFollowerOptions, position_exchange


class ArmBench:
    """An arm, its exchange and their time.

    Args:
        emulator: Of the arm.
        drive: The exchange on a port that it opens.
        rate: Of the bus [Hz].
    """

    def __init__(
        self, emulator: ArmEmulator, drive: Callable[[Callable[[], VirtualPort]], ArmExchange[Any]], rate: float
    ) -> None:
        self.time = VirtualTime()
        self.emulator = emulator
        self.emulator.advance(self.time.now)
        self.port = VirtualPort(emulator, self.time)  # type: ignore[arg-type]
        self.exchange = drive(lambda: self.port)
        self.exchange._clock, self.exchange._pause = self.time.clock, self.time.pause
        self._period = 1.0 / rate

    def run(self, command: Callable[[ArmSample], Any], sample: ArmSample, seconds: float) -> list[ArmSample]:
        """Cycles at the rate of the bus; each command is made from the sample before."""
        samples, due = [sample], self.time.now
        for _ in range(round(seconds / self._period)):
            due = max(due + self._period, self.time.now)
            self.time.now = due
            samples.append(self.exchange.exchange(command(samples[-1])))
        return samples

    def wait(self, seconds: float) -> None:
        """Time passes, and nobody does anything."""
        self.time.now += seconds
        self.emulator.advance(self.time.now)


def leader_bench(emulator: ArmEmulator, options: DynamixelLeaderOptions, gravity: Gravity = no_gravity) -> ArmBench:
    return ArmBench(
        emulator,
        lambda connect: TorqueExchange(options, connect, 1e-3 * options.max_current_ma, gravity),
        options.rate_hz,
    )


def follower_bench(emulator: ArmEmulator, options: DynamixelFollowerOptions, gravity: Gravity = no_gravity) -> ArmBench:
    return ArmBench(emulator, lambda connect: position_exchange(options, connect, gravity), options.rate_hz)
