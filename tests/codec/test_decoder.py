"""The values of a decoder between updates, and the updates that it refuses."""

from math import inf

import pytest

from tests.codec.signals import up
from weberlink.codec import Decoder, Encoder, Update, force_channel, position_channel
from weberlink.codec.predictors import PREDICTORS, FitLimits, FittedPredictor, Model
from weberlink.codec.predictors.contract import UNFITTED, ModelKind
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector
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


class Wearing(Model):
    """One newton more each time that it is asked."""

    memory = 0.0

    def at(self, tick: float, position: Vector) -> Vector:
        return ZERO

    def advance(self, tick: float, position: Vector, memory: float) -> tuple[Vector, float]:
        return up(memory + 1.0), memory + 1.0


class Worn(FittedPredictor):
    name = "worn"

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Wearing:
        return Wearing()


def test_a_memory_survives_a_repeat_of_its_update_and_ends_with_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    for table in (PREDICTORS.built_in, PREDICTORS._loaded):
        monkeypatch.setitem(table, "worn", Worn())  # type: ignore[arg-type]
    decoder, update = Decoder(force_channel(predictor="worn")), Update(10, 0, (0, 0, 500))
    decoder.apply(update)
    shown = [decoder.value(10), decoder.value(11), decoder.value(12)]
    decoder.apply(update)
    shown.append(decoder.value(13))
    decoder.apply(Update(20, 0, (0, 0, 500)))
    assert [*shown, decoder.value(21)] == [up(0.5), up(1.0), up(2.0), up(3.0), up(1.0)]
