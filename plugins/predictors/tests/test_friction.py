"""A surface with friction in a decoder, which remembers where it holds the probe."""

from math import inf, nan

import pytest

from weberlink.codec import Decoder, Update, force_channel
from weberlink.codec.predictors.contract import Hold
from weberlink.geometry.vector import ZERO, is_finite
from weberlink.update import ModelParameters
from weberlink_predictors.parameters import pack
from weberlink_predictors.surface import SURFACE, SurfacePatch, widths_of

CHANNEL = force_channel(predictor="surface")
NEWEST = (0, 0, 1000, 0, 0, -200)
MODEL = SurfacePatch((0.0, 0.0, 1.0), ZERO, 10, 500.0, friction=0.3)
RUBBING = Update(10, 0, NEWEST, SURFACE.packed(MODEL, CHANNEL.grid.sample(10, NEWEST), CHANNEL.grid))
"""A plane with friction, normal z, of 500 N/m, 2 mm deep."""


def sliding() -> Decoder:
    decoder = Decoder(CHANNEL)
    decoder.apply(RUBBING)
    return decoder


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_friction_does_not_remember_a_position_that_is_not_finite(bad: float) -> None:
    decoder, other = sliding(), sliding()
    decoder.value(11, (0.0, bad, -0.002))
    for axis in range(3):
        probe = tuple(bad if axis == each else 0.0 for each in range(3))
        shown = decoder.value(12, (probe[0], probe[1], probe[2]))
        assert shown is not None
        assert is_finite(shown)
    assert is_finite(decoder.state[0][3])
    # The god-object slides to the probe again, wherever it was.
    for tick, x in enumerate((0.01, 0.02, 0.03), 13):
        decoder.value(tick, (x, 0.0, -0.002))
        other.value(tick, (x, 0.0, -0.002))
    assert decoder.value(16, (0.03, 0.0, -0.002)) == pytest.approx(other.value(16, (0.03, 0.0, -0.002)), abs=0.3)


def test_friction_pulls_back_and_a_new_update_forgets_how_far() -> None:
    decoder = sliding()
    assert decoder.value(11, (2e-4, 0.0, -0.002)) == pytest.approx((-0.1, 0.0, 1.0))
    assert decoder.value(12, (0.01, 0.0, -0.002)) == (-0.296875, 0.0, 1.0)
    assert decoder.state[0][3] == pytest.approx((0.01 - 0.296875 * 0.002, 0.0, 0.0))
    decoder.apply(Update(20, 0, NEWEST))
    assert decoder.state[0][3] is None
    assert decoder.value(21, (0.01, 0.0, -0.002)) == (0.0, 0.0, 1.0)


def test_a_repeat_of_an_update_does_not_rewind_the_memory_of_friction() -> None:
    """A datagram whose acknowledgement is late is repeated. The probe slides 10 mm and 1.2 mm back meanwhile."""
    repeated, other = sliding(), sliding()
    for decoder in (repeated, other):
        decoder.value(11, (0.01, 0.0, -0.002))
    repeated.apply(RUBBING)
    back = (0.0088, 0.0, -0.002)
    assert repeated.value(12, back) == other.value(12, back) == pytest.approx((0.296875, 0.0, 1.0))


def test_parameters_without_a_normal_hold_the_sample() -> None:
    widths = widths_of(CHANNEL.grid)
    nothing = pack([0, 512, 512, 512, *[0] * (len(widths) - 4)], widths)
    decoder = Decoder(CHANNEL)
    decoder.apply(Update(5, 0, (0, 0, 1000, 0, 0, 0), ModelParameters(nothing)))
    assert decoder.model == Hold((0.0, 0.0, 1.0))
    assert decoder.value(50, (0.0, 0.0, 1.0)) == (0.0, 0.0, 1.0)
