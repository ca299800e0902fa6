"""The SO-101 leader against the emulation: torque on one side only, off in free motion, and gone with its process."""

import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.arms.feetech.virtual import VirtualPort, frames
from tests.program import ROOT
from tests.wait import PATIENCE, until
from weberlink.arms.contract import ArmFault
from weberlink.arms.emulators.feetech import So101LeaderEmulator, So101LeaderEmulatorOptions
from weberlink.geometry.joints import Joints
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.fault import BadReply
from weberlink.hardware.guardian import Guardian
from weberlink.master.devices.so101_leader import LeaderExchange, So101Leader, So101LeaderOptions

PERIOD_S = 0.005
REST: Joints = (0.0,) * 6


class Held:
    """An emulated leader in a hand of this stiffness, and the exchange that drives it, in virtual time."""

    def __init__(self, options: So101LeaderOptions | None = None, stiffness: float = 5.0, supply: float = 7.4) -> None:
        still = So101LeaderEmulatorOptions(
            hand_rad=(0.0,) * 6, hand_n_m_rad=stiffness, friction_nm=0.01, supply_v=supply
        )
        self.emulator = So101LeaderEmulator(still)
        self.port = VirtualPort(self.emulator)
        self.guardian = Guardian(b"")
        self.options = options or So101LeaderOptions()
        self.exchange = LeaderExchange(self.options, lambda: self.port, self.guardian, self.port.clock, self.port.pause)
        self.sample = self.exchange.open()

    def show(self, torques: Joints, time: float) -> None:
        until_ = self.port.now + time
        while self.port.now < until_:
            began = self.port.now
            self.sample = self.exchange.exchange(torques)
            self.port.pause(max(0.0, began + PERIOD_S - self.port.now))


def only(axis: int, torque: float) -> Joints:
    return tuple(torque if number == axis else 0.0 for number in range(6))


@pytest.mark.parametrize("torque", [0.15, -0.15])
@pytest.mark.parametrize("axis", [0, 1, 5])
def test_displayed_torque_pushes_the_hand(axis: int, torque: float) -> None:
    arm = Held()
    arm.show(only(axis, torque), 1.0)
    assert arm.emulator.motor_nm[axis] == pytest.approx(torque, rel=0.3)
    assert -arm.emulator.outside_nm[axis] == pytest.approx(torque, rel=0.3)
    assert [i for i, on in enumerate(arm.emulator.torques_on) if on] == [axis]


def test_low_supply_is_made_up_for() -> None:
    arm = Held(supply=5.0)
    arm.show(only(0, 0.3), 1.0)
    assert -arm.emulator.outside_nm[0] == pytest.approx(0.3, rel=0.15)


def test_free_motion_has_no_torque() -> None:
    arm = Held()
    arm.show(only(2, 0.2), 0.3)
    arm.show(REST, 0.05)
    assert not any(arm.emulator.torques_on)
    arm.emulator.most_motor_nm = 0.0
    arm.emulator.pushes[2] = 1.0
    arm.show(REST, 0.5)
    assert arm.sample.angles[2] > 0.1
    assert arm.emulator.most_motor_nm == 0.0


def test_hand_that_yields_is_not_pulled_back() -> None:
    arm = Held()
    arm.show(only(0, 0.2), 0.3)
    arm.emulator.pushes[0] = 1.0  # with the torque
    for _ in range(100):
        arm.show(only(0, 0.2), PERIOD_S)
        assert arm.emulator.servos[0].duty >= 0.0, "no torque against the one displayed"


def test_torque_limit_bounds_any_command() -> None:
    arm = Held(So101LeaderOptions(torque_limit=60), stiffness=0.0)
    arm.emulator.pushes[0] = -0.05
    arm.show(only(0, 100.0), 0.02)
    assert arm.emulator.servos[0]["torque_limit"] == 60
    assert abs(arm.emulator.servos[0].duty) <= 0.06


def test_small_torques_do_not_switch_on_and_off() -> None:
    arm = Held()
    zone = 0.05 * arm.options.most[0]
    arm.show(only(0, 0.9 * zone), 0.05)
    assert not arm.emulator.torques_on[0]
    arm.show(only(0, 1.1 * zone), 0.05)
    arm.show(only(0, 0.7 * zone), 0.05)
    assert arm.emulator.torques_on[0]
    arm.show(only(0, 0.4 * zone), 0.05)
    assert not arm.emulator.torques_on[0]


def test_bad_reply_ends_torque_before_late_answers_are_awaited() -> None:
    arm = Held()
    arm.show(only(0, 0.2), 0.1)
    arm.emulator.inject("dead", 5)
    with pytest.raises(BadReply, match="wrist_roll"):
        arm.exchange.exchange(only(0, 0.2))
    arm.emulator.inject("dead", 0)
    sent = len(arm.port.sent)
    arm.exchange.exchange(REST)
    first = arm.port.sent[sent]
    assert first.startswith(arm.guardian.rests)
    assert [frame.code for frame in frames(first)] == [0x83]
    assert not any(arm.emulator.torques_on)


def test_guardian_tells_messages_with_torque_from_others() -> None:
    arm = Held()
    assert all(data.startswith(arm.guardian.rests) for data in arm.port.sent), "opening"
    arm.show(only(3, 0.2), PERIOD_S)
    assert not arm.port.sent[-1].startswith(arm.guardian.rests)
    arm.show(REST, PERIOD_S)
    assert arm.port.sent[-1].startswith(arm.guardian.rests)
    arm.exchange.close()
    assert all(data.startswith(arm.guardian.rests) for data in arm.port.sent[-13:]), "closing"


@pytest.mark.parametrize("cut", range(1, 88, 7))
def test_guardians_message_is_understood_after_a_cut_one(cut: int) -> None:
    arm = Held()
    arm.show((0.2,) * 6, 0.05)
    message = next(data for data in reversed(arm.port.sent) if len(data) > 80)
    arm.port.write(message[:cut])
    arm.port.write(arm.guardian.zero)
    arm.port.pause(0.01)
    arm.port.drain()
    assert not any(arm.emulator.torques_on)


def test_closing_restores_the_servos() -> None:
    arm = Held()
    arm.show(only(0, 0.2), 0.1)
    arm.exchange.close()
    arm.exchange.close()
    assert arm.port.closed
    assert not any(arm.emulator.torques_on)
    assert {servo["p_gain"] for servo in arm.emulator.servos} == {32}
    assert {servo["torque_limit"] for servo in arm.emulator.servos} == {1000}


def test_torque_is_no_newton_metre_without_calibration() -> None:
    spec = So101Leader(So101LeaderOptions(), 1e-3).spec
    assert not spec.calibrated
    assert "not calibrated" in spec.note
    assert spec.watchdog_s is None
    known = So101Leader(So101LeaderOptions(torque_per_load_nm=(1e-3,) * 6), 1e-3).spec
    assert known.calibrated
    assert known.torque_nm == pytest.approx((0.25,) * 6)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"rate_hz": 400.0}, "rate_hz: expected 2"),
        ({"ids": (1, 2, 3, 4, 5, 5)}, "six different"),
        ({"baud": 9600}, "baud: expected one of"),
        ({"torque_limit": 1000}, "torque_limit"),
        ({"lower_rad": (2.0, -1.0, -1.0, -1.0, -1.0, 0.0)}, "shoulder_pan"),
    ],
)
def test_wrong_options_are_refused(wrong: dict[str, object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        So101LeaderOptions.model_validate(wrong)


@pytest.mark.realtime
def test_leader_is_read_and_pushed_in_real_time(tmp_path: Path) -> None:
    emulator = So101LeaderEmulator(So101LeaderEmulatorOptions())
    with PtyDevice(emulator, tmp_path / "arm") as wire:
        leader = So101Leader(So101LeaderOptions(port=str(wire.path), reconnect_s=5.0), 1e-3)
        with pytest.raises(ArmFault, match="not open"):
            leader.latest(monotonic())
        leader.open(monotonic())
        assert leader.guarded
        end = monotonic() + PATIENCE
        while not emulator.torques_on[0] and monotonic() < end:
            leader.display(only(0, 0.3), monotonic())
            assert len(leader.latest(monotonic()).angles) == 6
            sleep(0.001)
        assert emulator.torques_on[0]
        until(lambda: not emulator.torques_on[0], "the torque to end without commands")
        leader.close()
    with pytest.raises(ValueError, match="finite"):
        leader.display(only(0, float("nan")), monotonic())


PUSHING = """
from sys import argv
from time import monotonic, sleep
from weberlink.master.devices.so101_leader import So101Leader, So101LeaderOptions
leader = So101Leader(So101LeaderOptions(port=argv[1], reconnect_s=5.0), 1e-3)
leader.open(monotonic())
while True:
    leader.display((0.3, 0.0, 0.0, 0.0, 0.0, 0.3), monotonic())
    leader.latest(monotonic())
    sleep(0.001)
"""


@pytest.mark.realtime
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_torque_ends_with_its_process(tmp_path: Path, number: int) -> None:
    emulator = So101LeaderEmulator(So101LeaderEmulatorOptions())
    with PtyDevice(emulator, tmp_path / "arm") as wire:
        process = subprocess.Popen([sys.executable, "-c", PUSHING, str(wire.path)], cwd=ROOT)
        try:
            until(lambda: emulator.torques_on[0] and emulator.torques_on[5], "the arm to push")
            process.send_signal(number)
            until(lambda: not any(emulator.torques_on), "the guardian")
            sleep(0.1)
            assert not any(emulator.torques_on), "nobody takes it up again"
        finally:
            process.kill()
            process.wait(PATIENCE)
