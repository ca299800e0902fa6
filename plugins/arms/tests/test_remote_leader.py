"""A leader arm led by a program, in virtual time: motion, limits, and what it does without the program."""

from collections.abc import Iterator
from itertools import pairwise
from math import inf
from typing import Any

import pytest

from weberlink.arms.contract import ArmReading
from weberlink.geometry.joints import Joints
from weberlink.testing.arms import ArmBench, LeaderContract
from weberlink.testing.time import TICK, virtual_time
from weberlink_arms.remote_leader import LeaderTarget, RemoteLeader, RemoteLeaderOptions

OPTIONS: dict[str, Any] = {
    "joints": ("pan", "lift"),
    "gripper": True,
    "lower_rad": (-1.0, -1.5, 0.0),
    "upper_rad": (1.0, 1.5, 1.2),
}
START = 10.0


class Program:
    """Targets by the time of the tick, at 30 Hz, between two times [s]."""

    def __init__(self, target: Joints, begins: float = 0.0, ends: float = inf) -> None:
        self.target, self._begins, self.ends, self._tick = target, begins, ends, 0

    def open(self) -> None: ...

    def newest(self) -> LeaderTarget | None:
        self._tick += 1
        is_due = self._tick % 33 == 1 and self._begins <= self._tick * TICK < self.ends
        return LeaderTarget(self.target, True, self._tick) if is_due else None

    def close(self) -> None: ...


class Sweep(Program):
    """Leads a milliradian a tick, from 0 on in every session."""

    def open(self) -> None:
        self.target = (0.0, 0.0, 0.0)

    def newest(self) -> LeaderTarget:
        self.target = (min(0.3, self.target[0] + 1e-3), 0.0, 0.0)
        return LeaderTarget(self.target, True, 1)


def made(program: Program, **options: Any) -> RemoteLeader:
    return RemoteLeader(RemoteLeaderOptions.model_validate(OPTIONS | options), TICK, program)


class TestRemoteLeader(LeaderContract):
    @pytest.fixture
    def bench(self) -> Iterator[ArmBench]:
        yield ArmBench(made(Sweep(())), virtual_time())


class Led:
    """An arm that is led, tick by tick."""

    def __init__(self, program: Program) -> None:
        self.program, self._tick = program, 0
        self.arm = made(program)
        self.arm.open(START)

    def go(self, ticks: int) -> list[ArmReading]:
        self._tick += ticks
        return [self.arm.latest(START + (tick + 1) * TICK) for tick in range(self._tick - ticks, self._tick)]


def fastest(readings: list[ArmReading]) -> float:
    return max(abs(b - a) for p, q in pairwise(readings) for a, b in zip(p.angles, q.angles, strict=True)) / TICK


@pytest.mark.parametrize(
    ("target", "goes_to"), [((0.5, -0.5, 0.6), (0.5, -0.5, 0.6)), ((9.0, -9.0, -9.0), (1.0, -1.5, 0.0))]
)
def test_arm_begins_where_the_program_is_within_its_limits(target: Joints, goes_to: Joints) -> None:
    """The follower approaches from where it is, so the leader need not come from its home."""
    led = Led(Program(target, begins=0.1))
    readings = led.go(500)
    assert (readings[50].angles, readings[50].buttons) == ((0.0, 0.0, 0.0), 0)
    assert (readings[-1].angles, readings[-1].buttons) == (goes_to, 1)


def test_jump_becomes_a_bounded_straight_motion() -> None:
    led = Led(Program((0.0, 0.0, 0.0)))
    readings = led.go(100)
    led.program.target = (0.5, -1.0, 0.25)
    readings += led.go(1500)
    assert 1.8 < fastest(readings) <= 2.0 * (1 + 1e-9)
    assert readings[-1].angles == pytest.approx((0.5, -1.0, 0.25), abs=1e-6)
    for pan, lift, gripper in (reading.angles for reading in readings):
        assert (2.0 * pan, 4.0 * gripper) == pytest.approx((-lift, -lift), abs=1e-9)


def test_silent_program_has_let_go() -> None:
    """The arm stops where it is, and leads again when the program returns, without a jump."""
    led = Led(Program((0.0, 0.0, 0.0), ends=0.3))
    readings = led.go(250)
    led.program.target = (1.0, 0.0, 0.0)
    readings += led.go(750)
    assert [reading.buttons for reading in readings].index(0, 1) == pytest.approx((0.298 + 0.2) / TICK, abs=2)
    held = readings[-1].angles
    assert 0.05 < held[0] < 1.0
    assert readings[-400].angles == held
    led.program.ends = inf
    again = led.go(1000)
    assert fastest([readings[-1], *again]) <= 2.0 * (1 + 1e-9)
    assert (again[-1].angles[0], again[-1].buttons) == (pytest.approx(1.0, abs=1e-6), 1)


def test_the_spec_is_that_of_the_options_and_the_tick_and_home_is_within_the_range() -> None:
    spec = made(Sweep(()), home_rad=(0.0, 1.5, 1.2)).spec
    assert (spec.joints, spec.gripper, spec.rate_hz) == (OPTIONS["joints"], True, pytest.approx(1.0 / TICK))
    assert (spec.lower, spec.upper) == (OPTIONS["lower_rad"], OPTIONS["upper_rad"])
    assert (spec.force_feedback, spec.buttons, spec.calibrated) == (False, 1, True)
    for home in ((0.0, 1.6, 0.0), (0.0, -1.6, 0.0)):
        with pytest.raises(ValueError, match="home_rad"):
            made(Sweep(()), home_rad=home)
