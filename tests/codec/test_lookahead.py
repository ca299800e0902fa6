"""Look-ahead: the law for the delayed signal, the use of the future, and no sample lost or decided twice."""

import pytest

from tests.codec.law import FITTED, make_channel
from tests.codec.signals import contact_stream, up
from weberlink.codec import Encoder, force_channel
from weberlink.codec.choice import NOTHING, Ahead, DueSample, Hybrid
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO


@pytest.mark.parametrize("predictor", (*FITTED, "hybrid"))
def test_without_a_known_future_the_decisions_are_those_of_the_causal_encoder(predictor: str) -> None:
    check_that_only_the_delay_is_left(predictor)


def check_that_only_the_delay_is_left(predictor: str) -> None:
    """Every second tick is missing, so that no sample has a known successor."""
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


def test_of_a_known_future_the_hybrid_takes_the_predictor_that_lasts_longest() -> None:
    first, second = Sample(0, up(1.0), ZERO), Sample(10, up(2.0), ZERO)
    for expected, slope in ((0, 0.0), (1, 0.1)):
        hybrid = Hybrid(make_channel("hybrid", bank=["zoh", "linear"], lookahead=3))
        future = Ahead(tuple(up(2.0 + slope * step) for step in (1, 2, 3)), (ZERO,) * 3, (0.05,) * 3)
        hybrid.choose((0, 1), DueSample(first, None, first.value, ZERO, 0.1, NOTHING, 0, None))
        assert hybrid.choose((0, 1), DueSample(second, first, second.value, ZERO, 0.1, future, 0, None))[0] == expected


@pytest.mark.parametrize(("earlier", "expected"), [(Sample(0, up(1.0), ZERO), 1), (None, 0)])
def test_the_hybrid_fits_what_the_other_end_fitted(earlier: Sample | None, expected: int) -> None:
    """Without the sample before the newest, where that was too old to travel: the line is held, as by the first."""
    hybrid = Hybrid(make_channel("hybrid", bank=["zoh", "linear"]))
    samples = [(Sample(0, up(1.0), ZERO), None), (Sample(10, up(2.0), ZERO), earlier)]
    samples.append((Sample(20, up(3.0), ZERO), samples[1][0]))
    chosen = [
        hybrid.choose((0, 1), DueSample(newest, before, newest.value, ZERO, 0.1, NOTHING, 0, None))[0]
        for newest, before in samples
    ]
    assert chosen == [0, 0, expected]
