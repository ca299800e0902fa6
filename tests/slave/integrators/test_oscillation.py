from math import pi, sqrt

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from weberlink.slave.integrators.oscillation import Oscillation

masses = st.floats(1e-3, 10.0)
ratios = st.one_of(st.just(0.0), st.just(1.0), st.floats(0.9999, 1.0001), st.floats(0.01, 50.0))
values = st.floats(-0.01, 0.01)
rates = st.floats(-1.0, 1.0)
times = st.floats(1e-6, 0.1)


def oscillation(mass: float, stiffness: float, ratio: float) -> Oscillation:
    """`ratio` times the critical damping."""
    return Oscillation(mass, stiffness, 2.0 * ratio * sqrt(stiffness * mass))


def moved(motion: Oscillation, value: float, rate: float, rest: float, time: float) -> tuple[float, float]:
    a, b, c, d = motion.transition(time)
    return rest + a * (value - rest) + b * rate, c * (value - rest) + d * rate


@given(masses, st.floats(1.0, 1e7), ratios, values, rates, times, st.floats(0.0, 1.0))
def test_two_steps_make_the_same_way_as_one(
    mass: float, stiffness: float, ratio: float, value: float, rate: float, time: float, share: float
) -> None:
    """exp(A (s + t)) = exp(A s) exp(A t), under-, over- and critically damped."""
    motion = oscillation(mass, stiffness, ratio)
    whole = moved(motion, value, rate, 0.001, time)
    first = moved(motion, value, rate, 0.001, share * time)
    both = moved(motion, *first, 0.001, time - share * time)
    size = abs(value) + 0.001 + abs(rate) / sqrt(stiffness / mass)
    rounding = 1e-15 * max(1.0, sqrt(stiffness / mass) * time) + 1e-13
    assert both[0] == pytest.approx(whole[0], abs=size * rounding * 10.0)
    assert both[1] == pytest.approx(whole[1], abs=size * sqrt(stiffness / mass) * (1.0 + ratio) * rounding * 10.0)


@given(masses, st.floats(1.0, 1e7), ratios, values, rates)
def test_short_step_obeys_the_differential_equation(
    mass: float, stiffness: float, ratio: float, value: float, rate: float
) -> None:
    """Over a very short step y = y_0 + v t + a t^2 / 2 with m a = -k (y - rest) - c v."""
    motion = oscillation(mass, stiffness, ratio)
    step = 1e-5 / (sqrt(stiffness / mass) * (1.0 + ratio))
    pull = -(stiffness / mass) * (value - 0.001) - 2.0 * ratio * sqrt(stiffness / mass) * rate
    after = moved(motion, value, rate, 0.001, step)
    size = abs(value) + 0.001 + abs(rate) / sqrt(stiffness / mass)
    third = 1e-10 * size  # (omega h)^2 of it is what the next terms of both series are
    assert after[0] == pytest.approx(value + step * (rate + 0.5 * step * pull), abs=1e-3 * third)
    assert after[1] - rate == pytest.approx(step * pull, abs=2.0 * third * sqrt(stiffness / mass) * (1.0 + ratio))


@example(4.0, 1.0, 0.0, 1.9336056247251763e-64, 5e-324, -0.0078125, 0.0625)  # rose for half a swing by an underflow
@example(0.25, 42903.0, 1.0, 2.2250738585072014e-308, 0.0, 0.0, 0.09767273993961592)  # passed its horizon by a rounding
@given(masses, st.floats(1.0, 1e6), ratios, values, rates, values, times)
@example(1.0, 100.0, 0.0, 0.01, 0.0, 0.0, 0.1)
@example(1.0, 100.0, 1.0, 0.0, 0.5, -0.001, 0.1)
def test_first_fall_is_the_first_zero(
    mass: float, stiffness: float, ratio: float, value: float, rate: float, rest: float, horizon: float
) -> None:
    motion = oscillation(mass, stiffness, ratio)
    assume(value > 0.0)
    found = motion.first_fall(value, rate, rest, horizon)
    end = horizon if found is None else found
    size = abs(value) + abs(rest) + abs(rate) / sqrt(stiffness / mass)
    for i in range(200):
        assert moved(motion, value, rate, rest, end * i / 200.0)[0] >= -1e-14 * size
    if found is not None:
        assert 0.0 <= found <= horizon
        assert moved(motion, value, rate, rest, found)[0] == pytest.approx(0.0, abs=1e-12 * size)


def test_rising_from_below_zero_is_no_fall() -> None:
    """As a depth does that rounding has put on the wrong side of the touch."""
    motion = oscillation(1.0, 100.0, 0.0)
    assert motion.first_fall(-1e-18, 0.1, 0.0, 0.1) is None
    assert motion.first_fall(-1e-18, 0.1, 0.0, 1.0) == pytest.approx(pi / 10.0)
    assert motion.first_fall(-1e-18, -0.1, 0.0, 1.0) == 0.0
    assert motion.first_fall(0.0, 0.0, 0.0, 1.0) is None
