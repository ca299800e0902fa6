"""The kernel's robots keep the contract; a driver of hardware before an emulated arm behind a real pseudo terminal."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from weberlink.geometry.vector import ZERO
from weberlink.hardware.emulator import PtyDevice
from weberlink.slave.emulators.dynamixel import DynamixelEmulator, DynamixelEmulatorOptions
from weberlink.slave.robots import BUILT_IN, load
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import PlaneShape
from weberlink.testing.robots import HardwareRobotContract, RobotBench, RobotContract
from weberlink.testing.time import TICK, real_time, virtual_time

GROUND = 500.0  # [N/m]
COMPUTED = ("point", "simulated")


def test_every_built_in_driver_is_tried() -> None:
    assert {*COMPUTED, "dynamixel"} == set(BUILT_IN)


class TestComputedRobots(RobotContract):
    @pytest.fixture(params=COMPUTED)
    def bench(self, request: pytest.FixtureRequest) -> Iterator[RobotBench]:
        ground = Scene([SceneObject(PlaneShape(ZERO, (0.0, 0.0, 1.0)), GROUND)])
        driver = load(request.param)
        robot = driver(driver.Options(), ground, TICK)
        yield RobotBench(robot, virtual_time(), (0.01, -0.01, 0.02), (0.01, -0.01, -0.01))


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
