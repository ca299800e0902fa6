"""The followers with Dynamixel motors behind a pseudo terminal, in real time: the contract of a follower, and spec."""

from collections.abc import Iterator
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest

from weberlink.arms.contract import ArmFault, FollowerArm
from weberlink.arms.emulators.dynamixel.arm import ArmEmulator
from weberlink.hardware.emulator import PtyDevice
from weberlink.slave import emulators
from weberlink.slave.robots import followers
from weberlink.slave.robots.dynamixel_follower import KochFollowerOptions, OpenManipulatorXOptions

TICK = 0.001


@pytest.fixture(params=["koch_follower", "open_manipulator_x"])
def arm(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[FollowerArm, ArmEmulator, PtyDevice]]:
    emulator_class: Any = emulators.load(request.param)
    emulator = emulator_class(emulator_class.Options())
    with PtyDevice(emulator, tmp_path / "port") as device:
        driver: Any = followers.load(request.param)
        # A host may pause longer than the watchdog of 80 ms, which is tested in virtual time.
        patient = {"rate_hz": 100.0, "timeout_ms": 100.0, "bus_watchdog_ms": 2000.0}
        follower = driver(driver.Options(port=str(tmp_path / "port"), **patient), TICK)
        yield follower, emulator, device
        follower.close()


def test_follower_follows_and_holds_at_the_end(arm: tuple[FollowerArm, ArmEmulator, PtyDevice]) -> None:
    follower, emulator, _ = arm
    with pytest.raises(ArmFault, match="not open"):
        follower.latest(monotonic())
    follower.open(monotonic())
    start = follower.latest(monotonic()).angles
    goal = (start[0] + 0.2, *start[1:])
    longest = []
    until = monotonic() + 4.0
    while (reading := follower.latest(monotonic())).angles[0] < start[0] + 0.15 and monotonic() < until:
        began = monotonic()
        follower.follow(goal, began)
        longest.append(monotonic() - began)
        sleep(TICK)
    assert reading.angles[0] > start[0] + 0.15
    assert len(reading.angles) == len(reading.torques) == follower.spec.axes
    assert sorted(longest)[len(longest) // 2] < TICK
    with pytest.raises(ValueError, match="finite values"):
        follower.follow((float("inf"),) * follower.spec.axes, monotonic())
    follower.close()
    assert all(servo.torque_on for servo in emulator.servos)


def test_unplugged_follower_is_a_fault(arm: tuple[FollowerArm, ArmEmulator, PtyDevice]) -> None:
    follower, _, device = arm
    follower.open(monotonic())
    device.unplug()
    until = monotonic() + 2.0
    with pytest.raises(ArmFault, match=f"^{follower.spec.name}: .*unplugged$"):
        while monotonic() < until:
            follower.latest(monotonic())
            sleep(TICK)


def test_spec_states_error_of_each_axis() -> None:
    koch: Any = followers.load("koch_follower")
    spec = koch(koch.Options(), TICK).spec
    assert spec.torque_error_nm == pytest.approx(max(KochFollowerOptions().torque_error))
    assert "shoulder_pan and shoulder_lift measure no current" in spec.note
    with_model = KochFollowerOptions(gravity=True).torque_error
    assert all(a <= b for a, b in zip(with_model, KochFollowerOptions().torque_error, strict=True))
    large: Any = followers.load("open_manipulator_x")
    spec = large(large.Options(), TICK).spec
    assert "no current" not in spec.note
    assert spec.joints == ("joint1", "joint2", "joint3", "joint4")
    assert spec.axes == 5


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"p_gain": [100] * 4}, "p_gain: expected 6 values from 0 to 16383"),
        ({"p_gain": [20_000] * 6}, "p_gain: expected 6 values from 0 to 16383"),
        ({"dead_zone_nm": [-1.0] * 6}, "dead_zone_nm"),
    ],
)
def test_options_that_cannot_work_are_refused(given: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        KochFollowerOptions.model_validate(given)


def test_closed_gripper_of_open_manipulator_is_at_zero() -> None:
    options = OpenManipulatorXOptions()
    closed = options.positions((0.0, 0.0, 0.0, 0.0, 0.0))[-1]
    assert closed == pytest.approx(2048 + 0.92 / (2 * 3.14159265) * 4096, abs=1)
    assert options.angles([2048] * 5)[-1] == pytest.approx(0.92)
