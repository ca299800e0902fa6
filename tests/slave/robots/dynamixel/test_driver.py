"""The robot as the loop sees it, on an emulated arm behind a pseudo terminal; what all robots do is in the contract."""

from collections.abc import Callable, Iterator
from math import isfinite
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from tests.system.systems import CONFIGS
from weberlink.arms.dynamixel import registers
from weberlink.arms.dynamixel.bus import MotorBus
from weberlink.geometry.vector import Vector, distance
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.serial_port import SerialPort
from weberlink.slave.emulators.dynamixel import DynamixelEmulator
from weberlink.slave.robots.contract import RobotFault, RobotReading
from weberlink.slave.robots.dynamixel.driver import DynamixelRobot
from weberlink.slave.robots.dynamixel.options import DynamixelOptions

PATIENCE = 10.0
TICK = 0.001


@pytest.fixture
def wire(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(DynamixelEmulator(), tmp_path / "arm") as wire:
        yield wire


def robot_at(wire: PtyDevice, **options: Any) -> DynamixelRobot:
    """That takes a machine which pauses for an arm which does not."""
    options = {"timeout_ms": 100.0, "bus_watchdog_ms": 2000.0, "approach_m_s": 0.5} | options
    return DynamixelRobot(DynamixelOptions(port=str(wire.path), **options), None, TICK)


def until(robot: DynamixelRobot, command: Vector | None, done: Callable[[RobotReading], bool]) -> RobotReading:
    gives_up = monotonic() + PATIENCE
    while True:
        now = monotonic()
        if command is not None:
            robot.command(command, now)
        reading = robot.latest(now)
        if done(reading):
            return reading
        assert now < gives_up, f"did not come about; the last was {reading}"
        sleep(TICK)


def near(goal: Vector, within: float = 0.008) -> Callable[[RobotReading], bool]:
    return lambda reading: distance(reading.position, goal) < within


def emulator_of(wire: PtyDevice) -> DynamixelEmulator:
    assert isinstance(wire.emulator, DynamixelEmulator)
    return wire.emulator


def torque(wire: PtyDevice) -> list[int]:
    """Whether it is on, for joints 1 to 4, as somebody else on the port is told; not where there is an alarm."""
    ids = DynamixelOptions().ids
    port = SerialPort(str(wire.path), 1_000_000)
    bus = MotorBus(port, 1_000_000, ids, margin=1.0)

    def of(id_: int) -> int:
        try:
            return bus.read(id_, registers.TORQUE_ENABLE)
        except BadReply:
            raise
        except HardwareFault:
            return 0

    try:
        return [of(id_) for id_ in ids]
    finally:
        port.close()


def test_the_spec_states_lag_and_uncertainty() -> None:
    spec = DynamixelRobot(DynamixelOptions(), None, TICK).spec
    assert spec.lag_s == pytest.approx(0.004 + 0.001 + 10e-6 * (18 + 84))
    newtons, share = spec.force_error
    assert (newtons, share) == (6.0, 0.4)
    assert spec.rate_hz == 250.0
    assert "estimated from motor currents" in spec.note
    better = DynamixelRobot(DynamixelOptions(torque_constant_error=0.05), None, TICK).spec
    assert better.force_error == (4.0, 0.05)
    down = DynamixelRobot(DynamixelOptions(pitch_deg=45.0), None, TICK).spec
    assert down.force_error == (2.5, 0.4)
    assert spec.watchdog_s == pytest.approx(0.08)
    assert DynamixelRobot(DynamixelOptions(bus_watchdog_ms=90.0), None, TICK).spec.watchdog_s == pytest.approx(0.1)


def test_example_deadband_exceeds_force_uncertainty() -> None:
    example = yaml.safe_load((CONFIGS / "phantom-arm.yaml").read_text())
    options = {name: value for name, value in example["slave"]["robot"].items() if name != "driver"}
    spec = DynamixelRobot(DynamixelOptions.model_validate(options), None, TICK).spec
    assert example["codec"]["force"]["floor_n"] > spec.force_error[0]
    assert example["codec"]["force"]["floor_n"] < spec.force_n, "or nothing is ever felt"


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"baud": 1_000_001}, "baud: expected one of"),
        ({"ids": (11, 11, 13, 14)}, "ids: expected four different ones"),
        ({"ids": (11, 12, 13, 254)}, "ids: expected four different ones"),
        ({"baud": 57_600}, "baud: expected more: at 57600 bit/s .* takes 23.2 ms, and the arm needs 200 Hz"),
        ({"rate_hz": 1000.0}, "rate_hz: expected 438 or less"),
        ({"rate_hz": 100.0}, "greater than or equal to 200"),
        ({"stiffness_n_m": 500.0}, "stiffness_n_m: expected 438 or less, more is unstable at 250 Hz"),
        ({"damping_rate_s": 80.0}, "damping_rate_s: expected 13.9 or less at 250 Hz with rotor_inertia_kg_m2 0.045"),
        ({"damping_rate_s": 80.0, "rotor_inertia_kg_m2": 0.005}, "damping_rate_s: expected 62.5 or less at 250 Hz"),
        ({"bus_watchdog_ms": 20.0, "timeout_ms": 15.0}, "bus_watchdog_ms: expected at least twice timeout_ms, 30"),
        ({"workspace_m": ((0.2, -0.1, 0.1), (0.1, 0.1, 0.2))}, "workspace_m: expected a lower and a higher corner"),
        ({"workspace_m": ((0.12, -0.1, 0.1), (0.4, 0.1, 0.2))}, "workspace_m: expected corners that the arm reaches"),
        ({"home_m": (0.3, 0.0, 0.1)}, "home_m: expected a point within the workspace"),
        ({"stifness_n_m": 100.0}, "Extra inputs are not permitted"),
    ],
)
def test_impossible_options_are_refused(options: dict[str, Any], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        DynamixelOptions(**options)


def test_it_is_opened_moved_and_left_holding(wire: PtyDevice) -> None:
    robot = robot_at(wire)
    robot.open(monotonic())
    goal = (0.19, 0.02, 0.18)
    reading = until(robot, goal, near(goal))
    assert all(map(isfinite, reading.force))
    assert distance(emulator_of(wire).tip, reading.position) < 0.02
    robot.close()
    assert torque(wire) == [1, 1, 1, 1]


def test_arm_holds_when_the_loop_stops(wire: PtyDevice) -> None:
    robot = robot_at(wire)
    robot.open(monotonic())
    goal = (0.19, 0.02, 0.18)
    until(robot, goal, near(goal))
    stopped = monotonic()
    until(robot, None, lambda _: monotonic() > stopped + 0.4)
    assert near(goal, 0.015)(robot.latest(monotonic()))
    assert emulator_of(wire).watchdog_trips == 0
    robot.close()


def test_it_goes_home_before_it_goes_limp(wire: PtyDevice) -> None:
    robot = robot_at(wire, on_close="rest", home_m=(0.15, 0.0, 0.2))
    robot.open(monotonic())
    robot.close()  # where it does not get home, it holds
    assert torque(wire) == [0, 0, 0, 0]
    assert emulator_of(wire).tip[2] < 0.22, "from 0.24"


def test_interrupted_way_home_ends_in_hold(wire: PtyDevice) -> None:
    robot = robot_at(wire, on_close="rest", home_m=(0.15, 0.0, 0.2))
    robot.open(monotonic())
    emulator_of(wire).inject("overload", 4)
    robot.close()
    assert torque(wire) == [1, 1, 1, 0]


def test_missing_port_error_is_one_line(tmp_path: Path) -> None:
    robot = DynamixelRobot(DynamixelOptions(port=str(tmp_path / "none")), None, TICK)
    with pytest.raises(RobotFault, match=r"^dynamixel: .*there is no such port") as caught:
        robot.open(monotonic())
    assert "\n" not in str(caught.value)
    with pytest.raises(RobotFault, match="not open"):
        robot.latest(monotonic())


def test_reconnected_arm_resumes_without_jump(wire: PtyDevice) -> None:
    robot = robot_at(wire, reconnect_s=PATIENCE)
    robot.open(monotonic())
    goal = (0.17, 0.0, 0.2)
    until(robot, goal, near(goal))
    wire.unplug()
    sleep(0.05)
    wire.plug()
    since = robot.latest(monotonic()).at
    back = until(robot, goal, lambda reading: reading.at > since + 0.1)
    assert isfinite(back.position[2])
    until(robot, goal, near(goal))
    robot.close()


def test_unplugged_arm_is_a_fault_with_reason(wire: PtyDevice) -> None:
    robot = robot_at(wire)
    robot.open(monotonic())
    wire.unplug()
    with pytest.raises(RobotFault, match=r"^dynamixel: .*unplugged"):
        until(robot, (0.17, 0.0, 0.2), lambda _: False)
    robot.close()
