from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.codec import Decoder, Update, force_channel, position_channel
from weberlink.codec.parameters import pack
from weberlink.codec.predictors import PREDICTORS
from weberlink.codec.predictors.hold import Hold
from weberlink.codec.predictors.surface import SURFACE, Surface
from weberlink.geometry.vector import ZERO, is_finite

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
@examples(400)
def test_whatever_an_update_says_the_force_is_finite_and_within_the_wire(
    selector: int,
    newest: tuple[int, ...],
    previous: tuple[int, ...],
    gap: int,
    ahead: float,
    position: tuple[float, float, float],
) -> None:
    channel = force_channel(predictor="adaptive", bank=list(PREDICTORS))
    decoder = Decoder(channel)
    decoder.apply(Update(70_000, selector, newest, gap, previous))
    for tick in (70_000 + ahead, 70_001, 70_000):
        value = decoder.value(tick, position)
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


def sliding() -> Decoder:
    """On a rough plane, normal z, of 500 N/m, 2 mm deep."""
    channel = force_channel(predictor="surface")
    newest = channel.sample(10, (0, 0, 1000, 0, 0, -200))
    model = Surface((0.0, 0.0, 1.0), ZERO, 10, 500.0, friction=0.3)
    decoder = Decoder(channel)
    decoder.apply(Update(10, 0, (0, 0, 1000, 0, 0, -200), *SURFACE.packed(model, newest, channel.grids)))
    return decoder


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_a_position_that_is_none_is_not_remembered_by_a_surface_that_rubs(bad: float) -> None:
    decoder, other = sliding(), sliding()
    decoder.value(11, (0.0, bad, -0.002))
    for axis in range(3):
        probe = tuple(bad if axis == each else 0.0 for each in range(3))
        shown = decoder.value(12, (probe[0], probe[1], probe[2]))
        assert shown is not None
        assert is_finite(shown)
    assert decoder.state[3] is not None
    assert is_finite(decoder.state[3])
    # It slides back to where the probe is, from wherever that was taken to be.
    for tick, x in enumerate((0.01, 0.02, 0.03), 13):
        decoder.value(tick, (x, 0.0, -0.002))
        other.value(tick, (x, 0.0, -0.002))
    assert decoder.value(16, (0.03, 0.0, -0.002)) == pytest.approx(other.value(16, (0.03, 0.0, -0.002)), abs=0.3)


def test_a_surface_that_rubs_pulls_back_and_a_new_update_forgets_how_far() -> None:
    decoder = sliding()
    assert decoder.value(11, (2e-4, 0.0, -0.002)) == pytest.approx((-0.1, 0.0, 1.0))
    assert decoder.value(12, (0.01, 0.0, -0.002)) == (-0.296875, 0.0, 1.0)
    assert decoder.state[3] == pytest.approx((0.01 - 0.296875 * 0.002, 0.0, 0.0))
    again = sliding()
    again.apply(Update(20, 0, (0, 0, 1000, 0, 0, -200)))
    assert again.state[3] is None
    assert again.value(21, (0.01, 0.0, -0.002)) == (0.0, 0.0, 1.0)


def test_parameters_that_say_nothing_hold_the_sample() -> None:
    """As of a surface whose normal is 0."""
    channel = force_channel(predictor="surface")
    widths = SURFACE.widths(channel.grids)
    nothing = [512, 512, 512, *[0] * (len(widths) - 3)]
    decoder = Decoder(channel)
    decoder.apply(Update(5, 0, (0, 0, 1000, 0, 0, 0), *pack(nothing, widths, 6)))
    assert decoder.state[1] == Hold((0.0, 0.0, 1.0))
    assert decoder.value(50, (0.0, 0.0, 1.0)) == (0.0, 0.0, 1.0)
