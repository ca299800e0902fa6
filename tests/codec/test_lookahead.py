"""Look-ahead: the law for the delayed signal, the use of the future, and no sample lost or decided twice."""

import pytest

from tests.codec.law import FITTED, make_channel
from tests.codec.signals import contact_stream, up
from weberlink.codec import Encoder, force_channel


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
