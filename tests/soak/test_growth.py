"""Growth is found where there is some, and not where there is none."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.soak.growth import WARM_UP_S, fit


def life(slope_per_hour: float, *, seconds: int = 900, level: float = 40_000.0, began: float = 0.0, noise: float = 0.0,
         seed: int = 1) -> list[tuple[float, float]]:  # fmt: skip
    random = Random(seed)
    return [(began + t, level + slope_per_hour / 3600.0 * t + noise * random.gauss(0.0, 1.0)) for t in range(seconds)]


@given(slope=st.floats(-1e5, 1e5), level=st.floats(0.0, 1e6))
def test_an_exact_line_is_found_exactly(slope: float, level: float) -> None:
    grown = fit([life(slope, level=level)])
    assert grown is not None
    assert grown.per_hour == pytest.approx(slope, rel=1e-6, abs=1e-3)
    assert grown.uncertainty < 1e-3 + 1e-6 * abs(slope)


def test_lives_share_the_slope_and_keep_their_levels() -> None:
    grown = fit([life(500.0, level=1e4, seconds=300), life(500.0, level=9e4, seconds=300, began=1000.0)])
    assert grown is not None
    assert grown.per_hour == pytest.approx(500.0)


def test_restarts_alone_are_no_growth() -> None:
    """Each life on a higher level than the one before, but level."""
    grown = fit([life(0.0, level=1e4 * n, seconds=300, began=400.0 * n) for n in range(1, 6)])
    assert grown is not None
    assert grown.per_hour == pytest.approx(0.0, abs=1e-6)


def test_the_warm_up_is_no_growth() -> None:
    samples = [(float(t), 1e4 if t < WARM_UP_S else 2e4) for t in range(900)]
    grown = fit([samples])
    assert grown is not None
    assert grown.per_hour == pytest.approx(0.0, abs=1e-6)


def test_noise_makes_it_unsure_and_does_not_accuse() -> None:
    accused = 0
    for seed in range(50):
        grown = fit([life(0.0, noise=200.0, seed=seed)])
        assert grown is not None
        assert grown.uncertainty > 0.0
        accused += grown.exceeds(0.0)
    assert accused <= 5  # two standard deviations, on one side
    leak = fit([life(20_000.0, noise=200.0)])
    assert leak is not None
    assert leak.exceeds(1024.0)
    assert not leak.exceeds(30_000.0)


def test_too_little_is_not_judged() -> None:
    assert fit([]) is None
    assert fit([[]]) is None
    assert fit([life(1e6, seconds=60)]) is None
    assert fit([life(1e6, seconds=30)] * 20) is None
