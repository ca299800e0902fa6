"""The learner finds what follows what in a signal, and no signal harms it."""

from collections.abc import Callable, Sequence
from math import exp, inf, pi, sin
from random import Random

import numpy as np
import pytest
from hypothesis import given, strategies as st

from plugins.predictors.trials.learned import MOST, SIZE, sample, worst_difference
from tests.codec.signals import NOISE, Stream
from tests.examples import examples
from weberlink.codec import Channel, force_channel, position_channel
from weberlink.geometry.vector import ZERO, Vector, dot, norm, scale, subtract, unit
from weberlink_predictors.estimation import History, Signal
from weberlink_predictors.learning import RIDGE, Equations, Learned, PathLearner
from weberlink_predictors.path import HORIZONS, STEP_S

BOUND = 0.1
Force = Callable[[float], float]  # Of a time [s]


class Run:
    """A learner that follows a stream, with its history."""

    def __init__(self, channel: Channel | None = None) -> None:
        channel = channel or force_channel(predictor="elastic")
        self.history, self.tick = History(channel.tick_period), 0
        self.learner = PathLearner(Signal(channel.grid, channel.fit_limits, 0.04))

    def follow(self, stream: Stream, bounds: Sequence[float] = (), *, gap: int = 0) -> "Run":
        self.tick += gap
        for index, (force, position) in enumerate(stream):
            self.history.add(self.tick, force, position, bounds[index] if bounds else BOUND)
            self.learner.follow(self.history)
            self.tick += 1
        return self

    @property
    def path(self) -> Learned:
        return self.learner.learned()[0]

    @property
    def elastic(self) -> Learned:
        return self.learner.learned()[1]

    def assert_finite(self) -> None:
        for each in self.learner.learned():
            assert np.isfinite(each.displacements).all()
            assert np.isfinite(each.stiffness).all()


def along(force: Force, *, seconds: float, period: float = 1e-3, start: float = 0.0) -> Stream:
    """A force in one direction over a hand at rest."""
    direction = unit((0.3, -0.5, 0.8))
    return [(scale(direction, force(start + tick * period)), ZERO) for tick in range(round(seconds / period))]


def damped(t: float) -> float:
    """Two impacts a second that ring at 15 Hz."""
    since = t % 0.5
    return 2.0 + 1.5 * exp(-since / 0.15) * sin(2.0 * pi * 15.0 * since)


def ramps(t: float) -> float:
    return 1.0 + 4.0 * abs(t % 1.0 - 0.5)


def wave(t: float) -> float:
    return 2.0 + sin(2.0 * pi * 3.0 * t)


@pytest.mark.parametrize(("force", "at", "allowed"), [(damped, 3.1, 0.35), (wave, 3.1, 0.2), (ramps, 3.8, 0.2)])
@pytest.mark.parametrize("position", [False, True])
def test_it_learns_a_known_system(force: Force, at: float, allowed: float, position: bool) -> None:
    """Up to 32 ms ahead within a share of what a hold misses, with or without positions."""
    channel = position_channel(predictor="path") if position else force_channel(predictor="elastic")
    run = Run(channel).follow(along(force, seconds=at))
    assert share_missed(run, force, at) < allowed


def share_missed(run: Run, force: Force, at: float) -> float:
    """Sum of the errors of the path up to 32 ms ahead, as a share of that of a hold."""
    changes = [_change(force, at, steps) for steps in HORIZONS if steps * STEP_S <= 0.032]
    missed = [norm(subtract(*each)) for each in zip(run.path.displacements, changes, strict=False)]
    return sum(missed) / sum(map(norm, changes))


def wander(seed: int, *, ticks: int) -> list[Vector]:
    """Random motion of some millimetres with a spectrum up to some 10 Hz."""
    random = Random(seed)
    waves = [[(random.uniform(0.5, 12.0), random.uniform(0.0, 2.0 * pi)) for _ in range(5)] for _ in range(3)]
    places = []
    for tick in range(ticks):
        x, y, z = (sum(4e-3 / hz * sin(2e-3 * pi * hz * tick + phase) for hz, phase in axis) for axis in waves)
        places.append((x, y, z))
    return places


@pytest.mark.parametrize(("stiffness", "off"), [(300.0, 0.05), (1500.0, 0.03)])
def test_it_learns_the_stiffness_of_a_spring(stiffness: float, off: float) -> None:
    """Of f = f_0 - K p: K_1 = -K, and nothing more along the force."""
    random = Random(5)
    stream = [
        ((random.gauss(0.0, NOISE) - stiffness * x, -stiffness * y, 20.0 - stiffness * z), (x, y, z))
        for x, y, z in wander(2, ticks=4000)
    ]
    along_all, normal = Run().follow(stream).elastic.stiffness
    assert along_all == pytest.approx(-stiffness, rel=off)
    assert abs(normal) < off * stiffness


@pytest.mark.parametrize("stiffness", [300.0, 1500.0])
def test_it_learns_the_stiffness_of_a_wall(stiffness: float) -> None:
    """Along the force alone: K_2 = -K and K_1 = 0."""
    normal = unit((0.3, -0.2, 0.93))
    places = [subtract(place, scale(normal, 8e-3)) for place in wander(3, ticks=4000)]
    stream = [(scale(normal, stiffness * max(0.0, -dot(normal, place))), place) for place in places]
    along_all, extra = Run().follow(stream).elastic.stiffness
    assert along_all + extra == pytest.approx(-stiffness, rel=0.05)
    assert abs(along_all) < 0.05 * stiffness


def test_a_constant_and_nothing_are_followed_by_no_change() -> None:
    for value in (ZERO, (0.5, 0.0, 2.0)):
        for each in Run().follow([(value, ZERO)] * 600).learner.learned():
            assert each.displacements == [pytest.approx(ZERO, abs=1e-6)] * len(HORIZONS)
            assert each.stiffness == (0.0, 0.0)


def _change(force: Force, at: float, steps: int) -> Vector:
    return scale(unit((0.3, -0.5, 0.8)), force(at - 1e-3 + steps * STEP_S) - force(at - 1e-3))


# What may come.

HUGE = 1e150
sizes = st.sampled_from([0.0, 1e-300, 1e-3, 1.0, 1e5, HUGE])
bounds = st.sampled_from([0.0, 5e-324, 1e-300, 1e-9, 0.02, BOUND, 1e9, 1e200, inf])
part = st.tuples(sizes, sizes, bounds, st.integers(1, 150), st.sampled_from([0, 0, 1, 1000]), st.integers(0, 2**32))


@pytest.mark.parametrize("position", [False, True])
@given(parts=st.lists(part, min_size=1, max_size=5))
@examples(15)
def test_no_signal_makes_it_raise_or_expect_what_is_not_finite(
    position: bool, parts: list[tuple[float, float, float, int, int, int]]
) -> None:
    """Gaps, jumps, huge and tiny values, any deadband."""
    run = Run(position_channel(predictor="path") if position else None)
    for size, reach, bound, ticks, gap, seed in parts:
        random = Random(seed)
        stream = [(_drawn(random, size), _drawn(random, reach)) for _ in range(ticks)]
        run.follow(stream, [bound] * ticks, gap=gap)
        run.assert_finite()


def _drawn(random: Random, size: float) -> Vector:
    return (random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size))


@pytest.mark.parametrize("harm", ["gap", "huge", "no deadband", "infinite deadband"])
def test_it_recovers_from_harm(harm: str) -> None:
    """Two seconds later it knows a wave."""
    before, after = along(wave, seconds=1.0), along(wave, seconds=2.0, start=2.0)
    run = Run().follow(before)
    if harm == "gap":
        run.follow([], gap=1000)

    elif harm == "huge":
        run.follow([((HUGE * (-1.0) ** tick, 0.0, 0.0), (HUGE, 0.0, 0.0)) for tick in range(200)])
    else:
        run.follow(before, [0.0 if harm == "no deadband" else inf] * len(before))
    run.assert_finite()
    assert share_missed(run.follow(after), wave, 4.0) < 0.2


# Over time.


def test_the_sums_of_a_long_run_are_those_of_a_fresh_start() -> None:
    """Of what is older than sixty time constants nothing is left, rounding errors included; a day is a trial."""
    assert worst_difference(3, 4000, 50.0) <= MOST


def test_a_solution_is_the_least_squares_one() -> None:
    random, equations = Random(4), Equations(SIZE, 1)
    for step in range(400):
        noted, change, weight = sample(random, step)
        equations.add(noted, [change], weight, 1.0)
    left = _square(equations.rows[:SIZE])
    assert equations.solve([RIDGE] * SIZE)
    expected = np.linalg.solve(np.array(left) + RIDGE * np.eye(SIZE), equations.rows[SIZE][:SIZE])
    assert equations.solutions[0] == pytest.approx(expected, rel=1e-6)
    explained = np.dot(expected, equations.rows[SIZE][:SIZE])
    assert equations.unexplained[0][0] == pytest.approx(equations.rows[SIZE][SIZE] - explained, rel=1e-6)


def _square(lower: Sequence[Sequence[float]]) -> list[list[float]]:
    """The rows of a symmetric matrix, of its lower triangle."""
    return [[lower[max(i, j)][min(i, j)] for j in range(len(lower))] for i in range(len(lower))]
