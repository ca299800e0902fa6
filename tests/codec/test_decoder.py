from math import inf

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec import Decoder, Update, force_channel, position_channel
from codec.predictors import PREDICTORS
from codec.vector import ZERO, is_finite

levels16 = st.integers(-32_767, 32_767)
samples = st.tuples(*[levels16] * 6)
anything = st.floats(allow_nan=True, allow_infinity=True)


def test_before_the_first_update_a_force_is_zero_and_a_position_unknown() -> None:
    assert Decoder(force_channel()).value(5.5) == ZERO
    assert Decoder(position_channel()).value(5.5) is None


@pytest.mark.parametrize(
    "update",
    [
        Update(0, 9, (0,) * 6),
        Update(0, -1, (0,) * 6),
        Update(0, 0, (0,) * 5),
        Update(0, 1, (0,) * 6, 1, (0,) * 3),
    ],
)
def test_an_update_that_does_not_fit_is_refused_and_changes_nothing(update: Update) -> None:
    decoder = Decoder(force_channel())
    decoder.apply(Update(3, 0, (1, 2, 3, 4, 5, 6)))
    before = decoder.state
    with pytest.raises(ValueError, match="update"):
        decoder.apply(update)
    assert decoder.state == before


@given(
    selector=st.integers(0, len(PREDICTORS) - 1),
    newest=samples,
    previous=samples,
    gap=st.integers(1, 65_535),
    ahead=st.floats(-1e9, 1e9),
    position=st.tuples(anything, anything, anything),
)
@settings(max_examples=400, deadline=None)
def test_whatever_an_update_says_the_force_is_finite_and_within_the_wire(
    selector: int,
    newest: tuple[int, ...],
    previous: tuple[int, ...],
    gap: int,
    ahead: float,
    position: tuple[float, float, float],
) -> None:
    channel = force_channel(bank=list(PREDICTORS))
    decoder = Decoder(channel)
    decoder.apply(Update(70_000, selector, newest, gap, previous))
    value = decoder.value(70_000 + ahead, position)
    assert value is not None
    assert is_finite(value)
    assert max(map(abs, value)) <= channel.value_quantizer.limit


def test_at_the_tick_of_a_sample_the_value_is_the_sample_even_on_a_stiff_model() -> None:
    channel = force_channel(predictor="plane")
    decoder = Decoder(channel)
    decoder.apply(Update(10, 0, (0, 0, 2000, 0, 0, -4), 5, (0, 0, 1000, 0, 0, -3)))
    assert decoder.value(10, (0.0, 0.0, -0.000044)) == (0.0, 0.0, 2.0)
    assert decoder.value(10.5, (0.0, 0.0, -0.000044)) == pytest.approx((0.0, 0.0, 2.4))


def test_extrapolation_without_end_is_confined_to_the_wire() -> None:
    decoder = Decoder(force_channel(predictor="linear"))
    decoder.apply(Update(1, 0, (0, 0, 2000, 0, 0, 0), 1, (0, 0, 1000, 0, 0, 0)))
    assert decoder.value(1e6) == pytest.approx((0.0, 0.0, 32.767))
    assert decoder.value(inf) == (0.0, 0.0, 2.0)
