"""Filters learnt again: on signals whose future is known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from weberlink.codec.predictors.trend import LAGS
from weberlink.studies.adaptive.filters import HOLD_TICKS, filters

Array = NDArray[np.float64]


def ramp(samples: int = 400) -> Array:
    force: Array = np.outer(np.arange(samples) * 1e-4, [1.0, -2.0, 0.5]) + np.array([3.0, 1.0, 0.0])
    return force


def said(weights: tuple[float, ...], force: Array, tick: int) -> Array:
    """Of the newest sample and the differences."""
    total: Array = np.sum([w * (force[tick] - force[tick - lag]) for w, lag in zip(weights, LAGS, strict=True)], axis=0)
    return total


def test_a_straight_line_is_predicted() -> None:
    force = ramp()
    found = filters([force])
    tick, slope = 200, force[1] - force[0]
    assert said(found.hold, force, tick) == pytest.approx(slope * (HOLD_TICKS + 1) / 2)
    assert said(found.line, force, tick) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    assert said(found.slope, force, tick) == pytest.approx(slope)


def test_the_mean_of_noise_is_predicted() -> None:
    chance = np.random.default_rng(1)
    force = 2.0 + chance.normal(0.0, 0.01, (6000, 3))
    found = filters([force])
    # The best guess of a level from seven samples of equal noise: each difference takes a seventh back.
    assert found.hold == pytest.approx([-1.0 / (len(LAGS) + 1)] * len(LAGS), abs=0.03)


def test_ticks_before_a_contact_are_left_out() -> None:
    chance = np.random.default_rng(2)
    force = 2.0 + chance.normal(0.0, 0.01, (400, 3))
    struck = force.copy()
    struck[-15:] += 5.0
    without = force[: len(force) - 15 + 1]
    assert filters([struck]).hold == pytest.approx(filters([without]).hold)


def test_signals_count_alike_at_any_length() -> None:
    chance = np.random.default_rng(3)
    noise, wander = 2.0 + chance.normal(0.0, 0.01, (8000, 3)), 2.0 + chance.normal(0.0, 5e-3, (8000, 3)).cumsum(axis=0)
    long, short = filters([noise, wander]), filters([noise[:1000], wander])
    assert short.hold == pytest.approx(long.hold, abs=0.03)


def test_too_short_signals_are_refused() -> None:
    with pytest.raises(ValueError, match="long enough"):
        filters([ramp(50)])
    with pytest.raises(ValueError, match="long enough"):
        filters([])
