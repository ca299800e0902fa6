"""A follower on its bus in virtual time: motion, torques of what it touches, limits, and how it is left."""

from itertools import pairwise

import pytest

from tests.arms.dynamixel.benches import ArmBench, follower_bench
from tests.slave.robots.dynamixel.virtual_bus import KilledError
from weberlink.arms.dynamixel import registers
from weberlink.arms.dynamixel.layouts import KOCH_FOLLOWER
from weberlink.arms.emulators.dynamixel.joint_arm import KochFollowerEmulator, KochFollowerEmulatorOptions
from weberlink.arms.threaded_arm import ArmSample
from weberlink.hardware.fault import HardwareFault
from weberlink.slave.emulators.dynamixel import DynamixelEmulator, DynamixelEmulatorOptions
from weberlink.slave.robots.dynamixel_follower import (
    DynamixelFollowerOptions,
    KochFollowerOptions,
    OnClose,
    OpenManipulatorXOptions,
    _weight_of_open_manipulator,
)

START = (0.0, 0.0, 0.0, 0.0, 0.0, 0.815)
WORK = (0.1, -1.0, 0.4, 0.75, 1.0)


def koch(options: KochFollowerOptions | None = None, **emulated: object) -> ArmBench:
    given = KochFollowerEmulatorOptions.model_validate({"current_noise_ma": 0.0, **emulated})
    return follower_bench(KochFollowerEmulator(given), options or KochFollowerOptions())


def open_manipulator_x(options: DynamixelFollowerOptions | None = None, **emulated: object) -> ArmBench:
    given = DynamixelEmulatorOptions.model_validate({"current_noise_ma": 0.0, **emulated})
    return follower_bench(DynamixelEmulator(given), options or OpenManipulatorXOptions(), _weight_of_open_manipulator)


def test_koch_goes_where_it_is_told() -> None:
    bench = koch()
    goal = (0.2, -0.2, 0.2, -0.2, 0.2, 1.0)
    sample = bench.run(lambda _: goal, bench.exchange.open(), 0.4)[-1]
    # Dry friction over the stiffness of position control.
    for angle, wanted, slack in zip(sample.angles, goal, (0.02, 0.02, 0.01, 0.035, 0.035, 0.035), strict=True):
        assert angle == pytest.approx(wanted, abs=slack)
    assert sample.torques == (0.0,) * 6


def test_open_manipulator_goes_where_it_is_told() -> None:
    bench = open_manipulator_x()
    sample = bench.run(lambda _: WORK, bench.exchange.open(), 0.5)[-1]
    # The weight of the stretched arm over 18.9 N m/rad.
    assert sample.angles == pytest.approx(WORK, abs=0.06)
    error = OpenManipulatorXOptions().torque_error
    assert all(abs(torque) <= most for torque, most in zip(sample.torques, error, strict=True))


def test_modes_and_limits_are_those_of_each_model() -> None:
    bench = koch(KochFollowerOptions(max_current_ma=500.0))
    bench.exchange.open()
    modes = [servo.registers["operating_mode"] for servo in bench.emulator.servos]
    assert modes == [registers.MODE_EXTENDED_POSITION] * 2 + [registers.MODE_CURRENT_BASED_POSITION] * 4
    assert [servo.registers["goal_current"] for servo in bench.emulator.servos] == [0, 0, 500, 500, 500, 500]
    assert [servo.registers["position_p_gain"] for servo in bench.emulator.servos] == [640, 640, 1500, 400, 400, 400]


@pytest.mark.parametrize(("law", "ratio"), [(None, 1.0), ("motor", 1.0), (None, 1.4)])
def test_torque_of_a_wall_is_measured(law: str | None, ratio: float) -> None:
    walls = [{"joint": "elbow_flex", "angle_rad": 0.05}, {"joint": "gripper", "angle_rad": 0.78, "below": True}]
    bench = koch(
        KochFollowerOptions.model_validate({"current_law": law, "torque_ratio": (ratio,) * 6}),
        walls=walls,
        current_law=law,
        constant_ratio=ratio,
    )
    goal = (0.0, 0.0, 0.15, 0.0, 0.0, 0.6)
    sample = bench.run(lambda _: goal, bench.exchange.open(), 0.4)[-1]
    error = KochFollowerOptions(gravity=True).torque_error
    outside = bench.emulator.outside_nm  # type: ignore[attr-defined]
    assert outside[2] < -0.1
    assert outside[5] > 0.05
    for axis in (2, 5):
        assert sample.torques[axis] == pytest.approx(outside[axis], abs=error[axis])
    assert sample.torques[3] == sample.torques[4] == 0.0


def test_load_of_an_xl430_gives_a_torque() -> None:
    bench = koch(walls=[{"joint": "shoulder_pan", "angle_rad": 0.05}])
    sample = bench.run(lambda _: (0.3, 0.0, 0.0, 0.0, 0.0, 0.815), bench.exchange.open(), 0.4)[-1]
    outside = bench.emulator.outside_nm[0]  # type: ignore[attr-defined]
    assert sample.torques[0] == pytest.approx(outside, abs=KochFollowerOptions().torque_error[0])
    assert sample.torques[0] < -0.5


def test_slow_motion_shows_no_more_than_stated_error() -> None:
    """Fast motion also shows the inertia of links and rotors."""
    options = OpenManipulatorXOptions(speed_rad_s=0.2)
    bench = open_manipulator_x(options)
    for sample in bench.run(lambda _: WORK, bench.exchange.open(), 0.5):
        assert all(abs(torque) <= most for torque, most in zip(sample.torques, options.torque_error, strict=True))


def test_pushes_no_harder_than_goal_current() -> None:
    bench = koch(KochFollowerOptions(max_current_ma=100.0), walls=[{"joint": "elbow_flex", "angle_rad": 0.05}])
    bench.run(lambda _: (0.0, 0.0, 1.0, 0.0, 0.0, 0.8), bench.exchange.open(), 0.5)
    pushed = bench.emulator.motor_nm[2]  # type: ignore[attr-defined]
    assert pushed == pytest.approx(KochFollowerOptions(max_current_ma=100.0).most[2], rel=0.01)


def test_goals_keep_to_speed_and_range() -> None:
    options = KochFollowerOptions(speed_rad_s=1.0, upper_rad=(2.2, 0.1, 1.45, 2.0, 3.14, 1.63))
    bench = koch(options)
    samples = bench.run(lambda _: (2.0, 2.0, 0.0, 0.0, 0.0, 0.815), bench.exchange.open(), 0.4)
    assert 0.3 < samples[-1].angles[0] < 0.42
    assert samples[-1].angles[1] < 0.13


def test_arm_holds_during_a_pause_and_continues_without_a_jump() -> None:
    bench = koch(KochFollowerOptions(speed_rad_s=1.0))
    before = bench.run(lambda _: (1.0, 0.0, 0.0, 0.0, 0.0, 0.815), bench.exchange.open(), 0.3)[-1]
    paused = bench.run(lambda _: None, before, 0.3)[-1]
    assert paused.angles[0] == pytest.approx(before.angles[0], abs=0.06)
    again = bench.run(lambda _: (1.0, 0.0, 0.0, 0.0, 0.0, 0.815), paused, 0.1)
    steps = [b.angles[0] - a.angles[0] for a, b in pairwise(again)]
    assert max(steps) < 0.008


def test_hold_on_close_leaves_torque_on_without_watchdog() -> None:
    bench = koch()
    sample = bench.run(lambda _: START, bench.exchange.open(), 0.05)[-1]
    bench.exchange.close()
    assert all(servo.torque_on for servo in bench.emulator.servos)
    bench.wait(0.5)
    assert bench.emulator.watchdog_trips == 0
    assert bench.emulator.angles == pytest.approx(sample.angles, abs=0.01)  # type: ignore[attr-defined]


def pushed_by(bench: ArmBench, axis: int) -> float:
    """Torque of an emulated Koch arm on its wall, beyond what dry friction of the gears keeps up [N m]."""
    friction = KochFollowerOptions().coulomb[axis]
    return max(0.0, -bench.emulator.outside_nm[axis] - friction)  # type: ignore[attr-defined]


def pressing_koch(axis: int, stiffness: float, **options: object) -> tuple[ArmBench, float]:
    """An arm that presses on a wall, and how hard [N m]."""
    bench = koch(
        KochFollowerOptions.model_validate(options),
        walls=[{"joint": KOCH_FOLLOWER.axes[axis], "angle_rad": 0.05, "stiffness_nm_rad": stiffness}],
    )
    goal = tuple(0.4 if each == axis else angle for each, angle in enumerate(START))
    bench.run(lambda _: goal, bench.exchange.open(), 0.4)
    return bench, pushed_by(bench, axis)


@pytest.mark.parametrize("stiffness", [20.0, 200.0])
@pytest.mark.parametrize("axis", [0, 2, 3])
def test_hold_on_close_pushes_on_nothing(axis: int, stiffness: float) -> None:
    """An XL430 without a limit of its current, and motors with one."""
    bench, before = pressing_koch(axis, stiffness)
    assert before > 0.1
    bench.exchange.close()
    for _ in range(10):
        bench.wait(0.5)
        assert pushed_by(bench, axis) < 0.01
    assert all(servo.torque_on for servo in bench.emulator.servos)
    assert [servo.registers["bus_watchdog"] for servo in bench.emulator.servos] == [0] * 6
    assert [servo.registers["goal_current"] for servo in bench.emulator.servos] == [0, 0, 900, 900, 900, 900]


@pytest.mark.parametrize("axis", [0, 2])
def test_host_that_is_killed_while_it_closes_pushes_on_nothing(axis: int) -> None:
    instructions = 0
    while True:
        bench, before = pressing_koch(axis, 200.0)
        bench.port.killed_after = instructions
        try:
            bench.exchange.close()
        except KilledError:
            bench.wait(0.5)
            assert pushed_by(bench, axis) < 0.1 * before, instructions
        else:
            break
        instructions += 1 + instructions // 4
    assert instructions > 50


def test_killed_host_pushes_on_nothing() -> None:
    for axis in (0, 2):
        bench, before = pressing_koch(axis, 200.0)
        bench.wait(0.1)
        assert pushed_by(bench, axis) < 0.1 * before


def test_arm_that_fell_is_held_where_it_lies() -> None:
    """Its watchdogs tripped while the host was stopped: the motors with a goal current were limp since."""
    bench, _ = pressing_koch(2, 20.0)
    bench.wait(0.2)
    assert bench.emulator.watchdog_trips == 6
    lying = -0.3
    bench.emulator._angles[2], bench.emulator._velocities[2] = lying, 0.0  # type: ignore[attr-defined]
    with pytest.raises(HardwareFault, match="watchdog tripped"):
        bench.exchange.exchange(None)
    bench.exchange.close()
    bench.wait(0.5)
    assert bench.emulator.angles[2] == pytest.approx(lying, abs=0.01)  # type: ignore[attr-defined]
    assert bench.emulator.servos[2].drive.limit > 0.1


def test_motor_with_an_alarm_does_not_keep_the_others_pushing() -> None:
    bench, _ = pressing_koch(2, 200.0)
    bench.emulator.inject("overload", 1)
    with pytest.raises(HardwareFault, match="overload"):
        bench.run(lambda _: START, ArmSample(0.0, START, START), 0.02)
    bench.exchange.close()
    bench.wait(0.5)
    assert pushed_by(bench, 2) < 0.05
    assert [servo.torque_on for servo in bench.emulator.servos] == [False] + [True] * 5


@pytest.mark.parametrize("stiffness", [1000.0, 5000.0])
def test_arm_on_the_ground_carries_its_weight_and_pushes_on_nothing(stiffness: float) -> None:
    ground = {"shape": "plane", "point_m": [0.0, 0.0, 0.1], "stiffness_n_m": stiffness}
    bench = open_manipulator_x(scene=[ground])
    bench.run(lambda _: (0.0, -0.3, 0.8, 0.7, 1.0), bench.exchange.open(), 1.0)
    before = bench.emulator.tip_force[2]  # type: ignore[attr-defined]
    assert before > 4.0
    bench.exchange.close()
    height = bench.emulator.tip[2]  # type: ignore[attr-defined]
    bench.wait(2.0)
    assert bench.emulator.tip_force[2] < 0.2 * before  # type: ignore[attr-defined]
    assert bench.emulator.tip[2] == pytest.approx(height, abs=0.003)  # type: ignore[attr-defined]


def test_limp_on_close_takes_torque_off() -> None:
    bench = koch(KochFollowerOptions(on_close=OnClose.LIMP))
    bench.run(lambda _: START, bench.exchange.open(), 0.05)
    bench.exchange.close()
    assert not any(servo.torque_on for servo in bench.emulator.servos)


def test_alarm_that_keeps_torque_on_does_not_prevent_release() -> None:
    """An XM430 as delivered goes on at a low supply."""
    bench = open_manipulator_x(OpenManipulatorXOptions(on_close=OnClose.LIMP))
    sample = bench.run(lambda _: WORK, bench.exchange.open(), 0.02)[-1]
    bench.emulator.inject("low_voltage", 1)
    with pytest.raises(HardwareFault, match=r"joint1 \(id 11\): input voltage out of range.* 9.0 V now"):
        bench.run(lambda _: WORK, sample, 0.02)
    assert all(servo.torque_on for servo in bench.emulator.servos)
    bench.exchange.close()
    assert not any(servo.torque_on for servo in bench.emulator.servos)


def test_dead_host_leaves_arm_where_it_is() -> None:
    bench = koch()
    sample = bench.run(lambda _: (0.5, 0.0, 0.0, 0.0, 0.0, 0.815), bench.exchange.open(), 0.1)[-1]
    bench.wait(0.1)
    assert bench.emulator.watchdog_trips == 6
    stopped = bench.emulator.angles[0]  # type: ignore[attr-defined]
    bench.wait(0.2)
    assert bench.emulator.angles[0] == pytest.approx(stopped, abs=0.02)  # type: ignore[attr-defined]
    with pytest.raises(HardwareFault, match="bus watchdog tripped"):
        bench.run(lambda _: START, sample, 0.01)


def test_other_model_at_an_id_is_named() -> None:
    bench = koch()
    bench.emulator.inject("wrong_model", 1190)
    with pytest.raises(
        HardwareFault, match=r"shoulder_pan \(id 1\): is a XL330-M077; a Koch v1.1 follower has XL430-W"
    ):
        bench.exchange.open()
