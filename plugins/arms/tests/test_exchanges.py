"""The cycle of every arm with servos, in virtual time: how it opens, how it is left, and what breaks."""

from contextlib import suppress

import pytest

from plugins.arms.tests.benches import FAMILIES, FOLLOWERS, LEADERS, ArmBench, only, opened
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink_arms.dynamixel.packet import FRAMING
from weberlink_arms.emulators.feetech import FeetechEmulator
from weberlink_arms.servo.layout import RAD_PER_COUNT
from weberlink_arms.servo.packet import WRITE

DYNAMIXEL = [name for name in FAMILIES if not name.startswith("so101")]
BEYOND_RAD = 0.35
every_family = pytest.mark.parametrize("name", FAMILIES)
every_leader = pytest.mark.parametrize("name", LEADERS)
every_follower = pytest.mark.parametrize("name", FOLLOWERS)


@every_family
def test_opening_moves_nothing_and_measures(name: str) -> None:
    bench = opened(name)
    before = bench.angles
    bench.run(bench.family.rest, 0.3)
    assert bench.sample.angles == pytest.approx(bench.angles, abs=2e-3)
    assert bench.angles == pytest.approx(before, abs=0.02)
    assert bench.torques_on == [name != "so101_leader"] * len(bench.angles), "an SO-101 without a torque is off"
    began = bench.time.now
    sample = bench.exchange.exchange(bench.family.rest)
    assert sample.at == pytest.approx(0.5 * (began + bench.time.now), abs=1e-5), "in the middle of the exchange"
    if bench.family.leads:
        assert bench.sample.torques == (0.0,) * 6
        assert max(map(abs, bench.displayed)) < 0.01


@every_family
def test_signs_and_offsets_apply_to_angles_and_goals(name: str) -> None:
    count = 5 if name == "open_manipulator_x" else 6
    turned = {
        "sign": (-1,) * count, "offset_rad": (0.1,) * count, "lower_rad": (-3.1,) * count, "upper_rad": (3.1,) * count
    }  # fmt: skip
    bench = opened(name, turned)
    offsets = [0.1] * count
    if name.startswith("so101"):
        offsets[-1] = bench.emulator.angles[-1] + bench.sample.angles[-1]
        assert offsets[-1] == pytest.approx(1.91986, abs=0.01), "where the gripper counts most, it is closed"
    if name == "open_manipulator_x":
        offsets[-1] = 0.1 - 0.92 + 2.0 * bench.angles[-1]  # its own sign is negative already
    expected = [offset - angle for offset, angle in zip(offsets, bench.angles, strict=True)]
    assert bench.sample.angles == pytest.approx(expected, abs=2e-3)
    if bench.family.leads:
        bench.run(only(2, bench.family.torque), 0.3)
        assert bench.displayed[2] == pytest.approx(-bench.family.torque, abs=bench.family.within)
        return
    before = bench.angles[0]
    bench.run(only(0, bench.sample.angles[0] + 0.2, bench.sample.angles), 0.6)
    assert bench.angles[0] == pytest.approx(before - 0.2, abs=0.03)


@every_family
@pytest.mark.parametrize("axis", [0, -1])
@pytest.mark.parametrize("end", ["lower_rad", "upper_rad"])
def test_an_arm_that_stands_beyond_its_range_is_refused(name: str, axis: int, end: str) -> None:
    """At opening, before any torque: its zero is wrong."""
    right = opened(name)
    limits, stands = right.limits, right.sample.angles[axis]
    for beyond, refused in ((BEYOND_RAD - 0.005, False), (BEYOND_RAD + 0.005, True)):
        low = stands + beyond if end == "lower_rad" else stands - beyond - 0.5
        limits["lower_rad"][axis], limits["upper_rad"][axis] = low, low + 0.5
        bench = ArmBench(name, limits)
        if not refused:
            bench.open()
            continue
        with pytest.raises(HardwareFault, match="stands at"):
            bench.open()
        assert bench.port.closed
        assert not any(bench.torques_on)


@every_family
def test_settings_last_until_they_are_set_back(name: str) -> None:
    """What survives a power cycle is not written where it is right already: that memory wears out."""
    bench = opened(name)
    bench.exchange.close()
    bench.exchange.close()
    assert bench.port.closed
    if isinstance(bench.emulator, FeetechEmulator):
        saved = [bytes(servo.memory[:40]) for servo in bench.emulator.servos]
        bench.emulator.servos[3].write(33, b"\1")  # another mode
        bench.open()
        assert bench.register("mode") == [0] * 6
        assert bench.register("p_gain") == [bench.options.p_gain] * 6
        for servo, before in zip(bench.emulator.servos, saved, strict=True):
            servo.restart(0.0)
            assert bytes(servo.memory[9:21]) == before[9:21]
        return
    for wears in (False, True):
        bench.port.sent.clear()
        bench.emulator.servos[0].registers["return_delay_time"] = 250 * wears
        bench.open()
        written = {
            each.parameters[:2]
            for each in FRAMING.requests().feed(b"".join(bench.port.sent))
            if each.instruction == WRITE
        }
        assert (b"\x09\0" in written, b"\x0b\0" in written) == (wears, False)
        bench.exchange.close()
    assert bench.register("return_delay_time")[:4] == [0] * 4


@every_family
def test_an_arm_is_left_limp_where_asked_with_its_settings_set_back(name: str) -> None:
    """As a leader always is; that a follower holds is with its wall."""
    leads = name in LEADERS
    bench = opened(name, {} if leads else {"on_close": "limp"})
    bench.run((bench.family.torque,) * 6 if leads else only(0, 0.2, bench.sample.angles), 0.1)
    assert any(bench.torques_on)
    bench.exchange.close()
    assert not any(bench.torques_on)
    bench.wait(0.01)
    assert bench.displayed == (0.0,) * len(bench.angles)
    assert bench.port.closed
    if name.startswith("so101"):
        assert (set(bench.register("p_gain")), set(bench.register("torque_limit"))) == ({32}, {1000})
    else:
        assert set(bench.register("bus_watchdog")) == {0}


@every_follower
def test_a_reopened_arm_stays_where_it_is_found(name: str) -> None:
    """Also one that fell meanwhile, or whose watchdogs have tripped."""
    bench = opened(name)
    bench.run(only(0, 0.2, bench.sample.angles), 0.4)
    bench.wait(0.4)
    with suppress(HardwareFault):
        bench.run(None, 0.02)
    bench.exchange.close()
    found = bench.open().angles
    bench.run(None, 0.2)
    assert bench.angles == pytest.approx(found, abs=0.03)
    assert all(bench.torques_on)


OPENING = [
    (name, fault, value, says)
    for name in ("koch_leader", "so101_follower", "open_manipulator_x")
    for fault, value, says in (
        ("silent", True, " answers at 1000000 bit/s"),
        ("dead", 3, r"(elbow_flex|joint3) \(id 1?3\): no answer"),
        ("wrong_model", 1060, r"\(id 1?1\): is "),
        ("overload", 2, r"(shoulder_lift|joint2) \(id 1?2\): overload"),
    )
] + [
    ("koch_leader", "low_voltage", 1, "input voltage out of range.* 3.0 V now"),
    ("so101_leader", "supply", 12.0, r"shoulder_pan \(id 1\): its supply of 12\.0 V"),
    ("koch_follower", "wrong_model", 1190, "shoulder_pan .* is a XL330-M077; .* has XL430-W250 there"),
    ("koch_leader", "wrong_model", 1060, "XL430-W250, which cannot control its current"),
]


@pytest.mark.parametrize(("name", "fault", "value", "says"), OPENING)
def test_an_arm_that_cannot_be_used_is_refused_without_torque(name: str, fault: str, value: float, says: str) -> None:
    bench = ArmBench(name, {})
    bench.inject(fault, value)
    with pytest.raises(HardwareFault, match=says) as caught:
        bench.open()
    assert "\n" not in str(caught.value)
    assert bench.port.closed
    assert not any(bench.torques_on)


@pytest.mark.parametrize(
    ("volts", "refused"), [(34, True), (35, False), (70, False), (71, True)]
)  # of an XL330: 3.5 to 7 V
def test_a_supply_out_of_its_range_is_refused(volts: int, refused: bool) -> None:
    bench = ArmBench("koch_leader", {})
    bench.emulator.servos[1].registers["present_input_voltage"] = volts
    if not refused:
        bench.open()
        return
    with pytest.raises(HardwareFault, match=rf"shoulder_lift \(id 2\): .* {volts / 10} V and needs 3.5 to 7.0 V"):
        bench.open()


def test_the_gripper_of_an_so101_needs_its_closed_place() -> None:
    with pytest.raises(HardwareFault, match="gripper: its range is not calibrated"):
        opened("so101_follower", calibrated=False)
    given = opened("so101_follower", {"gripper_closed": 1500}, calibrated=False)
    assert given.sample.angles[-1] == pytest.approx((2048 - 1500) * RAD_PER_COUNT, abs=2e-3)


FAILING = [  # the servos of an SO-101 leader have no torque to lose
    *[(name, "trip_watchdog", 1, "bus watchdog tripped") for name in DYNAMIXEL],
    *[(name, "overload", 4, r"\(id 1?4\): overload") for name in (*DYNAMIXEL, FOLLOWERS[1])],
    *[
        (name, "power", number, rf"\(id 1?{number}\): its torque is off")
        for name in (*DYNAMIXEL, FOLLOWERS[1])
        for number in range(1, 6)
    ],
]


@pytest.mark.parametrize(("name", "fault", "value", "says"), FAILING)
def test_a_servo_that_fails_is_named(name: str, fault: str, value: float, says: str) -> None:
    bench = opened(name)
    bench.run(bench.family.rest, 0.1)
    bench.inject(fault, value)
    with pytest.raises(HardwareFault, match=says) as caught:
        bench.run(bench.family.rest, 2.0)
    assert not isinstance(caught.value, BadReply)
    bench.exchange.close()
    assert not bench.family.leads or not any(bench.torques_on)


@every_family
def test_late_answers_are_never_taken_as_fresh(name: str) -> None:
    """The arm moves all the time; what is measured is where it is, or nothing."""
    bench = opened(name, hand_rad=(0.4,) * 6) if name in LEADERS else opened(name)
    bench.port.latency, bad = 0.02, 0
    command = bench.family.rest if name in LEADERS else only(0, bench.sample.angles[0] + 1.0, bench.sample.angles)
    for _ in range(40):
        try:
            bench.run(command, 1.0 / bench.options.rate_hz)
        except BadReply:
            bad += 1
        else:
            assert bench.sample.angles == pytest.approx(bench.angles, abs=0.05)
    assert bad > 5
