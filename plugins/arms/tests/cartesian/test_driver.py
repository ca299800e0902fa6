"""The robot on an emulated arm behind a pseudo terminal, in real time: what only its thread and its port show.

What all robots do is in the contract, and the cycle of the bus in virtual time.
"""

from collections.abc import Callable, Iterator
from math import isfinite
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest
from pydantic import ValidationError

from tests.wait import until
from weberlink.geometry.vector import Vector, distance
from weberlink.slave.robots.contract import RobotFault, RobotReading
from weberlink.testing.serving import PtyDevice
from weberlink_arms.cartesian.driver import DynamixelRobot
from weberlink_arms.cartesian.options import DynamixelOptions
from weberlink_arms.emulators.open_manipulator import DynamixelEmulator

TICK = 0.001
GOAL: Vector = (0.19, 0.02, 0.18)


@pytest.fixture
def wire(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(DynamixelEmulator(), tmp_path / "arm") as wire:
        yield wire


def opened(wire: PtyDevice, **options: Any) -> DynamixelRobot:
    """That takes a machine which pauses for an arm which does not."""
    options = {"timeout_ms": 100.0, "bus_watchdog_ms": 2000.0, "approach_m_s": 0.5} | options
    robot = DynamixelRobot(DynamixelOptions(port=str(wire.path), **options), None, TICK)
    robot.open(monotonic())
    return robot


def led(robot: DynamixelRobot, done: Callable[[RobotReading], bool]) -> RobotReading:
    """To the goal."""

    def reading() -> RobotReading | None:
        now = monotonic()
        robot.command(GOAL, now)
        latest = robot.latest(now)
        return latest if done(latest) else None

    return until(reading, "the arm", pause=TICK)  # type: ignore[return-value]


def is_there(reading: RobotReading) -> bool:
    return distance(reading.position, GOAL) < 0.008


def torque(wire: PtyDevice) -> list[bool]:
    """Whether it is on, for joints 1 to 4."""
    emulator: Any = wire.emulator
    return [servo.torque_on for servo in emulator.servos[:4]]


def test_the_spec_states_lag_and_uncertainty() -> None:
    spec = DynamixelRobot(DynamixelOptions(torque_constant_error=0.05, bus_watchdog_ms=90.0), None, TICK).spec
    assert spec.lag_s == pytest.approx(0.004 + 0.001 + 10e-6 * (18 + 84))
    assert (spec.force_error, spec.rate_hz, spec.watchdog_s) == ((4.0, 0.05), 250.0, pytest.approx(0.1))


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"baud": 57_600}, "baud: expected more: .* takes 23.2 ms, and the arm needs 200 Hz"),
        ({"stiffness_n_m": 439.0}, "stiffness_n_m: expected 438 or less"),
        ({"damping_rate_s": 14.0}, "damping_rate_s: expected 13.9 or less at 250 Hz with rotor_inertia_kg_m2 0.045"),
        ({"workspace_m": ((0.2, -0.1, 0.1), (0.1, 0.1, 0.2))}, "workspace_m: expected a lower and a higher corner"),
        ({"workspace_m": ((0.12, -0.1, 0.1), (0.4, 0.1, 0.2))}, "workspace_m: expected corners that the arm reaches"),
        ({"home_m": (0.3, 0.0, 0.1)}, "home_m: expected a point within the workspace"),
    ],
)
def test_impossible_options_are_refused(options: dict[str, Any], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        DynamixelOptions(**options)


@pytest.mark.realtime
@pytest.mark.parametrize(
    ("case", "holds"), [("home", [False] * 4), ("fails", [True, True, True, False]), ("stays", [True] * 4)]
)
def test_it_goes_home_before_it_goes_limp(wire: PtyDevice, case: str, holds: list[bool]) -> None:
    """Where it does not get home, or after an emergency stop, it holds."""
    robot = opened(wire, on_close="rest", home_m=(0.15, 0.0, 0.2))
    if case == "fails":
        wire.emulator.inject("overload", 4)
    elif case == "stays":
        robot.stay()
    robot.close()
    assert torque(wire) == holds


@pytest.mark.realtime
def test_reconnected_arm_resumes(wire: PtyDevice) -> None:
    """That it does not jump is seen in virtual time."""
    robot = opened(wire, reconnect_s=60.0)
    since = led(robot, is_there).at
    wire.unplug()
    sleep(0.05)
    wire.plug()
    back = led(robot, lambda reading: reading.at > since + 0.2)
    assert isfinite(back.position[2])
    led(robot, is_there)
    robot.close()
    wire.unplug()
    with pytest.raises(RobotFault, match=r"^dynamixel: .*there is no such port"):
        robot.open(monotonic())
