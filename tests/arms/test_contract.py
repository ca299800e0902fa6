"""The contract of every leader and follower arm, those with servos against emulated arms behind a pseudo terminal."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from math import inf, nan, pi
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests.wait import until
from weberlink.arms.contract import ArmFault
from weberlink.geometry.joints import is_finite
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.emulators import EMULATORS
from weberlink.master.devices import leaders
from weberlink.master.devices.remote_link import LeaderTarget
from weberlink.slave.robots import followers
from weberlink.testing.time import TICK, real_time, virtual_time

LEADS = {"koch_leader", "omx_leader", "so101_leader", "arm_operator", "remote_leader"}
REMOTE = {"joints": ("pan", "lift"), "gripper": True, "lower_rad": (-1.0, -1.5, 0.0), "upper_rad": (1.0, 1.5, 1.2)}
REQUIRED: dict[str, dict[str, Any]] = {
    "arm_operator": {"model": "so101", "script": [{"motion": "move", "joints_rad": [0.3] * 5, "duration_s": 0.2}]},
    "remote_leader": REMOTE,
}
DYNAMIXEL = ("koch_leader", "omx_leader", "koch_follower", "open_manipulator_x")
SO101 = ("so101_leader", "so101_follower")


class Device(NamedTuple):
    """An arm on a bench; `wire` is None for one that is computed."""

    arm: Any
    tick: Callable[[], float]
    wire: PtyDevice | None = None


class Program:
    """Leads a remote leader, a milliradian a tick."""

    def open(self, axes: int) -> None:
        self.angle = 0.0

    def newest(self) -> LeaderTarget:
        self.angle = min(0.3, self.angle + 1e-3)
        return LeaderTarget((self.angle, 0.0, 0.0), True)

    def close(self) -> None: ...


def made(name: str, **options: Any) -> Any:
    """Not open."""
    driver: Any = (leaders if name in LEADS else followers).load(name)
    return driver(driver.Options.model_validate(REQUIRED.get(name, {}) | options), TICK)


@contextmanager
def computed(name: str, folder: Path) -> Iterator[Device]:
    arm = made(name)
    if name == "remote_leader":
        arm._source = Program()
    yield Device(arm, virtual_time())


@contextmanager
def emulated(name: str, folder: Path) -> Iterator[Device]:
    """In real time: only so are the thread of the driver, the port and the loss of it seen."""
    emulator_class: Any = EMULATORS.load(name)
    # A host may pause for longer than a watchdog, which is tested in virtual time.
    patient: dict[str, Any] = {"timeout_ms": 100.0, "rate_hz": 50.0}
    patient |= {"bus_watchdog_ms": 2000.0} if name in DYNAMIXEL else {}
    with PtyDevice(emulator_class(emulator_class.Options()), folder / "port") as wire:
        arm = made(name, port=str(folder / "port"), **patient)
        yield Device(arm, real_time(), wire)
        arm.close()


BENCHES: dict[str, Callable[[str, Path], AbstractContextManager[Device]]] = {
    **dict.fromkeys(("mujoco_arm", "arm_operator", "remote_leader"), computed),
    **dict.fromkeys((*DYNAMIXEL, *SO101), emulated),
}
every_arm = pytest.mark.parametrize("name", sorted(BENCHES))


def command(device: Device, values: Any) -> None:
    give = device.arm.display if device.arm.spec.name in LEADS else device.arm.follow
    give(values, device.tick())


def test_every_built_in_driver_has_a_bench() -> None:
    assert set(BENCHES) == set(leaders.BUILT_IN) | set(followers.BUILT_IN)
    assert set(leaders.BUILT_IN) == LEADS


@every_arm
def test_the_spec_is_there_before_opening(name: str) -> None:
    spec = made(name).spec
    assert spec.name == name
    assert 1 <= len(spec.joints) <= 8
    assert len(set(spec.joints)) == len(spec.joints)
    assert spec.axes == len(spec.joints) + 1, "all have a gripper, the last axis"
    tuples = (spec.lower, spec.upper, spec.torque_nm, spec.stiffness_nm_rad)
    assert {len(values) for values in tuples} == {spec.axes}
    assert all(low < high for low, high in zip(spec.lower, spec.upper, strict=True))
    assert spec.lower[-1] <= 0.0 < spec.upper[-1], "0 is closed"
    assert all(torque > 0.0 for torque in spec.torque_nm) or name == "remote_leader"
    assert spec.force_feedback is (name != "remote_leader")
    assert all(stiffness > 0.0 for stiffness in spec.stiffness_nm_rad)
    assert spec.rate_hz == {**dict.fromkeys(DYNAMIXEL, 250.0), **dict.fromkeys(SO101, 200.0)}.get(name, 1.0 / TICK)
    assert spec.buttons == (name == "remote_leader")
    assert "\n" not in spec.note
    if name in DYNAMIXEL + SO101:
        assert 1.0 / spec.rate_hz < spec.lag_s < 2.5 / spec.rate_hz
        assert spec.torque_error_nm > 0.0 or name in LEADS
        assert spec.note
    else:
        assert (spec.lag_s, spec.torque_error_nm, spec.watchdog_s, spec.calibrated) == (0.0, 0.0, 0.0, True)


@pytest.mark.parametrize("name", DYNAMIXEL + SO101)
def test_the_spec_follows_the_options(name: str) -> None:
    plain = made(name).spec
    count = plain.axes
    fast = made(name, rate_hz=100.0).spec
    assert fast.lag_s - plain.lag_s == pytest.approx(1.0 / 100.0 - 1.0 / plain.rate_hz)
    known = {"torque_per_load_nm": (4e-3,) * 6} if name in SO101 else {"torque_ratio": (1.5,) * count}
    calibrated = made(name, **known).spec
    assert (plain.calibrated, calibrated.calibrated) == (False, True)
    assert all(b > a for a, b in zip(plain.torque_nm, calibrated.torque_nm, strict=True))
    watchdogs = {80.0: 0.08, 81.0: 0.1, 100.0: 0.1} if name in DYNAMIXEL else {}
    for asked, kept in watchdogs.items():
        assert made(name, bus_watchdog_ms=asked).spec.watchdog_s == pytest.approx(kept)
    assert name in DYNAMIXEL or plain.watchdog_s is None
    lower = (-1.0,) * (count - 1) + (0.0,)
    assert made(name, lower_rad=lower, upper_rad=(1.0,) * count).spec.lower == lower
    if name not in LEADS:
        heavy = made(name, gravity=False).spec
        assert heavy.torque_error_nm >= plain.torque_error_nm
        assert made(name, gravity=True).spec.torque_error_nm <= heavy.torque_error_nm


@every_arm
def test_life_of_an_arm(name: str, tmp_path: Path) -> None:
    with BENCHES[name](name, tmp_path) as device:
        arm, tick = device.arm, device.tick
        axes = arm.spec.axes
        rest = tuple(min(max(0.0, low), high) for low, high in zip(arm.spec.lower, arm.spec.upper, strict=True))
        arm.close()
        for _ in range(2):  # a second session is like the first
            with pytest.raises(ArmFault, match=f"^{name}.* not open"):
                arm.latest(tick())
            if name != "arm_operator":  # that knows its hand only while it is open
                command(device, rest)  # no effect
            arm.open(tick())
            first = arm.latest(tick())
            goal = (first.angles[0] + 0.25, *first.angles[1:]) if name not in LEADS else (0.01,) * axes
            before = first.at

            def moved(goal: Any = goal, first: Any = first) -> bool:
                nonlocal before
                command(device, goal)
                now = tick()
                reading = arm.latest(now)
                assert arm.latest(now) == reading
                assert before <= reading.at <= now
                assert len(reading.angles) == len(reading.torques) == axes
                assert is_finite(reading.angles)
                assert is_finite(reading.torques)
                before = reading.at
                return abs(reading.angles[0] - first.angles[0]) > 0.15

            until(moved, "the arm to move", pause=0.0)
            for value in (nan, inf, -inf):
                with pytest.raises(ValueError, match="finite"):
                    command(device, (*goal[:-1], value))
            if name != "remote_leader":
                with pytest.raises(ValueError, match=str(axes)):
                    command(device, (*goal, 0.0))
            command(device, goal)
            arm.close()
            arm.close()
            if device.wire is not None:
                emulator: Any = device.wire.emulator
                assert [servo.torque_on for servo in emulator.servos] == [name not in LEADS] * axes


@pytest.mark.parametrize("name", DYNAMIXEL + SO101)
def test_an_unplugged_arm_is_a_fault(name: str, tmp_path: Path) -> None:
    with BENCHES[name](name, tmp_path) as device:
        device.arm.open(device.tick())
        device.arm.latest(device.tick())
        assert device.wire is not None
        device.wire.unplug()
        with pytest.raises(ArmFault, match=f"^{name}: (?!{name}).*(unplugged|no such port)"):
            until(lambda: device.arm.latest(device.tick()) is None, "the fault", pause=0.0)
        device.arm.close()
        with pytest.raises(ArmFault, match=f"^{name}: .*no such port"):
            device.arm.open(device.tick())
        assert device.arm.guarded is (name == "so101_leader")


COMMON: list[tuple[dict[str, Any], str]] = [
    ({"bus_watchdog_ms": 40.0, "timeout_ms": 20.0}, ""),
    ({"bus_watchdog_ms": 39.9, "timeout_ms": 20.0}, "bus_watchdog_ms"),
    ({"sign": [1, 1]}, "sign"),
    ({"sign": 0}, "sign"),
    ({"torque_ratio": 0.1}, ""),
    ({"torque_ratio": 0.09}, "torque_ratio"),
    ({"torque_ratio": 10.0}, ""),
    ({"torque_ratio": 10.1}, "torque_ratio"),
    ({"offset_rad": 6.3}, "shoulder_pan|joint1"),
]
EACH = ("sign", "torque_ratio", "offset_rad", "lower_rad", "upper_rad", "dead_zone_nm", "p_gain", "ids")
"""Options with a value for each axis; a number in the tables stands for all of them."""
MOST_HZ = {
    "koch_leader": 359, "omx_leader": 359, "koch_follower": 344, "open_manipulator_x": 380, "so101_leader": 274,
    "so101_follower": 316,
}  # fmt: skip
OPTIONS: list[tuple[str, dict[str, Any], str]] = [
    *[(name, {"rate_hz": float(most)}, "") for name, most in MOST_HZ.items()],
    *[(name, {"rate_hz": most + 1.0}, "rate_hz") for name, most in MOST_HZ.items()],
    *[(name, {"baud": baud}, "baud") for name in MOST_HZ for baud in (12, 1_000_001)],
    *[(name, {"baud": 57_600, "rate_hz": 50.0}, "baud") for name in DYNAMIXEL],
    *[(name, {"lower_rad": 1.0, "upper_rad": 1.0}, "shoulder_pan|joint1") for name in MOST_HZ],
    *[(name, {"upper_rad": 6.29}, "shoulder_pan|joint1") for name in MOST_HZ],
    *[(name, {"lower_rad": -6.29}, "shoulder_pan|joint1") for name in MOST_HZ],
    *[(name, {"lower_rad": -2.0 * pi, "upper_rad": 2.0 * pi}, "") for name in MOST_HZ],
    *[(name, *case) for name in DYNAMIXEL for case in COMMON],
    ("koch_leader", {"ids": [1, 2, 3, 4, 5, 5]}, "ids"),
    ("koch_leader", {"ids": [0, 2, 3, 4, 5, 252]}, ""),
    ("koch_leader", {"ids": [1, 2, 3, 4, 5, 253]}, "ids"),
    ("so101_leader", {"ids": [0, 2, 3, 4, 5, 253]}, ""),
    ("so101_leader", {"ids": [1, 2, 3, 4, 5, 254]}, "ids"),
    ("so101_leader", {"torque_limit": 251}, "torque_limit"),
    ("koch_follower", {"p_gain": 16_383}, ""),
    ("koch_follower", {"p_gain": 16_384}, "p_gain"),
    ("koch_follower", {"p_gain": -1}, "p_gain"),
    ("koch_follower", {"dead_zone_nm": -1.0}, "dead_zone_nm"),
    ("mujoco_arm", {"stiffness_nm_rad": 0.0}, "stiffness_nm_rad"),
    ("mujoco_arm", {"stiffness_nm_rad": 1e-6}, ""),
    ("mujoco_arm", {"stiffness_nm_rad": 1.01e9}, "stiffness_nm_rad"),
    ("mujoco_arm", {"home_rad": (1.91986, 0.0, 0.0, 0.0, 0.0, 0.0)}, ""),
    ("mujoco_arm", {"home_rad": (1.93, 0.0, 0.0, 0.0, 0.0, 0.0)}, "home_rad: shoulder_pan"),
    ("mujoco_arm", {"home_rad": (0.0, 0.0, 0.0, 0.0, 0.0, -0.01)}, "home_rad: gripper"),
    ("mujoco_arm", {"model": "no_such_file.xml"}, "model"),
    ("mujoco_arm", {"objects": [{"kind": "table", "position_m": (0, 0, 0), "time_constant_s": 0.0}]}, "objects"),
    ("remote_leader", {"home_rad": (0.0, 1.5, 1.2)}, ""),
    ("remote_leader", {"home_rad": (0.0, 1.6, 0.0)}, "home_rad"),
    ("remote_leader", {"home_rad": (0.0, -1.6, 0.0)}, "home_rad"),
]


@pytest.mark.parametrize(("name", "options", "field"), OPTIONS)
def test_options_are_taken_or_refused_by_name(name: str, options: dict[str, Any], field: str) -> None:
    count = {"open_manipulator_x": 5, "remote_leader": 3}.get(name, 6)
    given = {
        key: [value] * count if key in EACH and isinstance(value, int | float) else value
        for key, value in options.items()
    }
    if not field:
        made(name, **given)
        return
    with pytest.raises(ValueError, match=field):
        made(name, **given)
