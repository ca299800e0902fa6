from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.vector import distance, norm
from weberlink.slave.scenes.moving import Sway, Wave

ALONG = (0.6, 0.0, 0.8)
STEP = 1e-5


def test_a_sine_begins_in_the_middle_and_reaches_both_ends() -> None:
    sway = Sway(ALONG, 0.02, 0.5)
    assert sway.at(0.0) == (0.0, 0.0, 0.0)
    assert sway.at(0.5) == pytest.approx((0.012, 0.0, 0.016))
    assert sway.at(1.5) == pytest.approx((-0.012, 0.0, -0.016))


@pytest.mark.parametrize("wave", ["sine", "triangle"])
@given(time=st.floats(0.0, 100.0), phase=st.floats(-1.0, 1.0))
def test_it_stays_within_its_amplitude_and_its_speed(wave: Wave, time: float, phase: float) -> None:
    sway = Sway(ALONG, 0.02, 1.5, phase, wave)
    assert norm(sway.at(time)) <= 0.02 * (1.0 + 1e-9)
    assert distance(sway.at(time), sway.at(time + STEP)) <= sway.speed * STEP * (1.0 + 1e-6)
    assert sway.at(time + 1.0 / 1.5) == pytest.approx(sway.at(time), abs=1e-9)


def test_a_triangle_goes_at_one_speed_between_the_same_ends() -> None:
    sway = Sway((1.0, 0.0, 0.0), 0.03, 0.5, 0.0, "triangle")
    assert sway.speed == pytest.approx(0.06)
    for time in (0.0, 0.1, 0.3, 1.6):
        assert (sway.at(time + 0.1)[0] - sway.at(time)[0]) / 0.1 == pytest.approx(0.06)
    assert (sway.at(1.1)[0] - sway.at(1.0)[0]) / 0.1 == pytest.approx(-0.06)
    assert sway.at(0.5)[0] == pytest.approx(0.03)
    assert sway.at(1.5)[0] == pytest.approx(-0.03)


def test_a_phase_is_a_share_of_a_turn_ahead_and_the_peak_speed_is_that_of_the_formula() -> None:
    ahead, plain = Sway(ALONG, 0.016, 1.0, 0.25), Sway(ALONG, 0.016, 1.0)
    assert ahead.at(0.1) == pytest.approx(plain.at(0.35))
    assert plain.speed == pytest.approx(2.0 * pi * 0.016)
    assert norm(plain.at(STEP)) / STEP == pytest.approx(plain.speed)
