"""The SO-101 follower against the emulation: it goes where told, tells what it touches, and is left as asked."""

from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.arms.feetech.virtual import VirtualPort
from tests.wait import PATIENCE
from weberlink.arms.contract import ArmFault
from weberlink.arms.emulators.feetech import (
    FRICTION_NM,
    FeetechEmulator,
    FeetechEmulatorOptions,
    So101FollowerEmulator,
    Wall,
)
from weberlink.arms.feetech.arm import NAMES
from weberlink.geometry.joints import Joints
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.fault import HardwareFault
from weberlink.slave.robots.so101_follower import (
    FollowerExchange,
    OnClose,
    So101Follower,
    So101FollowerOptions,
    no_gravity,
)

PERIOD_S = 0.005
START: Joints = (0.0, 0.0, 0.0, 0.0, 0.0, 0.96)
GOAL: Joints = (0.3, -0.2, 0.4, 0.1, -0.5, 1.5)


class Arm:
    """An emulated follower, and the exchange that drives it, in virtual time."""

    def __init__(
        self,
        options: So101FollowerOptions | None = None,
        emulated: FeetechEmulatorOptions | None = None,
        gravity: Callable[[Joints], Joints] = no_gravity,
    ) -> None:
        self.emulator = FeetechEmulator(emulated)
        self.port = VirtualPort(self.emulator)
        self.exchange = FollowerExchange(
            options or So101FollowerOptions(), lambda: self.port, gravity, self.port.clock, self.port.pause
        )
        self.sample = self.exchange.open()

    def go(self, angles: Joints | None, time: float) -> None:
        until = self.port.now + time
        while self.port.now < until:
            began = self.port.now
            self.sample = self.exchange.exchange(angles)
            self.port.pause(max(0.0, began + PERIOD_S - self.port.now))


def test_it_goes_to_the_angles_and_stays() -> None:
    arm = Arm()
    arm.go(GOAL, 1.5)
    assert arm.emulator.angles == pytest.approx(GOAL, abs=0.02)
    assert arm.sample.angles == pytest.approx(arm.emulator.angles, abs=2e-3)
    assert arm.sample.torques == pytest.approx((0.0,) * 6, abs=0.02)
    arm.go(None, 0.5)
    assert arm.emulator.angles == pytest.approx(GOAL, abs=0.02)


def test_opening_does_not_jump() -> None:
    arm = Arm()
    arm.go(None, 0.5)
    assert arm.emulator.torques_on == [True] * 6
    assert arm.emulator.angles == pytest.approx(START, abs=0.01)


@pytest.mark.parametrize("below", [False, True])
def test_wall_is_told_within_the_stated_error(below: bool) -> None:
    wall = Wall(joint="elbow_flex", angle_rad=-0.2 if below else 0.2, below=below)
    arm = Arm(emulated=FeetechEmulatorOptions(walls=(wall,)))
    arm.go((0.0, 0.0, -0.5 if below else 0.5, 0.0, 0.0, 0.96), 1.5)
    true = arm.emulator.outside_nm[2]
    assert (true > 0.5) if below else (true < -0.5)
    assert arm.sample.torques[2] == pytest.approx(
        true, abs=So101Follower(So101FollowerOptions(), 1e-3).spec.torque_error_nm
    )
    assert abs(arm.sample.torques[2]) <= abs(true), "the friction is not taken for contact"


@pytest.mark.parametrize("calibrated", [None, (1.91 / 2.7,) * 6])
def test_current_tells_the_torque_where_calibrated(calibrated: tuple[float, ...] | None) -> None:
    options = So101FollowerOptions.model_validate({"torque_per_amp_nm": calibrated, "friction_nm": (0.0,) * 6})
    arm = Arm(options)
    arm.emulator.pushes[1] = 0.4
    arm.go(START, 1.5)
    assert arm.sample.torques[1] == pytest.approx(0.4, abs=0.07)


def test_weight_is_carried_and_not_taken_for_contact() -> None:
    pytest.importorskip("mujoco")
    from weberlink.arms.models import load  # noqa: PLC0415

    arm = Arm(emulated=FeetechEmulatorOptions(weight=True), gravity=load("so101").gravity)
    stretched = (0.0, 1.2, -1.2, 0.0, 0.0, 0.96)
    arm.go(stretched, 2.0)
    assert abs(load("so101").gravity(arm.sample.angles)[1]) > 0.4
    assert arm.sample.torques == pytest.approx((0.0,) * 6, abs=0.02)
    assert arm.sample.angles == pytest.approx(stretched, abs=0.02)
    arm.exchange.close()
    before = arm.emulator.angles
    arm.port.pause(1.0)
    arm.emulator.advance(arm.port.now)
    assert arm.emulator.angles == pytest.approx(before, abs=0.02)


def test_angles_beyond_the_range_are_not_commanded() -> None:
    arm = Arm()
    arm.go((9.0, -9.0, 0.0, 0.0, 0.0, -3.0), 3.0)
    assert arm.emulator.angles[:2] == pytest.approx([1.92, -1.745], abs=0.02)
    assert arm.emulator.angles[5] == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(("weight", "count"), [(-900.0, 0), (900.0, 4095)])
def test_goals_stay_on_the_turn_of_the_encoder(weight: float, count: int) -> None:
    """A goal beyond it, here by what the weight takes, is another number to the servo."""
    arm = Arm(gravity=lambda _: (weight,) * 6)
    arm.exchange.exchange(START)
    assert [servo["goal_position"] for servo in arm.emulator.servos] == [count] * 6


def test_servo_without_power_is_noticed() -> None:
    arm = Arm()
    arm.go(START, 0.2)
    arm.emulator.servos[3].write(40, b"\0")
    with pytest.raises(HardwareFault, match=r"wrist_flex \(id 4\): its torque is off; was it without power"):
        arm.go(START, 2.0)


def test_overload_is_said() -> None:
    arm = Arm(emulated=FeetechEmulatorOptions(walls=(Wall(joint="elbow_flex", angle_rad=0.1, stiffness_nm_rad=200.0),)))
    with pytest.raises(HardwareFault, match=r"elbow_flex \(id 3\): overload: it pushed too hard for too long"):
        arm.go((0.0, 0.0, 1.6, 0.0, 0.0, 0.96), 5.0)


@pytest.mark.parametrize("on_close", list(OnClose))
def test_it_is_left_as_asked(on_close: OnClose) -> None:
    arm = Arm(So101FollowerOptions(on_close=on_close, p_gain=20))
    arm.go(GOAL, 1.0)
    arm.exchange.close()
    arm.exchange.close()
    holds = on_close is OnClose.HOLD
    assert arm.emulator.torques_on == [holds] * 6
    assert {servo["p_gain"] for servo in arm.emulator.servos} == {20 if holds else 32}


def pressing(axis: int, wall: float, gravity: Callable[[Joints], Joints], **options: object) -> Arm:
    """A heavy arm that presses on a wall with an axis."""
    at = START[axis] + 0.2
    walls = (Wall(joint=NAMES[axis], angle_rad=at, stiffness_nm_rad=wall),)
    arm = Arm(
        So101FollowerOptions.model_validate(options),
        FeetechEmulatorOptions(walls=walls, weight=gravity is not no_gravity),
        gravity,
    )
    arm.go(tuple(at + 0.4 if each == axis else angle for each, angle in enumerate(START)), 1.2)
    return arm


def pushed_by(arm: Arm, axis: int) -> float:
    """Torque of an axis on its wall, beyond what dry friction of the gears keeps up [N m]."""
    arm.emulator.advance(arm.port.now)
    return max(0.0, -arm.emulator.outside_nm[axis] - FRICTION_NM)


@pytest.mark.parametrize("stiffness", [20.0, 200.0])
@pytest.mark.parametrize("axis", [0, 1, 2, 5])
@pytest.mark.parametrize("is_modelled", [False, True])
def test_hold_on_close_pushes_on_nothing(axis: int, stiffness: float, is_modelled: bool) -> None:
    gravity = no_gravity
    if is_modelled:
        pytest.importorskip("mujoco")
        from weberlink.arms.models import load  # noqa: PLC0415

        gravity = load("so101").gravity
    arm = pressing(axis, stiffness, gravity)
    before = pushed_by(arm, axis)
    assert before > 0.8
    arm.exchange.close()
    angles = arm.emulator.angles
    for _ in range(10):
        arm.port.pause(0.5)
        assert pushed_by(arm, axis) < 0.02 * before
    assert arm.emulator.angles == pytest.approx(angles, abs=0.02)
    assert arm.emulator.torques_on == [True] * 6


@pytest.mark.parametrize("dead", [1, 4])
def test_servo_that_is_dead_does_not_keep_the_others_pushing(dead: int) -> None:
    arm = pressing(2, 200.0, no_gravity)
    arm.emulator.inject("dead", dead)
    with pytest.raises(HardwareFault, match="missing"):
        arm.go(START, 1.0)
    arm.exchange.close()
    arm.port.pause(0.5)
    assert pushed_by(arm, 2) < 0.1


def test_overloaded_servo_pushes_on_nothing_after_close() -> None:
    arm = pressing(2, 200.0, no_gravity)
    arm.emulator.inject("overload", 3)
    with pytest.raises(HardwareFault, match="overload"):
        arm.go((0.0, 0.0, 0.6, 0.0, 0.0, 0.96), 0.2)
    arm.port.pause(0.5)
    assert pushed_by(arm, 2) > 0.2
    arm.exchange.close()
    arm.port.pause(0.5)
    assert pushed_by(arm, 2) < 0.02


def test_spec_says_what_is_uncertain() -> None:
    spec = So101Follower(So101FollowerOptions(gravity=False), 1e-3).spec
    assert not spec.calibrated
    assert "not calibrated" in spec.note
    assert "weight is not subtracted" in spec.note
    assert spec.torque_error_nm > 0.9
    known = So101Follower(So101FollowerOptions(torque_per_load_nm=(2e-3,) * 6), 1e-3).spec
    assert known.calibrated
    assert known.torque_error_nm < spec.torque_error_nm


@pytest.mark.realtime
def test_follower_moves_in_real_time_and_tells_that_it_is_gone(tmp_path: Path) -> None:
    emulator = So101FollowerEmulator()
    with PtyDevice(emulator, tmp_path / "arm") as wire:
        arm = So101Follower(So101FollowerOptions(port=str(wire.path), gravity=False, reconnect_s=1.0), 1e-3)
        arm.open(monotonic())
        end = monotonic() + PATIENCE
        while abs(emulator.angles[0] - 0.3) > 0.02 and monotonic() < end:
            arm.follow(GOAL, monotonic())
            reading = arm.latest(monotonic())
            sleep(0.001)
        assert emulator.angles[0] == pytest.approx(0.3, abs=0.02)
        assert len(reading.angles) == len(reading.torques) == 6
        wire.unplug()
        with pytest.raises(ArmFault, match=r"so101_follower: .*no such port"):
            while monotonic() < end:
                arm.latest(monotonic())
                sleep(0.01)
        arm.close()
