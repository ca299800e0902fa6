"""Look-ahead: the law for the delayed signal, the use of the future, and no sample lost or decided twice."""

from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.codec.law import FITTED, make_channel
from tests.codec.signals import contact_stream, up
from tests.examples import examples
from weberlink.codec import Encoder, force_channel
from weberlink.codec.predictors.chords import MARGIN, Chords
from weberlink.geometry.vector import distance, is_finite

seeds = st.integers(0, 2**32 - 1)
CAUSAL = (*FITTED, "hybrid", "affine")  # Predictors that learn nothing beyond the history of the sample


@pytest.mark.parametrize("predictor", CAUSAL)
def test_without_a_known_future_the_decisions_are_those_of_the_causal_encoder(predictor: str) -> None:
    """Every second tick is missing, so that no sample has a known successor: only the delay is left."""
    stream = contact_stream(11, ticks=1000)
    causal = Encoder(force_channel(predictor=predictor))
    late = Encoder(make_channel(predictor, lookahead=2))
    expected, found = [], []
    for index, (force, position) in enumerate(stream):
        expected.append(causal.encode(2 * index, force, position))
        found.append(late.encode(2 * index, force, position))
    assert found[0] is None
    assert found[1:] == expected[:-1]
    assert sum(update is not None for update in expected) > 5


def test_ticks_that_begin_anew_drop_the_samples_that_wait() -> None:
    encoder = Encoder(make_channel("zoh", weber=0.0, floor=0.0, lookahead=2))
    updates = [encoder.encode(tick, up(float(tick))) for tick in (7, 8, 3, 4, 5, 6)]
    assert [update and update.tick for update in updates] == [None, None, None, None, 3, 4]


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
