"""A leader on its bus in virtual time: torques, limits, what a dead host leaves, and complaints."""

import pytest

from tests.arms.dynamixel.benches import ArmBench, leader_bench
from weberlink.arms.dynamixel import packet, registers
from weberlink.arms.dynamixel.arm_exchange import GRAVITY_RAMP_S, model_gravity, no_gravity
from weberlink.arms.emulators.dynamixel.joint_arm import (
    JointArmEmulator,
    KochLeaderEmulator,
    KochLeaderEmulatorOptions,
    OmxLeaderEmulator,
    OmxLeaderEmulatorOptions,
)
from weberlink.arms.threaded_arm import ArmSample
from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.master.devices.dynamixel_leader import DynamixelLeaderOptions, KochLeaderOptions, OmxLeaderOptions

ZERO = (0.0,) * 6
GIVEN = (0.06, -0.06, 0.03, 0.08, -0.08, 0.05)


def koch(**options: object) -> KochLeaderEmulator:
    given = {"hand_rad": ZERO, "current_noise_ma": 0.0, **options}
    return KochLeaderEmulator(KochLeaderEmulatorOptions.model_validate(given))


def omx(**options: object) -> OmxLeaderEmulator:
    given = {"hand_rad": ZERO, "current_noise_ma": 0.0, **options}
    return OmxLeaderEmulator(OmxLeaderEmulatorOptions.model_validate(given))


def torques(emulator: JointArmEmulator) -> Joints:
    return tuple(emulator.motor_nm)


@pytest.mark.parametrize(("emulator", "options"), [(koch, KochLeaderOptions), (omx, OmxLeaderOptions)])
@pytest.mark.parametrize("law", [None, "motor"])
def test_displayed_torques_reach_the_hand(
    emulator: type[JointArmEmulator], options: type[DynamixelLeaderOptions], law: str | None
) -> None:
    bench = leader_bench(emulator(current_law=law), options.model_validate({"current_law": law}))  # type: ignore[call-arg]
    start = bench.exchange.open()
    samples = bench.run(lambda _: GIVEN, start, 0.5)
    assert torques(bench.emulator) == pytest.approx(GIVEN, abs=4e-3)  # type: ignore[arg-type]
    for before, after, torque in zip(start.angles, samples[-1].angles, GIVEN, strict=True):
        # The hand yields by torque over stiffness (1 N m/rad), up to the friction of the motor.
        assert after - before == pytest.approx(torque, abs=0.025)


def test_motor_law_on_motors_of_supply_law_displays_too_much() -> None:
    """Why the choice matters: small torques come out several times too large."""
    bench = leader_bench(koch(), KochLeaderOptions(current_law="motor"))
    bench.run(lambda _: (0.02,) * 6, bench.exchange.open(), 0.05)
    assert min(torques(bench.emulator)) > 0.06  # type: ignore[arg-type]


def test_currents_stay_within_limit() -> None:
    options = KochLeaderOptions(max_current_ma=200.0)
    bench = leader_bench(koch(), options)
    bench.run(lambda _: (1.0,) * 6, bench.exchange.open(), 0.05)
    assert torques(bench.emulator) == pytest.approx(options.most)  # type: ignore[arg-type]
    assert options.most[0] == pytest.approx(0.146 * (0.2 * 1.47) ** 0.5, rel=0.01)


def test_calibrated_torques_are_true_ones() -> None:
    options = KochLeaderOptions(torque_ratio=(0.7,) * 6)
    bench = leader_bench(koch(constant_ratio=0.7), options)
    bench.run(lambda _: (0.04,) * 6, bench.exchange.open(), 0.05)
    assert torques(bench.emulator) == pytest.approx((0.04,) * 6, abs=3e-3)  # type: ignore[arg-type]
    bench.run(lambda _: (1.0,) * 6, bench.exchange.open(), 0.05)
    assert torques(bench.emulator) == pytest.approx(options.most)  # type: ignore[arg-type]


def test_sign_and_offset_apply_to_angle_and_torque() -> None:
    options = KochLeaderOptions(sign=(-1,) * 6, offset_rad=(0.1,) * 6, lower_rad=(-3.0,) * 6, upper_rad=(3.0,) * 6)
    bench = leader_bench(koch(start_rad=(0.2,) * 6), options)
    sample = bench.run(lambda _: (0.05,) * 6, bench.exchange.open(), 0.2)[-1]
    assert sample.angles[0] == pytest.approx(0.1 - bench.emulator.angles[0], abs=2e-3)  # type: ignore[attr-defined]
    assert torques(bench.emulator)[0] == pytest.approx(-0.05, abs=4e-3)  # type: ignore[arg-type]


def test_weight_is_carried_after_ramp() -> None:
    weight = (0.0, 0.08, -0.05, 0.02, 0.0, 0.0)
    bench = leader_bench(koch(), KochLeaderOptions(), lambda _: weight)
    sample = bench.exchange.open()
    sample = bench.run(lambda _: ZERO, sample, 0.5 * GRAVITY_RAMP_S)[-1]
    assert torques(bench.emulator)[1] == pytest.approx(0.04, abs=6e-3)  # type: ignore[arg-type]
    bench.run(lambda _: ZERO, sample, 0.55 * GRAVITY_RAMP_S)
    assert torques(bench.emulator) == pytest.approx(weight, abs=4e-3)  # type: ignore[arg-type]


@pytest.mark.parametrize(("emulator", "options"), [(koch, KochLeaderOptions()), (omx, OmxLeaderOptions())])
def test_wall_of_stated_stiffness_is_stable_in_a_hand(
    emulator: type[JointArmEmulator], options: DynamixelLeaderOptions
) -> None:
    """A wall at each joint, felt a cycle and the lag of the reading late; the hand pushes 0.1 rad into it."""
    held = emulator(start_rad=(0.3,) * 6, hand_n_m_rad=0.5)  # type: ignore[call-arg]
    bench = leader_bench(held, options)
    seen: list[Joints] = []

    def wall(sample: ArmSample) -> Joints:
        seen.append(sample.angles)
        late = seen[-2] if len(seen) > 1 else seen[-1]
        return tuple(-k * max(0.0, q - 0.2) for q, k in zip(late, options.stiffest, strict=True))

    samples = bench.run(wall, bench.exchange.open(), 0.8)
    for axis in range(6):
        last = [each.angles[axis] for each in samples[-50:]]
        assert max(last) - min(last) < 0.004


def test_close_takes_torque_off() -> None:
    bench = leader_bench(koch(), KochLeaderOptions())
    bench.run(lambda _: GIVEN, bench.exchange.open(), 0.05)
    bench.exchange.close()
    assert bench.emulator.torque_on == (False,) * 6  # type: ignore[attr-defined]
    bench.wait(0.01)
    assert torques(bench.emulator) == ZERO  # type: ignore[arg-type]
    assert bench.port.closed


def test_motors_let_go_within_100_ms_of_a_dead_host() -> None:
    bench = leader_bench(koch(), KochLeaderOptions())
    sample = bench.run(lambda _: GIVEN, bench.exchange.open(), 0.05)[-1]
    bench.wait(0.05)
    assert torques(bench.emulator) != ZERO  # type: ignore[arg-type]
    bench.wait(0.05)
    assert torques(bench.emulator) == ZERO  # type: ignore[arg-type]
    assert bench.emulator.watchdog_trips == 6
    with pytest.raises(
        HardwareFault, match=r"shoulder_pan \(id 1\): its bus watchdog tripped: it heard nothing for 80"
    ):
        bench.run(lambda _: GIVEN, sample, 0.01)
    assert torques(bench.emulator) == ZERO  # type: ignore[arg-type]


def test_next_session_clears_tripped_watchdogs() -> None:
    bench = leader_bench(koch(), KochLeaderOptions())
    bench.run(lambda _: GIVEN, bench.exchange.open(), 0.05)
    bench.wait(0.2)
    bench.exchange.close()
    bench.port.closed = False
    bench.run(lambda _: GIVEN, bench.exchange.open(), 0.05)
    assert torques(bench.emulator) == pytest.approx(GIVEN, abs=4e-3)  # type: ignore[arg-type]


def test_second_missing_answer_takes_torque_off() -> None:
    bench = leader_bench(koch(), KochLeaderOptions())
    bench.run(lambda _: GIVEN, bench.exchange.open(), 0.05)
    bench.emulator.faults.silent = True
    for expected in (GIVEN, ZERO):
        with pytest.raises(BadReply):
            bench.exchange.exchange(GIVEN)
        bench.wait(0.002)
        assert torques(bench.emulator) == pytest.approx(expected, abs=4e-3)  # type: ignore[arg-type]


def _complaint(bench: ArmBench) -> str:
    with pytest.raises(HardwareFault) as caught:
        bench.exchange.open()
    assert bench.port.closed
    assert "\n" not in str(caught.value)
    assert not any(servo.torque_on for servo in bench.emulator.servos)
    return str(caught.value)


class TestComplaints:
    def test_silence_names_rate_and_supply(self) -> None:
        bench = leader_bench(koch(), KochLeaderOptions())
        bench.emulator.faults.silent = True
        assert "no motor answers at 1000000 bit/s: check the 5 V supply" in _complaint(bench)

    def test_one_missing_motor_is_named(self) -> None:
        bench = leader_bench(koch(), KochLeaderOptions())
        bench.emulator.inject("dead", 3)
        assert "elbow_flex (id 3): no answer at 1000000 bit/s, but others answer" in _complaint(bench)

    def test_other_model_is_named(self) -> None:
        bench = leader_bench(koch(), KochLeaderOptions())
        bench.emulator.inject("wrong_model", 1060)
        said = _complaint(bench)
        assert "is a XL430-W250, which cannot control its current; a Koch v1.1 leader has XL330-M077: check ids" in said

    def test_low_supply_is_named_with_its_voltage(self) -> None:
        bench = leader_bench(koch(), KochLeaderOptions())
        bench.emulator.inject("low_voltage", 1)
        assert "input voltage out of range: check the supply; it has 3.0 V now" in _complaint(bench)

    def test_low_supply_without_alarm_is_named(self) -> None:
        bench = leader_bench(koch(), KochLeaderOptions())
        bench.emulator.servos[1].registers["present_input_voltage"] = 32
        said = _complaint(bench)
        assert said == "shoulder_lift (id 2): has a supply of 3.2 V and needs 3.5 to 7.0 V: check the 5 V supply"

    @pytest.mark.parametrize("offset", [2.0, -3.0])
    def test_wrong_zero_is_named(self, offset: float) -> None:
        bench = leader_bench(koch(), KochLeaderOptions(offset_rad=(0.0, offset, 0.0, 0.0, 0.0, 0.0)))
        assert f"shoulder_lift (id 2): stands at {offset:.2f} rad, outside its range of -1.57" in _complaint(bench)

    def test_overload_in_session_is_named(self) -> None:
        bench = leader_bench(koch(), KochLeaderOptions())
        sample = bench.run(lambda _: ZERO, bench.exchange.open(), 0.1)[-1]
        bench.emulator.inject("overload", 4)
        with pytest.raises(HardwareFault, match=r"^wrist_flex \(id 4\): overload"):
            bench.run(lambda _: ZERO, sample, 0.1)


def test_requests_of_a_cycle_are_one_sync_read_and_one_sync_write() -> None:
    bench = leader_bench(koch(), KochLeaderOptions())
    sample = bench.exchange.open()
    bench.port.sent.clear()
    bench.run(lambda _: ZERO, sample, 5 / 250)
    counts = [(each.instruction, each.id) for each in bench.port.sent]
    assert counts == [(packet.SYNC_READ, packet.BROADCAST), (packet.SYNC_WRITE, packet.BROADCAST)] * 5
    assert bench.port.sent[0] == packet.sync_read(registers.PRESENT_ADDRESS, registers.PRESENT_SIZE, range(1, 7))


def test_two_runs_are_the_same() -> None:
    runs = []
    for _ in range(2):
        bench = leader_bench(koch(hand_rad=(0.3,) * 6, current_noise_ma=3.0), KochLeaderOptions())
        runs.append(bench.run(lambda s: tuple(-0.1 * q for q in s.angles), bench.exchange.open(), 0.15))
    assert runs[0] == runs[1]
    assert runs[0][0].angles != runs[0][-1].angles


@pytest.mark.parametrize("compensated", [True, False])
def test_model_carries_the_weight_of_a_released_arm(compensated: bool) -> None:
    pytest.importorskip("mujoco")
    start = (0.0, 0.6, 0.3, 0.2, 0.0, 0.5)
    bench = leader_bench(
        omx(gravity=True, hand_n_m_rad=0.5, start_rad=start),
        OmxLeaderOptions(gravity=True, max_current_ma=1000.0),
        model_gravity("omx_leader") if compensated else no_gravity,
    )
    sample = bench.run(lambda _: ZERO, bench.exchange.open(), 1.0)[-1]
    sag = max(abs(angle - begun) for angle, begun in zip(sample.angles[:5], start[:5], strict=True))
    assert (sag < 0.06) is compensated
