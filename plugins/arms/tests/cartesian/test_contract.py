"""The robot keeps the contract before an emulated arm, in virtual time."""

from collections.abc import Iterator

import pytest

from plugins.arms.tests.benches import Stepped
from weberlink.slave.robots import ROBOTS
from weberlink.testing.robots import HardwareRobotContract, RobotBench
from weberlink.testing.time import TICK
from weberlink_arms.emulators.open_manipulator import DynamixelEmulator, DynamixelEmulatorOptions

FLOOR_M = 0.10


class TestDynamixel(HardwareRobotContract):
    FAULTS = ("unplug", "silent", "late", "garbled", "overload", "trip_watchdog", "dead", "restart")

    @pytest.fixture
    def bench(self) -> Iterator[RobotBench]:
        floor = {"shape": "plane", "point_m": [0.0, 0.0, FLOOR_M], "stiffness_n_m": 500.0}
        driver = ROBOTS.load("dynamixel")
        robot = driver(driver.Options(approach_m_s=0.2), None, TICK)
        stepped = Stepped(robot, DynamixelEmulator(DynamixelEmulatorOptions.model_validate({"scene": [floor]})))
        yield RobotBench(
            robot,
            stepped.tick,
            above=(0.20, 0.02, FLOOR_M + 0.04),
            below=(0.20, 0.02, FLOOR_M - 0.02),
            tolerance_m=0.012,
            settle_ticks=500,
            faults=stepped.faults,
        )
