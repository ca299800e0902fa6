"""Leader arms with servos, in virtual time: the torque on the hand, and that it ends."""

from typing import Any

import pytest

from plugins.arms.tests.benches import LEADERS, only, opened
from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import BadReply, HardwareFault

DYNAMIXEL = ("koch_leader", "omx_leader")
every_leader = pytest.mark.parametrize("name", LEADERS)


@every_leader
@pytest.mark.parametrize("axis", [0, 2, 5])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_displayed_torque_reaches_the_hand(name: str, axis: int, sign: int) -> None:
    bench = opened(name)
    torque = sign * bench.family.torque
    start = bench.angles[axis]
    bench.run(only(axis, torque), 0.5)
    assert bench.displayed[axis] == pytest.approx(torque, abs=bench.family.within)
    assert all(abs(each) < 0.01 for other, each in enumerate(bench.displayed) if other != axis)
    # The hand yields by torque over its stiffness, up to the friction of the motor.
    hand = 5.0 if name == "so101_leader" else 1.0
    assert bench.sample.angles[axis] - start == pytest.approx(torque / hand, abs=0.025)
    bench.run(bench.family.rest, 0.05)
    assert max(map(abs, bench.displayed)) < 0.01


@every_leader
@pytest.mark.parametrize("sign", [1, -1])
def test_no_command_displays_more_than_the_limit(name: str, sign: int) -> None:
    limit = {"torque_limit": 60} if name == "so101_leader" else {"max_current_ma": 200.0}
    bench = opened(name, limit)
    bench.run((sign * 100.0,) * 6, 0.05)
    most = [sign * each for each in bench.options.most]
    assert max(map(abs, bench.displayed)) <= max(map(abs, most)) * (1 + 1e-9)
    if name != "so101_leader":
        assert bench.displayed == pytest.approx(most)
        assert abs(most[-1]) == pytest.approx(0.146 * (0.2 * 1.47) ** 0.5, rel=0.01)
    else:
        assert set(bench.register("torque_limit")) == {60}


@pytest.mark.parametrize("ratio", [0.7, 1.4])
@pytest.mark.parametrize("law", [None, "motor"])
def test_a_calibrated_torque_is_the_true_one(ratio: float, law: str | None) -> None:
    options = {"torque_ratio": (ratio,) * 6, "current_law": law}
    bench = opened("koch_leader", options, constant_ratio=ratio, current_law=law)
    bench.run((0.04,) * 6, 0.05)
    assert bench.displayed == pytest.approx((0.04,) * 6, abs=4e-3)
    bench.run((1.0,) * 6, 0.05)
    assert bench.displayed == pytest.approx(bench.options.most)


@pytest.mark.parametrize("supply", [5.0, 7.4, 8.0])
def test_the_supply_of_an_so101_is_made_up_for(supply: float) -> None:
    bench = opened("so101_leader", supply_v=supply)
    bench.run(only(0, 0.3), 1.0)
    assert -bench.emulator.outside_nm[0] == pytest.approx(0.3, rel=0.15)


@every_leader
def test_a_lost_answer_ends_the_torque(name: str) -> None:
    """A Dynamixel leader bridges one, an SO-101 none: its rest goes out before late answers are awaited."""
    bench = opened(name)
    given = only(0, bench.family.torque)
    bench.run(given, 0.1)
    bench.emulator.faults.silent = True
    for left in (True, False) if name in DYNAMIXEL else (True,):
        with pytest.raises(BadReply):
            bench.exchange.exchange(given)
        bench.wait(0.002)
        assert (abs(bench.displayed[0]) > 0.5 * bench.family.torque) is left
    if name not in DYNAMIXEL:
        with pytest.raises(BadReply):
            bench.exchange.exchange(bench.family.rest)
    bench.wait(0.002)
    assert max(map(abs, bench.displayed)) < 1e-3
    bench.emulator.faults.silent = False
    bench.run(given, 0.1)
    assert bench.displayed[0] == pytest.approx(bench.family.torque, abs=bench.family.within)


@pytest.mark.parametrize("name", ["koch_leader", "omx_leader"])
def test_motors_let_go_of_a_dead_host(name: str) -> None:
    """Within 100 ms, by their watchdogs; the next session clears these."""
    bench = opened(name)
    bench.run((0.05,) * 6, 0.05)
    bench.wait(0.05)
    assert min(bench.displayed) > 0.03
    bench.wait(0.05)
    assert bench.displayed == (0.0,) * 6
    assert bench.emulator.watchdog_trips == 6
    with pytest.raises(HardwareFault, match=r"shoulder_pan \(id 1\): its bus watchdog tripped: .* 80"):
        bench.run((0.05,) * 6, 0.01)
    assert bench.displayed == (0.0,) * 6
    bench.open()  # by a host that knows nothing of the one before
    bench.run((0.05,) * 6, 0.05)
    assert bench.displayed == pytest.approx((0.05,) * 6, abs=4e-3)


def test_a_leader_carries_its_weight_after_a_ramp() -> None:
    weight = (0.0, 0.08, -0.05, 0.02, 0.0, 0.0)
    bench = opened("koch_leader", carried=lambda _: weight)
    for seconds, share in ((0.125, 0.25), (0.125, 0.5), (0.3, 1.0), (0.3, 1.0)):
        bench.run(bench.family.rest, seconds)
        assert bench.displayed == pytest.approx([share * each for each in weight], abs=6e-3)
    bench.emulator.faults.silent = True
    for _ in range(2):
        with pytest.raises(BadReply):
            bench.exchange.exchange((0.05,) * 6)
    bench.wait(0.002)
    assert bench.displayed == pytest.approx(weight, abs=6e-3), "also while answers are missing"


@pytest.mark.parametrize("name", ["koch_leader", "omx_leader"])
def test_a_wall_of_the_stated_stiffness_is_stable_in_a_hand(name: str) -> None:
    """A wall at each joint, felt a cycle and the lag of the reading late; the hand pushes 0.1 rad into it."""
    bench = opened(name, start_rad=(0.3,) * 6, hand_n_m_rad=0.5)
    seen = [bench.sample.angles]

    def wall(sample: Any) -> Joints:
        seen.append(sample.angles)
        return tuple(-k * max(0.0, q - 0.2) for q, k in zip(seen[-2], bench.options.stiffest, strict=True))

    samples = bench.run(wall, 0.8)
    for axis in range(6):
        last = [each.angles[axis] for each in samples[-50:]]
        assert max(last) - min(last) < 0.004


def test_a_pause_that_is_over_is_looked_into_as_well() -> None:
    """The thread stood still between two messages of one exchange."""
    bench = opened("koch_leader")
    bench.run((0.05,) * 6, 0.05)
    bench.wait(0.1)
    bench.exchange._servos.bus.send(b"")
    with pytest.raises(HardwareFault, match="watchdog tripped"):
        bench.exchange.exchange((0.05,) * 6)


def test_an_order_of_an_so101_is_its_torque_in_counts_within_those_of_a_turn() -> None:
    """By the stiffness of the servo 23 counts, and two for its dead zone."""
    bench = opened("so101_leader")
    exchange, present = bench.exchange, bench.exchange._present[0]
    for position, torque, goal in ((2000, 0.2, 25), (2000, -0.2, -25), (2, -0.2, -2), (4093, 0.2, 2)):
        exchange._present[0] = present._replace(position=position)
        assert exchange._order(0, torque)[2:4] == (position + goal).to_bytes(2, "little")


def test_small_torques_of_an_so101_do_not_switch_on_and_off() -> None:
    bench = opened("so101_leader")
    zone = 0.05 * bench.options.most[0]
    for share, on in ((0.98, False), (1.02, True), (0.52, True), (0.48, False), (0.98, False)):
        for sign in (1, -1):
            bench.run(only(0, sign * share * zone), 0.02)
            assert bench.torques_on[0] is on
    bench.emulator.most_motor_nm = 0.0
    bench.emulator.joints[2].push = 1.0
    bench.run(bench.family.rest, 0.5)
    assert bench.sample.angles[2] > 0.1
    assert bench.emulator.most_motor_nm == 0.0, "free motion has no torque"


def test_a_hand_that_yields_is_not_pulled_back_by_an_so101() -> None:
    bench = opened("so101_leader")
    bench.run(only(0, 0.2), 0.3)
    bench.emulator.joints[0].push = 1.0  # with the torque
    for _ in range(100):
        bench.run(only(0, 0.2), 0.005)
        assert bench.emulator.servos[0].duty >= 0.0, "no torque against the one displayed"


def test_a_message_with_torque_is_told_from_one_without() -> None:
    bench = opened("so101_leader")
    rests = bench.exchange.guardian.rests
    assert all(data.startswith(rests) for data in bench.port.sent), "opening"
    bench.run(only(3, 0.2), 0.005)
    assert not bench.port.sent[-1].startswith(rests)
    bench.run(bench.family.rest, 0.005)
    assert bench.port.sent[-1].startswith(rests)
    count = len(bench.port.sent)
    bench.exchange.close()
    assert all(data.startswith(rests) for data in bench.port.sent[count:]), "closing"


@pytest.mark.parametrize("cut", [1, 29, 57, 85])
def test_the_guardians_message_is_understood_after_a_cut_one(cut: int) -> None:
    bench = opened("so101_leader")
    bench.run((0.2,) * 6, 0.05)
    message = next(data for data in reversed(bench.port.sent) if len(data) > 80)
    bench.port.write(message[:cut])
    bench.port.write(bench.exchange.guardian.zero)
    bench.wait(0.01)
    assert not any(bench.torques_on)
