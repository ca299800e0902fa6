"""What every arm with servos counts on: readings at any moment, a bus that is fast enough, an axis that gives way."""

import pytest
from hypothesis import given, strategies as st

from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import HardwareFault
from weberlink_arms.servo.driver import Interpolation, TimedValues
from weberlink_arms.servo.exchange import TRIES, check_pace
from weberlink_arms.servo.position import LEAST_RAD, STEPS, give_way

# --- readings: between neighbours, exact at samples, never ahead of the newest, late by the stated lag

steps = st.lists(st.tuples(st.floats(1e-4, 0.1), st.floats(0.0, 0.1)), min_size=1, max_size=8)


@given(steps, st.floats(0.0, 0.05), st.integers(2, 8))
def test_values_are_exact_monotonic_and_late_by_the_lag(
    steps: list[tuple[float, float]], lag: float, keep: int
) -> None:
    """A sample holds the square of its time and the time itself, which is linear between any two."""
    interpolation, at, now, last, samples = Interpolation(lag, keep), 100.0, 100.0, -1.0, list[TimedValues]()
    with pytest.raises(LookupError):
        interpolation.at(now)
    for step, wait in steps:
        at += step
        samples = [*samples, TimedValues(at, (at * at, at))][-keep:]
        interpolation.add(samples[-1])
        interpolation.add(TimedValues(at, (9.0, 9.0)))  # what is not newer changes nothing
        now = max(now, at) + wait
        reading = interpolation.at(now)
        assert reading.at == pytest.approx(min(max(now - lag, samples[0].at), at), abs=1e-9)
        assert reading.values[1] == pytest.approx(reading.at, abs=1e-9)
        assert reading.at >= last
        last = reading.at
    interpolation.add(TimedValues(at - 1e-5, (9.0, 9.0)))
    for sample in samples:
        assert interpolation.at(sample.at + lag).values == pytest.approx(sample.values, abs=1e-6)


# --- pace: the best of many readings counts, so that a busy host is no slow adapter

RATE_HZ = 256.0
PERIOD_S = 1.0 / RATE_HZ
SLOW = 2.0 * PERIOD_S


@pytest.mark.parametrize(
    ("takes", "reads"),
    [((0.0,), 1), ((PERIOD_S,), 1), ((SLOW, SLOW, PERIOD_S), 3)]
    + [(takes, None) for takes in ((SLOW,), (SLOW, PERIOD_S + 2.0**-30), (SLOW,) * TRIES + (0.0,))],
)
def test_one_reading_within_the_period_is_enough(takes: tuple[float, ...], reads: int | None) -> None:
    """None: too slow, which is said with the best. The last of the times that a reading takes lasts for ever."""
    now, done = 100.0, 0

    def read() -> None:
        nonlocal now, done
        now, done = now + takes[min(done, len(takes) - 1)], done + 1

    def check() -> None:
        check_pace(read, RATE_HZ, lambda: now, "/dev/bus", lambda: "lower its latency")

    if reads is None:
        best = f"{min(takes[:TRIES]) * 1e3:.1f}"
        with pytest.raises(HardwareFault, match=rf"^/dev/bus: .*{best} ms.*; lower its latency"):
            check()
    else:
        check()
    assert done == (TRIES if reads is None else reads)


# --- giving way: an axis under position control, at rest between its goal, its weight and a wall

STIFFNESS_NM_RAD = 5.0


class Axis:
    """An axis without friction, with a wall at 0 [N m/rad] and a weight [N m] that the driver may know."""

    def __init__(self, wall: float, weight: float, modelled: bool) -> None:
        self.wall, self.weight = wall, weight
        self.raised = weight / STIFFNESS_NM_RAD if modelled else 0.0
        self.goals: list[float] = []
        self.angle = 0.0

    def go(self, goals: Joints) -> Joints:
        (goal,) = goals
        self.goals.append(goal)
        self.angle = goal - self.weight / STIFFNESS_NM_RAD
        if self.angle > 0.0:
            self.angle *= STIFFNESS_NM_RAD / (STIFFNESS_NM_RAD + self.wall)
        return (self.angle + self.raised,)

    @property
    def push(self) -> float:
        """Torque on the wall [N m]."""
        return self.wall * max(0.0, self.angle)


weights = st.floats(-1.0, 1.0)


@given(st.floats(0.01, 1.0), st.floats(20.0, 1000.0), weights, st.booleans())
def test_push_on_a_wall_ends(goal: float, wall: float, weight: float, modelled: bool) -> None:
    axis = Axis(wall, weight, modelled)
    here = axis.go((goal,))
    before = axis.push
    give_way((goal,), here, axis.go)
    assert len(axis.goals) <= 1 + STEPS
    mirrored = Axis(wall, weight, modelled)
    give_way((-goal,), (-mirrored.go((goal,))[0],), lambda goals: (-mirrored.go((-goals[0],))[0],))
    assert mirrored.goals == axis.goals, "in either direction"
    assert axis.push <= 0.1 * before + STIFFNESS_NM_RAD * LEAST_RAD + max(0.0, 0.0 if modelled else -weight)


@pytest.mark.parametrize("modelled", [True, False])
@given(st.floats(-1.0, 1.0), weights)
def test_a_free_arm_keeps_its_place_or_sinks_once(modelled: bool, goal: float, weight: float) -> None:
    axis = Axis(0.0, weight, modelled)
    here = axis.go((goal,))
    angle = axis.angle
    goals = give_way((goal,), here, axis.go)
    assert goals == pytest.approx((goal if modelled else angle,))
    assert axis.angle == pytest.approx(angle if modelled else angle - weight / STIFFNESS_NM_RAD)


def test_axes_are_judged_apart() -> None:
    axes = [Axis(100.0, 0.0, modelled=False), Axis(0.0, 0.5, modelled=False)]

    def go(goals: Joints) -> Joints:
        return tuple(axis.go((goal,))[0] for axis, goal in zip(axes, goals, strict=True))

    goals = (0.5, 0.5)
    give_way(goals, go(goals), go)
    assert axes[0].push < 0.02
    assert axes[1].angle == pytest.approx(0.5 - 2.0 * 0.5 / STIFFNESS_NM_RAD)
