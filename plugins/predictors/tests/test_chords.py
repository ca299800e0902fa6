"""Paths of straight parts through known samples."""

from itertools import pairwise
from random import Random

from hypothesis import given, strategies as st

from tests.codec.signals import up
from tests.examples import examples
from weberlink.geometry.vector import distance, is_finite
from weberlink_predictors.chords import MARGIN, Chords

seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds, length=st.integers(2, 40), tail=st.integers(0, 5))
@examples(30)
def test_chords_that_claim_to_fit_do(seed: int, length: int, tail: int) -> None:
    random = Random(seed)
    values = [(random.gauss(0, 1.0), random.gauss(0, 0.1), 0.0) for _ in range(length)]
    horizons = [4, 8, 16, 32, 64][:tail]
    problem = Chords(values, [0.5] * length, [up(0.1 * ahead) for ahead in horizons], horizons)
    knots, vertices = problem.path()
    assert knots[0] == 0
    assert all(early < late for early, late in pairwise(knots))
    assert len(knots) == len(vertices)
    if length <= 4:  # a knot at every tick
        shown = [vertices[knots.index(tick)] if tick in knots else None for tick in range(length)]
        assert all(each is None or distance(each, value) <= 0.5 for each, value in zip(shown, values, strict=True))
    assert 0.0 < MARGIN < 1.0


def test_chords_of_deadbands_that_are_far_apart_are_finite() -> None:
    """Rounding makes the least squares singular: the path that was found until then is used."""
    values = [up(force) for force in (0.126, -0.132, 0.64, 0.105, -0.536, 0.362, 1.304, 0.947)]
    knots, vertices = Chords(values, [1e-12, 1e3] * 4, [up(1.0)], [4]).path()
    assert all(early < late for early, late in pairwise(knots))
    assert len(knots) == len(vertices)
    assert all(map(is_finite, vertices))
