"""The robot keeps the contract, before an emulated arm behind a real pseudo terminal."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from weberlink.hardware.emulator import PtyDevice
from weberlink.slave.robots import load
from weberlink.testing.robots import HardwareRobotContract, RobotBench
from weberlink.testing.time import TICK, real_time
from weberlink_arms.emulators.open_manipulator import DynamixelEmulator, DynamixelEmulatorOptions

GROUND = 500.0  # [N/m]


@pytest.mark.realtime
class TestDynamixel(HardwareRobotContract):
    FAULTS = ("unplug", "silent", "late", "garbled", "overload", "trip_watchdog", "dead", "restart")

    @pytest.fixture
    def bench(self, tmp_path: Path) -> Iterator[RobotBench]:
        floor = 0.10
        scene = [{"shape": "plane", "point_m": [0.0, 0.0, floor], "stiffness_n_m": GROUND}]
        emulator = DynamixelEmulator(DynamixelEmulatorOptions(scene=scene))
        with PtyDevice(emulator, tmp_path / "arm") as wire:
            driver = load("dynamixel")
            # Patient with a machine that stalls; what it does then is the business of its own tests.
            options = driver.Options(port=str(wire.path), bus_watchdog_ms=2000.0, timeout_ms=100.0, approach_m_s=0.2)
            robot = driver(options, None, TICK)
            faults = {
                "unplug": wire.unplug,
                "silent": lambda: setattr(emulator.faults, "silent", True),
                "late": lambda: setattr(emulator.faults, "late_s", 0.2),
                "garbled": lambda: setattr(emulator.faults, "garble", 1_000_000),
            } | {
                name: lambda name=name: emulator.inject(name, 1.0)
                for name in ("overload", "trip_watchdog", "dead", "restart")
            }  # fmt: skip
            try:
                yield RobotBench(
                    robot,
                    real_time(),
                    above=(0.20, 0.02, floor + 0.04),
                    below=(0.20, 0.02, floor - 0.02),
                    tolerance_m=0.012,
                    settle_ticks=500,
                    faults=faults,
                )
            finally:
                robot.close()
