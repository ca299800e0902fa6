"""The leaders with Dynamixel motors behind a pseudo terminal, in real time: the contract of a leader, and its spec."""

from collections.abc import Iterator
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest

from weberlink.arms.contract import ArmFault, LeaderArm
from weberlink.arms.emulators.dynamixel.joint_arm import JointArmEmulator
from weberlink.hardware.emulator import PtyDevice
from weberlink.master import emulators
from weberlink.master.devices import leaders
from weberlink.master.devices.dynamixel_leader import KochLeaderOptions, OmxLeaderOptions

TICK = 0.001
GIVEN = (0.05,) * 6


@pytest.fixture(params=["koch_leader", "omx_leader"])
def arm(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[LeaderArm, JointArmEmulator, PtyDevice]]:
    emulator_class: Any = emulators.load(request.param)
    emulator = emulator_class(emulator_class.Options())
    with PtyDevice(emulator, tmp_path / "port") as device:
        driver: Any = leaders.load(request.param)
        # A host may pause longer than the watchdog of 80 ms, which is tested in virtual time.
        patient = {"rate_hz": 100.0, "timeout_ms": 100.0, "bus_watchdog_ms": 2000.0}
        leader = driver(driver.Options(port=str(tmp_path / "port"), **patient), TICK)
        yield leader, emulator, device
        leader.close()


def ticks(leader: LeaderArm, count: int) -> list[float]:
    """Run them with a torque; returns the longest call of each."""
    longest = []
    for _ in range(count):
        began = monotonic()
        leader.latest(began)
        leader.display(GIVEN, began)
        longest.append(monotonic() - began)
        sleep(TICK)
    return longest


def test_leader_is_read_displays_and_lets_go(arm: tuple[LeaderArm, JointArmEmulator, PtyDevice]) -> None:
    leader, emulator, _ = arm
    spec = leader.spec
    with pytest.raises(ArmFault, match="not open"):
        leader.latest(monotonic())
    leader.display(GIVEN, monotonic())  # no effect
    leader.open(monotonic())
    first = leader.latest(monotonic())
    assert sorted(ticks(leader, 200))[100] < TICK
    now = monotonic()
    reading = leader.latest(now)
    assert leader.latest(now) is reading
    assert len(reading.angles) == len(reading.torques) == spec.axes == 6
    assert reading.angles != first.angles  # the hand moves it
    assert reading.torques == (0.0,) * 6
    assert 0.0 <= now - reading.at < 1.0
    until = monotonic() + 5.0
    while emulator.motor_nm != pytest.approx(GIVEN, abs=0.012):  # a paused loop is stale, and fades in again
        assert monotonic() < until
        ticks(leader, 20)
    with pytest.raises(ValueError, match=f"{spec.name}: expected 6 finite values"):
        leader.display((float("nan"),) * 6, now)
    leader.close()
    leader.close()
    assert not any(emulator.torque_on)


def test_unplugged_leader_is_a_fault(arm: tuple[LeaderArm, JointArmEmulator, PtyDevice]) -> None:
    leader, _, device = arm
    leader.open(monotonic())
    device.unplug()
    until = monotonic() + 2.0
    with pytest.raises(ArmFault, match=f"^{leader.spec.name}: .*unplugged$"):
        while monotonic() < until:
            leader.latest(monotonic())
            sleep(TICK)


def test_spec_states_source_of_torques_and_watchdog() -> None:
    for name in ("koch_leader", "omx_leader"):
        driver: Any = leaders.load(name)
        spec = driver(driver.Options(), TICK).spec
        assert not spec.calibrated
        assert "data sheet" in spec.note
        calibrated = driver(driver.Options(torque_ratio=(1.1,) * 6), TICK).spec
        assert calibrated.calibrated
        assert "data sheet" not in calibrated.note
        assert spec.watchdog_s == pytest.approx(0.08)
        assert "current of their supply" in spec.note
        assert "friction" in spec.note
        assert "rotor" in spec.note
        assert spec.gripper
        assert spec.lower[-1] == 0.0


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"ids": [1, 2, 3, 4, 5, 5]}, "ids: expected 6 different ones"),
        ({"sign": [1, 1]}, "sign: expected 6 values .shoulder_pan, .*, gripper., got 2"),
        ({"torque_ratio": [0.0] * 6}, "torque_ratio: expected values from 0.1 to 10"),
        ({"baud": 57_600}, "baud: expected more: at 57600 bit/s .* write 3"),
        ({"baud": 12}, "baud: expected one of 9600"),
        ({"rate_hz": 900.0}, "rate_hz: expected 359 or less: at 1000000 bit/s"),
        ({"bus_watchdog_ms": 20.0, "timeout_ms": 20.0}, "bus_watchdog_ms: expected at least twice timeout_ms"),
        ({"lower_rad": [1.0] * 6, "upper_rad": [0.0] * 6}, "shoulder_pan: expected lower_rad below upper_rad"),
    ],
)
def test_options_that_cannot_work_are_refused(given: dict[str, Any], says: str) -> None:
    for options in (KochLeaderOptions, OmxLeaderOptions):
        with pytest.raises(ValueError, match=says):
            options.model_validate(given)
