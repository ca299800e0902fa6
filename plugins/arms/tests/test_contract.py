"""Every servo arm keeps its contract before an emulated one, in virtual time, and takes or refuses its options."""

from collections.abc import Iterator
from math import pi
from typing import Any

import pytest

from plugins.arms.tests import benches
from plugins.arms.tests.benches import FAMILIES, FOLLOWERS, LEADERS, Stepped
from weberlink.master import devices
from weberlink.slave import robots
from weberlink.testing.arms import ArmBench, HardwareFollowerContract, HardwareLeaderContract
from weberlink.testing.robots import HardwareRobotContract, RobotBench
from weberlink.testing.stepping import VirtualPort
from weberlink.testing.time import TICK, until

SO101 = ("so101_leader", "so101_follower")
DYNAMIXEL = tuple(name for name in FAMILIES if name not in SO101)
FAULTS = ("unplug", "silent", "late", "garbled", "dead")


def made(name: str, **options: Any) -> Any:
    """Not open."""
    if name == "dynamixel":
        robot: Any = robots.ROBOTS.load(name)
        return robot(robot.Options(**options), None, TICK)
    driver: Any = (devices.LEADERS if name in LEADERS else robots.FOLLOWERS)[name]
    return driver(driver.Options.model_validate(options), TICK)


MOVING = {"hand_rad": (0.4,) * 6, "hand_s": (1.0,) * 6, "hand_n_m_rad": 5.0}


def bench_of(name: str) -> ArmBench:
    arm = made(name)
    stepped = Stepped(arm, benches.made(name, **(MOVING if name in LEADERS else {})))
    servos = stepped.emulator.servos
    return ArmBench(arm, stepped.tick, faults=stepped.faults, torques_on=lambda: [servo.torque_on for servo in servos])


class TestLeaders(HardwareLeaderContract):
    FAULTS = FAULTS

    @pytest.fixture(params=LEADERS)
    def bench(self, request: pytest.FixtureRequest) -> Iterator[ArmBench]:
        yield bench_of(request.param)


class TestFollowers(HardwareFollowerContract):
    FAULTS = FAULTS

    @pytest.fixture(params=FOLLOWERS)
    def bench(self, request: pytest.FixtureRequest) -> Iterator[ArmBench]:
        yield bench_of(request.param)


class TestDynamixel(HardwareRobotContract):
    FAULTS = ("unplug", "silent", "late", "garbled", "overload", "trip_watchdog", "dead", "restart")

    @pytest.fixture
    def bench(self) -> Iterator[RobotBench]:
        floor_m = 0.10
        floor = {"shape": "plane", "point_m": [0.0, 0.0, floor_m], "stiffness_n_m": 500.0}
        robot = made("dynamixel", approach_m_s=0.2)
        stepped = Stepped(robot, benches.made("open_manipulator_x", scene=[floor]))
        yield RobotBench(
            robot,
            stepped.tick,
            above=(0.20, 0.02, floor_m + 0.04),
            below=(0.20, 0.02, floor_m - 0.02),
            tolerance_m=0.012,
            settle_ticks=500,
            faults=stepped.faults,
        )


@pytest.mark.parametrize("name", [*FAMILIES, "dynamixel"])
def test_a_replugged_arm_goes_on(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """That it does not jump is seen with its exchange."""
    monkeypatch.setattr("weberlink.hardware.worker.RETRY_S", 0.0)
    arm = made(name, reconnect_s=60.0)
    stepped = Stepped(arm, benches.made("open_manipulator_x" if name == "dynamixel" else name))
    arm.open(stepped.tick())
    before, is_back = arm.latest(stepped.tick()).at, iter((False, False, True))

    def connect() -> VirtualPort:
        if next(is_back):
            stepped.port.broken = None
        return stepped._connect()

    stepped._worker.exchange._exchange._connect = connect
    stepped.faults["unplug"]()
    until(lambda: arm.latest(stepped.tick()).at > before + 0.2, "it to go on", pause=0.0)
    assert list(is_back) == []


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
BEYOND = (("upper_rad", 6.29), ("lower_rad", -6.29))
OPTIONS: list[tuple[str, dict[str, Any], str]] = [
    *[(name, {"rate_hz": float(most)}, "") for name, most in MOST_HZ.items()],
    *[(name, {"rate_hz": most + 1.0}, "rate_hz") for name, most in MOST_HZ.items()],
    *[(name, {"baud": baud}, "baud") for name in MOST_HZ for baud in (12, 1_000_001)],
    *[(name, {"baud": 57_600, "rate_hz": 50.0}, "baud") for name in DYNAMIXEL],
    *[(name, {"lower_rad": 1.0, "upper_rad": 1.0}, "shoulder_pan|joint1") for name in MOST_HZ],
    *[(name, {end: value}, "shoulder_pan|joint1") for name in MOST_HZ for end, value in BEYOND],
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
]


@pytest.mark.parametrize(
    ("name", "ratio"),
    [*((name, "torque_ratio") for name in DYNAMIXEL), *((name, "torque_per_load_nm") for name in SO101)],
)
def test_torques_are_calibrated_where_their_ratio_is_given(name: str, ratio: str) -> None:
    plain = made(name).spec
    assert (plain.calibrated, made(name, **{ratio: (0.7,) * plain.axes}).spec.calibrated) == (False, True)


@pytest.mark.parametrize("name", ["koch_leader", "omx_leader"])
def test_a_leader_says_after_how_long_its_motors_let_go(name: str) -> None:
    assert made(name, bus_watchdog_ms=100.0).spec.watchdog_s == pytest.approx(0.1)


@pytest.mark.parametrize(("name", "options", "field"), OPTIONS)
def test_options_are_taken_or_refused_by_name(name: str, options: dict[str, Any], field: str) -> None:
    count = {"open_manipulator_x": 5}.get(name, 6)
    given = {
        key: [value] * count if key in EACH and isinstance(value, int | float) else value
        for key, value in options.items()
    }
    if not field:
        made(name, **given)
        return
    with pytest.raises(ValueError, match=field):
        made(name, **given)
