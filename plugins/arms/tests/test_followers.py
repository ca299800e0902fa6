"""Follower arms with servos, in virtual time: where they go, what they feel, and that they stop pushing."""

from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from plugins.arms.tests.benches import FOLLOWERS, ArmBench, made, only, opened
from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.guardian import DIED
from weberlink.testing.serving import PtyDevice
from weberlink.testing.stepping import KilledError
from weberlink.testing.time import TICK
from weberlink_arms.emulators.feetech import FeetechEmulator
from weberlink_arms.feetech.arm import SO101
from weberlink_arms.feetech.follower import HoldingGuardian, So101Follower, So101FollowerOptions
from weberlink_arms.servo.layout import RAD_PER_COUNT
from weberlink_arms.servo.position import SINK_RAD_S, SINK_S

every_follower = pytest.mark.parametrize("name", FOLLOWERS)


GOALS = {
    "koch_follower": (0.2, -0.2, 0.2, -0.2, 0.2, 1.0),
    "so101_follower": (0.3, -0.2, 0.4, 0.1, -0.5, 1.5),
    "open_manipulator_x": (0.1, -1.0, 0.4, 0.75, 1.0),
}
SLACK = {"koch_follower": 0.036, "so101_follower": 0.02, "open_manipulator_x": 0.06}
"""Dry friction over the stiffness of position control; the weight of the OpenMANIPULATOR-X over 18.9 N m/rad [rad]."""


@every_follower
def test_a_follower_goes_where_it_is_told_and_feels_nothing_on_the_way(name: str) -> None:
    bench = opened(name)
    bench.run(GOALS[name], 1.5)
    assert bench.angles == pytest.approx(GOALS[name], abs=SLACK[name])
    assert bench.sample.angles == pytest.approx(bench.angles, abs=2e-3)
    error = getattr(bench.options, "torque_error", (0.02,) * 6)
    assert all(abs(torque) <= most for torque, most in zip(bench.sample.torques, error, strict=True))
    there = bench.angles
    bench.run(None, 0.5)
    assert bench.angles == pytest.approx(there, abs=0.02), "without a command it holds"


@every_follower
@pytest.mark.parametrize(("axis", "end"), [(0, "upper_rad"), (1, "lower_rad"), (-1, "upper_rad")])
def test_goals_stay_within_the_range(name: str, axis: int, end: str) -> None:
    """One beyond it is its end, to a count."""
    right = opened(name)
    start, limits = right.sample.angles, right.limits
    sign = -1 if end == "lower_rad" else 1
    limits[end][axis] = limit = start[axis] + sign * 0.1
    goals = []
    for beyond in (-0.01, 0.0, 0.01, 5.0):
        bench = opened(name, limits | {"gravity": False}, carried=lambda angles: (0.0,) * len(angles))
        goal = list(start)
        goal[axis] = limit + sign * beyond
        bench.run(tuple(goal), 0.2)
        goals.append(bench.register("goal_position")[axis])
    assert goals[1] == goals[2] == goals[3]
    assert abs(goals[0] - goals[1]) == pytest.approx(0.01 / RAD_PER_COUNT, abs=1.01)


@pytest.mark.parametrize("name", ["koch_follower", "open_manipulator_x"])
@pytest.mark.parametrize("sign", [1, -1])
def test_goals_of_dynamixel_followers_keep_to_their_speed(name: str, sign: int) -> None:
    """Also after a pause of the commands, and after one of the loop."""
    bench = opened(name, {"speed_rad_s": 1.0, "bus_watchdog_ms": 2000.0})
    start = bench.sample.angles
    goal = only(0, sign * 1.5, start)
    counts = [bench.register("goal_position")[0]]

    def went(command: Joints | None, cycles: int) -> float:
        """Speed of the goal [rad/s]."""
        bench.run(command, cycles / bench.options.rate_hz)
        bench.wait(0.001)  # until it has arrived
        counts.append(bench.register("goal_position")[0])
        return (counts[-1] - counts[-2]) * RAD_PER_COUNT / (cycles / bench.options.rate_hz)

    assert went(goal, 50) == pytest.approx(sign, abs=0.03)
    assert went(None, 50) == 0.0
    assert went(goal, 50) == pytest.approx(sign, abs=0.03)
    bench.wait(0.5)
    assert abs(went(goal, 1)) <= 2.0 + 0.4, "two cycles at most, to a count"


@pytest.mark.parametrize(("weight", "count"), [(-900.0, 0), (900.0, 4095)])
def test_goals_of_an_so101_stay_on_the_turn_of_the_encoder(weight: float, count: int) -> None:
    """A goal beyond it, here by what the weight takes, is another number to the servo."""
    bench = opened("so101_follower", carried=lambda _: (weight,) * 6)
    bench.exchange.exchange(bench.sample.angles)
    assert bench.register("goal_position") == [count] * 6


WALLS: list[tuple[str, int, bool, dict[str, Any], dict[str, Any]]] = [
    ("koch_follower", 2, False, {}, {}),
    ("koch_follower", 2, True, {}, {}),
    ("koch_follower", 2, False, {"current_law": "motor"}, {"current_law": "motor"}),
    ("koch_follower", 2, False, {"torque_ratio": (1.4,) * 6}, {"constant_ratio": 1.4}),
    ("koch_follower", 5, True, {}, {}),
    ("koch_follower", 0, False, {}, {}),  # an XL430 tells a load
    ("so101_follower", 2, False, {}, {}),
    ("so101_follower", 2, True, {}, {}),
    ("so101_follower", 5, True, {"torque_per_amp_nm": (1.91 / 2.7,) * 6}, {}),
]


@pytest.mark.parametrize(("name", "axis", "below", "options", "emulated"), WALLS)
def test_the_torque_of_a_wall_is_measured_within_the_stated_error(
    name: str, axis: int, below: bool, options: dict[str, Any], emulated: dict[str, Any]
) -> None:
    start = opened(name).sample.angles
    sign = -1 if below else 1
    joint = SO101.axes[axis]
    wall = {"joint": joint, "angle_rad": start[axis] + sign * 0.05, "below": below}
    bench = opened(name, options, walls=[wall], **emulated)
    bench.run(only(axis, start[axis] + sign * (0.15 if axis else 0.3), start), 1.0)
    true = bench.emulator.outside_nm[axis]
    assert true * sign < -0.05
    so101 = name == "so101_follower"
    error = 0.3 * abs(true) + 0.3 if so101 else type(bench.options)(gravity=True).torque_error[axis]
    assert bench.sample.torques[axis] == pytest.approx(true, abs=error)
    assert bench.sample.torques[axis] * sign < 0.0
    assert not so101 or abs(bench.sample.torques[axis]) <= abs(true), "the friction is not taken for contact"
    assert bench.sample.torques[3] == pytest.approx(0.0, abs=0.02)


def test_the_weight_of_an_so101_is_carried_and_not_taken_for_contact() -> None:
    pytest.importorskip("mujoco")
    from weberlink_mujoco.arms.models import load  # noqa: PLC0415

    bench = opened("so101_follower", carried=load("so101").gravity, weight=True)
    stretched = (0.0, 1.2, -1.2, 0.0, 0.0, 0.96)
    bench.run(stretched, 2.0)
    assert abs(load("so101").gravity(bench.sample.angles)[1]) > 0.4
    assert bench.sample.torques == pytest.approx((0.0,) * 6, abs=0.02)
    assert bench.sample.angles == pytest.approx(stretched, abs=0.02)


def test_modes_and_limits_are_those_of_each_model() -> None:
    bench = opened("koch_follower", {"max_current_ma": 500.0})
    assert bench.register("operating_mode") == [4, 4, 5, 5, 5, 5]
    currents = [servo.registers["goal_current"] for servo in bench.emulator.servos]
    assert currents == [0, 0, 500, 500, 500, 500]
    assert bench.register("position_p_gain") == [640, 640, 1500, 400, 400, 400]
    pressing = opened("koch_follower", {"max_current_ma": 100.0}, walls=[{"joint": "elbow_flex", "angle_rad": 0.05}])
    pressing.run(only(2, 1.0, pressing.sample.angles), 0.5)
    assert pressing.displayed[2] == pytest.approx(pressing.options.most[2], rel=0.01), "no harder than that"


PRESSING = [
    *(("koch_follower", axis, stiffness) for axis, stiffness in ((0, 200.0), (2, 20.0), (3, 200.0))),
    *(("so101_follower", axis, stiffness) for axis, stiffness in ((1, 20.0), (2, 200.0), (5, 20.0))),
]
FRICTION_NM = {"koch_follower": (0.1, 0.1, 0.018, 0.018, 0.018, 0.018), "so101_follower": (0.052,) * 6}


def pushed(bench: ArmBench, axis: int) -> float:
    """Torque on the wall, beyond what dry friction of the gears keeps up [N m]."""
    bench.wait(0.0)
    name = "so101_follower" if isinstance(bench.emulator, FeetechEmulator) else "koch_follower"
    return max(0.0, -bench.emulator.outside_nm[axis] - FRICTION_NM[name][axis])


def pressing(name: str, axis: int, stiffness: float = 200.0) -> ArmBench:
    start = opened(name).sample.angles
    joint = SO101.axes[axis]
    wall = {"joint": joint, "angle_rad": start[axis] + 0.1, "stiffness_nm_rad": stiffness}
    bench = opened(name, walls=[wall])
    bench.run(only(axis, start[axis] + 0.5, start), 1.0)
    assert pushed(bench, axis) > 0.1
    return bench


@pytest.mark.parametrize(("name", "axis", "stiffness"), PRESSING)
def test_a_closed_arm_holds_and_pushes_on_nothing(name: str, axis: int, stiffness: float) -> None:
    """Motors with a limit of their current and without."""
    bench = pressing(name, axis, stiffness)
    before = pushed(bench, axis)
    bench.exchange.close()
    angles = bench.angles
    for _ in range(4):
        bench.wait(0.5)
        assert pushed(bench, axis) < max(0.01, 0.02 * before)
    assert bench.angles == pytest.approx(angles, abs=0.02)
    assert all(bench.torques_on)
    if name == "koch_follower":
        assert bench.register("bus_watchdog") == [0] * 6
        assert [servo.registers["goal_current"] for servo in bench.emulator.servos] == [0, 0, 900, 900, 900, 900]


def test_an_arm_whose_guardian_died_pushes_on_nothing_when_its_session_ends() -> None:
    class Dead(HoldingGuardian):
        def hold(self, message: bytes) -> None:
            raise HardwareFault(DIED)

    bench = pressing("so101_follower", 2)
    bench.exchange._guardian = Dead(0.1)
    with pytest.raises(HardwareFault, match="guardian process died"):
        bench.run(bench.sample.angles, 0.1)
    bench.exchange.close()
    bench.wait(0.5)
    assert pushed(bench, 2) < 0.01


def test_a_host_killed_while_it_closes_pushes_on_nothing() -> None:
    """After any message."""
    messages, ended = 0, False
    while not ended:
        bench = pressing("koch_follower", 2)
        before = pushed(bench, 2)
        bench.port.killed_after = messages
        try:
            bench.exchange.close()
            ended = True
        except KilledError:
            bench.wait(0.5)
        assert pushed(bench, 2) < 0.1 * before, messages
        messages += 1 + messages // 2
    assert messages > 50


@pytest.mark.parametrize(
    ("name", "fault", "value"),
    [
        ("koch_follower", "overload", 1),
        ("so101_follower", "dead", 1),
        ("so101_follower", "dead", 4),
        ("so101_follower", "overload", 3),
    ],
)
def test_a_servo_that_failed_does_not_keep_the_others_pushing(name: str, fault: str, value: int) -> None:
    bench = pressing(name, 2)
    bench.emulator.inject(fault, value)
    with pytest.raises(HardwareFault, match=r"overload|missing"):
        bench.run(bench.sample.angles, 0.3)
    bench.exchange.close()
    bench.wait(0.5)
    assert pushed(bench, 2) < 0.1
    if name == "koch_follower":
        assert bench.torques_on == [False] + [True] * 5


def test_an_arm_that_fell_is_held_where_it_lies() -> None:
    """Its watchdogs tripped while the host was stopped: the motors with a goal current were limp since."""
    bench = pressing("koch_follower", 2, 20.0)
    bench.wait(0.2)
    assert bench.emulator.watchdog_trips == 6
    assert pushed(bench, 2) < 0.02
    bench.emulator.joints[2].angle, bench.emulator.joints[2].velocity = -0.3, 0.0
    with pytest.raises(HardwareFault, match="watchdog tripped"):
        bench.exchange.exchange(None)
    bench.exchange.close()
    bench.wait(0.5)
    assert bench.angles[2] == pytest.approx(-0.3, abs=0.01)
    assert bench.emulator.servos[2].drive.limit > 0.1


def test_an_arm_on_the_ground_carries_its_weight_and_pushes_on_nothing() -> None:
    ground = {"shape": "plane", "point_m": [0.0, 0.0, 0.1], "stiffness_n_m": 1000.0}
    bench = opened("open_manipulator_x", scene=[ground])
    bench.run((0.0, -0.3, 0.8, 0.7, 1.0), 1.0)
    before = bench.emulator.tip_force[2]
    assert before > 4.0
    bench.exchange.close()
    height = bench.emulator.tip[2]
    bench.wait(2.0)
    assert bench.emulator.tip_force[2] < 0.2 * before
    assert bench.emulator.tip[2] == pytest.approx(height, abs=0.003)


GROUND = {"shape": "plane", "point_m": [0.0, 0.0, 0.05], "stiffness_n_m": 1000.0}


@pytest.mark.parametrize(
    ("name", "emulated", "start"),
    [
        ("open_manipulator_x", {"scene": [GROUND]}, (0.0, -0.3, 0.0, 0.3, 1.0)),
        ("so101_follower", {"weight": True}, (0.0, 0.1, 0.1, 0.0, 0.0, 1.0)),
    ],
)
def test_an_arm_that_sinks_goes_down_slowly_and_falls_no_further(
    name: str, emulated: dict[str, Any], start: Joints
) -> None:
    """One that does not lie in time, as its tip slides on the ground, is held."""
    bench = opened(name, {"on_close": "sink"}, **emulated)
    bench.run(start, 1.0)
    started = before = bench.angles
    until = bench.time.now + SINK_S
    bench.exchange.control.sinks = True
    while not bench.exchange.control.lies and bench.time.now < until:
        bench.run(None, 0.05)
        fastest = max(abs(here - there) for here, there in zip(bench.angles, before, strict=True)) / 0.05
        assert fastest < 1.5 * SINK_RAD_S
        before = bench.angles
    assert before[1] > started[1] + 0.5, "it has gone down"
    bench.exchange.close()
    bench.wait(1.0)
    assert bench.torques_on == [not bench.exchange.control.lies] * len(start)
    assert bench.angles == pytest.approx(before, abs=0.03)


@pytest.mark.realtime
@pytest.mark.parametrize("stays", [False, True])
def test_a_driver_sinks_as_it_is_closed_but_not_after_an_emergency_stop(tmp_path: Path, stays: bool) -> None:
    emulator = made("so101_follower")
    with PtyDevice(emulator, tmp_path / "arm") as wire:
        given = {"port": str(wire.path), "on_close": "sink", "timeout_ms": 50.0, "gravity": False}
        arm = So101Follower(So101FollowerOptions.model_validate(given), TICK)
        arm.open(monotonic())
        if stays:
            arm.stay()
        arm.close()
        assert {servo.torque_on for servo in emulator.servos} == {stays}


def test_an_alarm_that_keeps_torque_on_does_not_prevent_release() -> None:
    """An XM430 as delivered goes on at a low supply."""
    bench = opened("open_manipulator_x", {"on_close": "limp"})
    bench.emulator.inject("low_voltage", 1)
    with pytest.raises(HardwareFault, match=r"joint1 \(id 11\): input voltage out of range.* 9.0 V now"):
        bench.run(None, 0.02)
    assert all(bench.torques_on)
    bench.exchange.close()
    assert not any(bench.torques_on)
