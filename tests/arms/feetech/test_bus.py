"""The bus and the servos of an arm against the emulation: what is found, changed and set back, and what is said."""

from collections.abc import Callable

import pytest

from tests.arms.feetech.virtual import VirtualPort
from weberlink.arms.emulators.feetech import FeetechEmulator, FeetechEmulatorOptions
from weberlink.arms.feetech import registers
from weberlink.arms.feetech.arm import NAMES, So101Options, motor_torques
from weberlink.arms.feetech.exchange import So101Bus
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.slave.robots.so101_follower import So101FollowerOptions

OPTIONS = So101FollowerOptions()


def opened(port: VirtualPort, options: So101Options = OPTIONS) -> So101Bus:
    return So101Bus(options, port, port.clock, port.pause)


@pytest.fixture
def port() -> VirtualPort:
    return VirtualPort(FeetechEmulator())


def test_all_servos_are_measured_at_once(port: VirtualPort) -> None:
    arm = opened(port)
    arm.servos.prepare(16)
    before, sent = port.now, len(port.sent)
    present = arm.first()
    assert len(port.sent) == sent + 1
    assert port.now - before < 2.5e-3
    assert [each.voltage for each in present] == [74] * 6
    assert arm.scale.angles(present) == pytest.approx((0.0, 0.0, 0.0, 0.0, 0.0, 0.96), abs=1e-3)


def test_angles_and_counts_are_inverse(port: VirtualPort) -> None:
    options = So101FollowerOptions(sign=(1, -1, 1, -1, 1, 1), offset_rad=(0.1, 0.2, 0.0, 0.0, -0.3, 0.0))
    scale = opened(port, options).scale
    counts = scale.counts((0.3, -0.4, 0.5, 0.6, -0.7, 0.8))
    present = [each._replace(position=count) for each, count in zip(opened(port).first(), counts, strict=True)]
    assert scale.angles(present) == pytest.approx((0.3, -0.4, 0.5, 0.6, -0.7, 0.8), abs=1e-3)


def set_id(port: VirtualPort) -> None:
    port.emulator.servos[2]["id"] = 9


FAULTS: list[tuple[str, Callable[[VirtualPort], object], str]] = [
    ("silent", lambda port: setattr(port.emulator.faults, "silent", True), "no servo answers at 1000000 bit/s"),
    ("missing", lambda port: port.emulator.inject("dead", 3), r"elbow_flex \(id 3\): no answer, but others answer"),
    ("wrong id", set_id, r"elbow_flex \(id 3\): no answer, but others answer: check the cable to it, and its id"),
    ("wrong model", lambda port: port.emulator.inject("wrong_model", 2825), r"shoulder_pan \(id 1\): is model 2825"),
    ("voltage", lambda port: port.emulator.inject("supply", 12.0), r"shoulder_pan \(id 1\): its supply of 12\.0 V"),
    (
        "overload",
        lambda port: port.emulator.inject("overload", 4),
        r"wrist_flex \(id 4\): overload: it pushed too hard",
    ),
]


@pytest.mark.parametrize(("cause", "says"), [each[1:] for each in FAULTS], ids=[each[0] for each in FAULTS])
def test_unusable_arm_is_said_in_one_line(port: VirtualPort, cause: Callable[[VirtualPort], object], says: str) -> None:
    cause(port)
    with pytest.raises(HardwareFault, match=says) as fault:
        opened(port)
    assert "\n" not in str(fault.value)


def test_uncalibrated_gripper_is_said() -> None:
    with pytest.raises(HardwareFault, match="gripper: its range is not calibrated; calibrate the arm"):
        opened(VirtualPort(FeetechEmulator(FeetechEmulatorOptions(calibrated=False))))


def test_impossible_angle_is_said() -> None:
    options = FeetechEmulatorOptions(start_rad=(0.0, 0.0, 2.5, 0.0, 0.0, 0.0))
    with pytest.raises(HardwareFault, match=r"elbow_flex: stands at 2\.\d\d rad, where it cannot be"):
        opened(VirtualPort(FeetechEmulator(options)))


def test_wrong_checksum_is_a_bad_reply(port: VirtualPort) -> None:
    arm = opened(port)
    port.emulator.faults.garble = 1
    with pytest.raises(BadReply, match=r"shoulder_pan \(id 1\): its answer was garbled \(wrong checksum\)"):
        arm.bus.exchange()
    assert len(arm.bus.exchange()) == len(NAMES)


def test_late_answers_are_not_taken_for_newer_ones(port: VirtualPort) -> None:
    arm = opened(port)
    servo = port.emulator.servos[0]
    port.emulator.inject("dead", 6)
    with pytest.raises(BadReply, match=r"gripper \(id 6\): its answer was missing"):
        arm.bus.exchange()
    servo.angle = 0.5
    port.emulator.inject("dead", 0)
    assert arm.scale.angles(arm.bus.exchange())[0] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("volts", [5.0, 7.4, 12.0])
def test_the_torque_of_a_duty_follows_the_supply(volts: float) -> None:
    still = [registers.Present(2048, 0, 500, round(10.0 * volts), 30, 0)] * 6
    torques = motor_torques(still, (0.0,) * 6, OPTIONS, (0.002,) * 6)
    assert torques == pytest.approx([sign * 500 * 0.002 * volts / OPTIONS.rated_v for sign in OPTIONS.sign])


def test_settings_last_until_set_back(port: VirtualPort) -> None:
    arm = opened(port)
    saved = [bytes(servo.memory[:40]) for servo in port.emulator.servos]
    port.emulator.servos[3].write(33, b"\1")
    arm.servos.prepare(12)
    for servo in port.emulator.servos:
        assert (servo["p_gain"], servo["mode"], servo["lock"]) == (12, 0, 1)
        servo["torque_limit"] = 40
    arm.release()
    for servo, before in zip(port.emulator.servos, saved, strict=True):
        assert (servo["p_gain"], servo["torque_limit"], servo.torque_on) == (32, 1000, False)
        servo.restart()
        assert bytes(servo.memory[:40]) == before, "the EEPROM is not worn"
