from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.vector import distance
from weberlink.studies.evaluate.scenes import ball, bowl, level

CENTER = (0.01, -0.02, 0.03)
LENGTHS = st.floats(-0.04, 0.04)


@given(u=LENGTHS, v=LENGTHS, above=st.floats(-0.02, 0.02))
def test_above_is_the_distance_from_the_surface(u: float, v: float, above: float) -> None:
    assert level(0.01)((u, v, above)) == pytest.approx((u, v, 0.01 + above))
    assert distance(ball(CENTER, 0.05)((u, v, above)), CENTER) == pytest.approx(0.05 + above)
    assert distance(bowl(CENTER, 0.05)((u, v, above)), CENTER) == pytest.approx(0.05 - above)


def test_the_middle_is_on_top_of_a_ball_and_at_the_bottom_of_a_bowl() -> None:
    assert ball(CENTER, 0.05)((0.0, 0.0, 0.001)) == pytest.approx((0.01, -0.02, 0.081))
    assert bowl(CENTER, 0.05)((0.0, 0.0, 0.001)) == pytest.approx((0.01, -0.02, -0.019))


def test_u_and_v_are_lengths_along_the_surface() -> None:
    quarter = 0.05 * pi / 2.0
    assert ball(CENTER, 0.05)((quarter, 0.0, 0.0)) == pytest.approx((0.06, -0.02, 0.03))
    assert bowl(CENTER, 0.05)((0.0, -quarter, 0.0)) == pytest.approx((0.01, -0.07, 0.03))
