"""The values of a decoder between updates, and the updates that it refuses."""

from math import inf

import pytest

from weberlink.codec import Decoder, Encoder, Update, force_channel, position_channel
from weberlink.codec.predictors.model import UNFITTED, ModelKind
from weberlink.geometry.vector import ZERO
from weberlink.update import PreviousSample


def test_before_the_first_update_a_force_is_zero_and_a_position_unknown() -> None:
    assert Decoder(force_channel()).value(5.5) == ZERO
    assert Encoder(force_channel()).coded == Encoder(position_channel()).coded == ZERO
    decoder = Decoder(position_channel())
    assert (decoder.value(5.5), decoder.model, decoder.surface, decoder.record) == (None, None, None, UNFITTED)


def test_at_the_tick_of_a_sample_the_value_is_the_sample_even_on_a_stiff_model() -> None:
    decoder = Decoder(force_channel(predictor="plane"))
    decoder.apply(Update(10, 0, (0, 0, 2000, 0, 0, -4), PreviousSample(5, (0, 0, 1000, 0, 0, -3))))
    assert decoder.value(10, (0.0, 0.0, -0.000044)) == (0.0, 0.0, 2.0)
    assert decoder.value(10.5, (0.0, 0.0, -0.000044)) == pytest.approx((0.0, 0.0, 2.4))
    assert decoder.surface == decoder.model
    assert decoder.record.kind is ModelKind.PLANE


def test_extrapolation_without_end_is_confined_to_the_wire() -> None:
    decoder = Decoder(force_channel(predictor="linear"))
    decoder.apply(Update(1, 0, (0, 0, 2000), PreviousSample(1, (0, 0, 1000))))
    assert decoder.value(1e6) == pytest.approx((0.0, 0.0, 32.767))
    assert decoder.value(inf) == (0.0, 0.0, 2.0)
    assert (decoder.surface, decoder.record.kind) == (None, ModelKind.LINE)
