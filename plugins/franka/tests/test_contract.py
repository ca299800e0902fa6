"""The robot keeps the contract, with a stand-in for the maker's library in its own process."""

import os
import signal
from collections.abc import Iterator

import pytest

from plugins.franka.tests.library import PROGRAM
from weberlink.testing.robots import HardwareRobotContract, RobotBench
from weberlink.testing.time import TICK, real_time
from weberlink_franka.driver import FrankaRobot
from weberlink_franka.options import FrankaOptions


@pytest.mark.realtime
class TestFranka(HardwareRobotContract):
    FAULTS = ("reflex", "cut", "killed", "stopped")

    @pytest.fixture
    def bench(self) -> Iterator[RobotBench]:
        floor = 0.40
        # Patient with a machine that stalls.
        options = FrankaOptions(
            host=f"arm,ground={floor}", approach_m_s=0.5, priority=0, lost_ms=2000.0, stale_ms=500.0
        )
        robot = FrankaRobot(options, None, TICK, PROGRAM)

        def to_controller(number: signal.Signals) -> None:
            assert robot.controller_pid is not None
            os.kill(robot.controller_pid, number)

        faults = {
            "reflex": lambda: to_controller(signal.SIGUSR1),
            "cut": lambda: to_controller(signal.SIGUSR2),
            "killed": lambda: to_controller(signal.SIGKILL),
            "stopped": lambda: to_controller(signal.SIGSTOP),
        }
        try:
            yield RobotBench(
                robot,
                real_time(),
                above=(0.5, 0.02, floor + 0.04),
                below=(0.5, 0.02, floor - 0.02),
                tolerance_m=0.005,
                faults=faults,
            )
        finally:
            robot.close()
