"""The cycle of control on the emulated arm, in virtual time: it holds, follows, feels, and says what went wrong."""

from contextlib import suppress
from itertools import pairwise

import pytest

from tests.slave.robots.dynamixel.virtual_bus import Bench, KilledError
from weberlink.geometry.vector import Vector, distance, norm, subtract
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.slave.emulators.dynamixel import DynamixelEmulatorOptions as EmulatedOptions
from weberlink.slave.robots.dynamixel import registers
from weberlink.slave.robots.dynamixel.arm import Joints, arm_pose
from weberlink.slave.robots.dynamixel.exchange import WATCH_EVERY
from weberlink.slave.robots.dynamixel.external_force import force_error
from weberlink.slave.robots.dynamixel.options import DynamixelOptions, worst_force_error
from weberlink.slave.robots.dynamixel.packet import REBOOT, WRITE, Packet

AT_WORK: Vector = (0.2, 0.03, 0.13)
FLOOR_Z = 0.1
SWIFT = DynamixelOptions(approach_m_s=0.5)


def on_a_floor() -> Bench:
    scene = [{"shape": "plane", "point_m": [0.0, 0.0, FLOOR_Z], "stiffness_n_m": 1000.0}]
    return Bench(SWIFT, EmulatedOptions(scene=scene))  # type: ignore[arg-type]


def at_work() -> Bench:
    bench = Bench(SWIFT)
    bench.exchange.open()
    bench.lead(AT_WORK, 0.4)
    bench.run(AT_WORK, 0.4)
    return bench


def test_opening_takes_over_the_weight_and_moves_nothing() -> None:
    bench = Bench()
    before = bench.emulator.tip
    sample = bench.exchange.open()
    assert distance(sample.tip, before) < 1e-3
    bench.run(None, 0.4)
    assert not bench.emulator.held
    assert distance(bench.emulator.tip, before) < 2e-3
    assert [bench.read(joint, registers.BUS_WATCHDOG) for joint in range(1, 5)] == [4] * 4  # x 20 ms
    for joint in range(1, 5):
        assert bench.read(joint, registers.OPERATING_MODE) == registers.MODE_CURRENT
        assert bench.read(joint, registers.TORQUE_ENABLE) == 1
        assert bench.read(joint, registers.RETURN_DELAY_TIME) == 0
    assert bench.read(5, registers.TORQUE_ENABLE) == 0, "the gripper is not ours"


def test_no_watchdog_trips_while_the_other_motors_are_set() -> None:
    bench = Bench(DynamixelOptions(bus_watchdog_ms=20.0), latency=0.0005)
    bench.exchange.open()
    assert bench.emulator.watchdog_trips == 0


def test_settings_that_are_right_already_are_not_written_again() -> None:
    bench = Bench()
    bench.exchange.open()
    assert {11, 9} <= written(bench)
    bench.start_anew()
    bench.exchange.open()
    assert not {11, 9} & written(bench), "EEPROM wears"
    assert {64, 98, 102} <= written(bench)


def written(bench: Bench) -> set[int]:
    """Registers that were written to single motors since the port was opened."""
    return {int.from_bytes(each.parameters[:2], "little") for each in bench.port.sent if each.instruction == WRITE}


def test_it_follows_a_slow_command_and_says_where_it_is() -> None:
    bench = Bench()
    bench.exchange.open()
    sample = bench.lead(AT_WORK, 0.1)
    assert distance(sample.tip, AT_WORK) < 0.01
    sample = bench.run(AT_WORK, 0.2)[-1]
    assert distance(bench.emulator.tip, AT_WORK) < 0.004
    assert distance(sample.tip, bench.emulator.tip) < 1e-3
    assert bench.emulator.largest_current <= 1.0 + 1e-9
    newest = bench.interpolation.at(bench.time.now + 1.0)
    assert newest.values == (*sample.tip, *sample.force)
    assert 0.0 < bench.time.now - sample.at < 0.004


def test_the_first_command_is_approached_however_far_it_is() -> None:
    bench = Bench()
    start = bench.exchange.open().tip
    samples = bench.run((0.25, 0.1, 0.1), 0.3)
    assert distance(samples[-1].tip, start) < 0.1 * 0.3 + 0.005
    for a, b in pairwise(samples[::10]):
        assert distance(a.tip, b.tip) < 0.3 * 0.04


def test_a_floor_is_felt_as_far_as_the_spec_says() -> None:
    bench = on_a_floor()
    bench.exchange.open()
    newtons, share = worst_force_error(bench.options)
    for depth in (0.006, 0.011):
        goal = (0.2, 0.02, FLOOR_Z - depth)
        bench.lead(goal, 0.2)
        sample = bench.run(goal, 0.5)[-1]
        true = bench.emulator.tip_force
        dry = worst_force_error(bench.options.model_copy(update={"torque_constant_error": 0.0}))[0]
        assert true[2] == pytest.approx(400.0 * depth * 1000.0 / 1400.0, abs=dry), "springs in series, less what sticks"
        assert distance(sample.force, true) <= newtons + share * norm(sample.force)


SWEPT: Joints = (0.037, 0.085, 0.132, 0.045)
FITTED: Joints = (0.0168, 0.0089, 0.0094, 0.0377)
"""Dry friction of the same arm by two methods of the same project [N m]."""
NOISE_N = 0.3
"""Of the estimate: of the measured currents, and of an arm that is not quite at rest."""


@pytest.mark.parametrize(
    ("constant", "taken_for", "uncertain", "coulomb", "rotor"),
    [
        (1.65, 1.78, 0.4, SWEPT, 0.045),
        (2.48, 1.78, 0.4, SWEPT, 0.045),
        (2.48, 1.78, 0.4, SWEPT, 0.005),
        (1.78, 1.78, 0.4, FITTED, 0.005),
        (2.48, 2.55, 0.05, SWEPT, 0.045),
        (1.65, 1.60, 0.05, SWEPT, 0.005),
    ],
)
def test_the_force_of_any_published_arm_is_within_the_stated_error(
    constant: float, taken_for: float, uncertain: float, coulomb: Joints, rotor: float
) -> None:
    options = SWIFT.model_copy(update={"torque_constant_n_m_a": taken_for, "torque_constant_error": uncertain})
    scene = [{"shape": "plane", "point_m": [0.0, 0.0, FLOOR_Z], "stiffness_n_m": 1000.0}]
    arm = {"torque_constant_n_m_a": constant, "coulomb_n_m": coulomb, "rotor_inertia_kg_m2": rotor, "scene": scene}
    bench = Bench(options, EmulatedOptions.model_validate(arm))
    bench.exchange.open()
    stated = worst_force_error(options)
    for goal in ((0.14, -0.05, 0.16), (0.24, 0.05, 0.12), (0.2, 0.02, FLOOR_Z - 0.011), (0.14, 0.0, FLOOR_Z - 0.01)):
        bench.lead(goal, 0.3)
        sample = bench.run(goal, 0.5)[-1]
        wrong = distance(sample.force, bench.emulator.tip_force)
        assert wrong <= stated[0] + stated[1] * norm(sample.force)
        newtons, share = force_error(arm_pose(sample.joints), options.friction, uncertain)
        assert wrong <= newtons + share * norm(sample.force) + NOISE_N, f"as far as this arm_pose goes, at {goal}"


def test_pressing_ends_when_the_commands_do_and_the_tip_stays() -> None:
    bench = on_a_floor()
    bench.exchange.open()
    goal = (0.2, 0.02, FLOOR_Z - 0.02)
    bench.lead(goal, 0.2)
    bench.run(goal, 0.2)
    pressed, where = bench.emulator.tip_force[2], bench.emulator.tip
    bench.run(None, 0.4)
    assert pressed > 2.0
    assert bench.emulator.tip_force[2] < 0.5 * pressed
    assert distance(bench.emulator.tip, where) < 0.006


def test_one_garbled_answer_is_named_and_the_next_is_good() -> None:
    bench = at_work()
    bench.emulator.faults.garble = 1
    with pytest.raises(BadReply, match=r"joint 1 \(id 11\): .*garbled"):
        bench.run(AT_WORK, 0.004)
    assert distance(bench.run(AT_WORK, 0.1)[-1].tip, AT_WORK) < 0.006


def test_a_bus_that_stays_silent_carries_the_weight_and_presses_no_more() -> None:
    bench = on_a_floor()
    bench.exchange.open()
    goal = (0.2, 0.02, FLOOR_Z - 0.02)
    bench.lead(goal, 0.2)
    bench.run(goal, 0.2)
    pressed = bench.emulator.tip_force[2]
    bench.emulator.faults.silent = True
    for _ in range(4):
        with pytest.raises(BadReply, match=r"joint 1 \(id 11\): .*missing"):
            bench.exchange.exchange(None)
    bench.wait(0.05)
    assert 0.0 <= bench.emulator.tip_force[2] < 0.5 * pressed
    assert bench.emulator.watchdog_trips == 0


def test_an_alarm_is_named_with_its_joint() -> None:
    bench = at_work()
    bench.emulator.inject("overload", 3)
    with pytest.raises(HardwareFault, match=r"joint 3 \(id 13\): overload.*power") as caught:
        bench.run(AT_WORK, 0.01)
    assert not isinstance(caught.value, BadReply)


def test_a_tripped_watchdog_is_noticed_though_the_answers_look_good() -> None:
    bench = at_work()
    bench.emulator.inject("trip_watchdog", 1)
    with pytest.raises(HardwareFault, match=r"bus watchdog tripped.*80 ms"):
        bench.run(AT_WORK, 3 * WATCH_EVERY / bench.options.rate_hz)


def test_a_motor_that_was_without_power_is_noticed_though_it_answers_again() -> None:
    bench = at_work()
    bench.tell(Packet(13, REBOOT))
    with pytest.raises(HardwareFault, match=r"joint 3 \(id 13\): its torque is off"):
        for _ in range(10 * WATCH_EVERY):
            with suppress(BadReply):  # while it is deaf
                bench.run(AT_WORK, 1.0 / bench.options.rate_hz)


def test_a_host_that_slept_finds_the_arm_limp_and_takes_it_up_again_without_a_jump() -> None:
    bench = at_work()
    bench.wait(0.35)
    assert bench.emulator.watchdog_trips == 4
    with pytest.raises(HardwareFault, match="watchdog"):
        bench.exchange.exchange(AT_WORK)
    bench.exchange.close()
    found = bench.exchange.open().tip
    bench.run(None, 0.1)
    assert distance(bench.emulator.tip, found) < 0.02, "caught while it fell"
    tips = [sample.tip for sample in bench.run(AT_WORK, 0.4)]
    for a, b in pairwise(tips[::5]):
        assert distance(a, b) < 0.7 * 0.02, "approaches at 0.5 m/s"
    assert distance(tips[-1], AT_WORK) < 0.006


def test_a_watchdog_that_tripped_under_a_host_that_was_killed_is_cleared_at_opening() -> None:
    bench = at_work()
    bench.wait(0.35)
    assert bench.emulator.watchdog_trips == 4
    bench.start_anew()
    found = bench.exchange.open().tip
    bench.run(None, 0.2)
    assert distance(bench.emulator.tip, found) < 0.02


def test_closing_a_bus_that_does_not_answer_ends_the_pressing_all_the_same() -> None:
    bench = on_a_floor()
    bench.exchange.open()
    goal = (0.2, 0.02, FLOOR_Z - 0.02)
    bench.lead(goal, 0.2)
    bench.run(goal, 0.2)
    pressed = bench.emulator.tip_force[2]
    bench.emulator.faults.silent = True
    bench.exchange.close()
    bench.wait(0.03)
    assert bench.emulator.tip_force[2] < 0.5 * pressed


def test_left_holding_the_motors_keep_the_arm_themselves() -> None:
    bench = at_work()
    bench.exchange.close()
    where = bench.emulator.tip
    bench.wait(0.5)
    assert distance(bench.emulator.tip, where) < 0.015
    for joint in range(1, 5):
        assert bench.read(joint, registers.OPERATING_MODE) == registers.MODE_CURRENT_BASED_POSITION
        assert bench.read(joint, registers.TORQUE_ENABLE) == 1
        assert bench.read(joint, registers.BUS_WATCHDOG) == 0
    bench.exchange.close()


@pytest.mark.parametrize(("allowed_ma", "of_the_motor"), [(700.0, 1193), (1000.0, 1193), (1000.0, 300)])
def test_left_holding_no_motor_may_have_more_current_than_before(allowed_ma: float, of_the_motor: int) -> None:
    bench = Bench(DynamixelOptions(approach_m_s=0.5, max_current_ma=allowed_ma))
    bench.write(3, registers.CURRENT_LIMIT, of_the_motor)
    bench.exchange.open()
    bench.lead(AT_WORK, 0.4)
    bench.exchange.close()
    most = min(int(allowed_ma / 2.69), of_the_motor)
    assert [bench.read(joint, registers.GOAL_CURRENT) for joint in range(1, 5)] == [most] * 4
    for servo in bench.emulator.servos[:4]:
        assert servo.drive.limit <= most * registers.A_PER_COUNT + 1e-9


def test_a_host_killed_at_any_step_of_leaving_leaves_no_motor_unbounded() -> None:
    """With a watchdog that is off, a motor is limp or holds within the limit; with one that is on, it goes limp."""
    steps = 0
    while True:
        bench = Bench()
        bench.exchange.open()
        bench.port.killed_after = steps
        try:
            bench.exchange.close()
        except KilledError:
            ended = False
        else:
            ended = True
        bench.wait(0.085)
        for servo in bench.emulator.servos[:4]:
            drive = servo.drive
            assert not drive.on or drive.current == 0.0 or (drive.current is None and drive.limit <= 1.0), steps
        if ended:
            break
        steps += 1
    assert steps > 20


def test_a_process_that_stops_within_a_cycle_finds_the_arm_limp_at_once() -> None:
    bench = at_work()
    bench.time.stall_s = 0.3
    with suppress(BadReply):
        bench.run(AT_WORK, 1.0 / bench.options.rate_hz)
    bench.wait(0.01)
    assert bench.emulator.watchdog_trips == 4
    assert not any(bench.emulator.currents[:4]), "what it goes on to command is refused"
    with pytest.raises(HardwareFault, match="watchdog"):
        bench.exchange.exchange(AT_WORK)


def test_left_limp_it_drops() -> None:
    bench = at_work()
    bench.exchange.hold_on_close = False
    bench.exchange.close()
    assert bench.torque() == [0, 0, 0, 0]
    bench.wait(0.4)
    assert subtract(AT_WORK, bench.emulator.tip)[2] > 0.02


def test_one_motor_with_an_alarm_does_not_keep_the_others_from_holding() -> None:
    bench = at_work()
    bench.emulator.inject("overload", 4)
    with pytest.raises(HardwareFault):
        bench.run(AT_WORK, 0.02)
    bench.exchange.close()
    assert bench.torque() == [1, 1, 1, 0]


def test_motors_that_were_left_holding_are_taken_over_again() -> None:
    bench = at_work()
    bench.exchange.close()
    bench.wait(0.2)
    where = bench.emulator.tip
    bench.exchange.open()
    bench.run(None, 0.2)
    assert distance(bench.emulator.tip, where) < 0.004


# What opening refuses, each with one line that says what to do.


def refusal(bench: Bench) -> str:
    with pytest.raises(HardwareFault) as caught:
        bench.exchange.open()
    assert bench.emulator.held, "nothing was switched on"
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_no_motor_at_all() -> None:
    bench = Bench()
    bench.emulator.faults.silent = True
    assert "no motor answers at 1000000 bit/s: check the 12 V supply" in refusal(bench)


def test_one_motor_missing() -> None:
    bench = Bench()
    bench.emulator.inject("dead", 2)
    assert refusal(bench).startswith("joint 2 (id 12): no answer at 1000000 bit/s, but others answer: check the cable")


def test_motors_of_a_model_without_current_control() -> None:
    bench = Bench()
    bench.emulator.inject("wrong_model", 1060)
    assert "joint 1 (id 11): is a XL430-W250, which cannot control its current" in refusal(bench)


def test_an_unknown_model() -> None:
    bench = Bench()
    bench.emulator.inject("wrong_model", 4242)
    assert "is a model 4242; an OpenMANIPULATOR-X has XM430-W350: check ids" in refusal(bench)


def test_a_motor_that_runs_in_reverse() -> None:
    bench = Bench()
    bench.write(2, registers.DRIVE_MODE, 1)
    assert "joint 2 (id 12): runs in reverse; clear bit 0 of its drive mode" in refusal(bench)


def test_a_zero_that_is_not_where_it_belongs() -> None:
    bench = Bench()
    bench.write(3, registers.HOMING_OFFSET, 1000)
    assert "joint 3 (id 13): stands at 1.88 rad, where it cannot be (-1.50 to 1.40): check its zero" in refusal(bench)


def test_a_current_limit_that_cannot_carry_the_arm() -> None:
    bench = Bench()
    bench.write(2, registers.CURRENT_LIMIT, 100)
    assert "current limit (register 38) of 100 is too low to carry the arm; set it to 372" in refusal(bench)


def test_an_adapter_that_is_too_slow_for_the_rate() -> None:
    bench = Bench(latency=0.006)
    assert "a reading takes 9.0 ms at best, 250 Hz leave 4.0 ms; use a higher baud" in refusal(bench)


def test_a_motor_with_an_alarm() -> None:
    bench = Bench()
    bench.emulator.inject("overload", 2)
    assert "joint 2 (id 12): overload" in refusal(bench)


def test_a_wish_for_a_pitch_is_met_without_moving_the_tip() -> None:
    bench = Bench(DynamixelOptions(pitch_deg=40.0, approach_m_s=0.5))
    bench.exchange.open()
    bench.lead(AT_WORK, 0.3)
    sample = bench.run(AT_WORK, 0.6)[-1]
    pitch = sum(sample.joints[1:])
    assert pitch == pytest.approx(0.698, abs=0.25)
    assert distance(sample.tip, AT_WORK) < 0.006


@pytest.mark.parametrize("latency", [0.02, 0.03, 0.05, 0.1])
def test_answers_that_are_all_late_are_never_taken_for_fresh_ones(latency: float) -> None:
    bench = Bench()
    bench.exchange.open()
    bench.lead((0.18, 0.03, 0.18))
    bench.port.latency = latency
    bad = 0
    while bad < 10:
        try:
            (sample,) = bench.run((0.18, -0.05, 0.18), 1.0 / bench.options.rate_hz)
        except BadReply:
            bad += 1
        else:
            assert distance(sample.tip, bench.emulator.tip) < 0.002
            assert bench.time.now < 110.0, "never so many in a row"
            bad = 0
