"""Lengths: right for every number there is, and the same on every host that keeps IEEE 754."""

from math import dist, hypot, inf, isnan, nan, sqrt

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from weberlink.geometry.vector import ZERO, Vector, distance, norm, toward, unit

numbers = st.floats(allow_nan=False, allow_infinity=False)
close = st.floats(-1e-150, 1e-150)
edges = st.sampled_from([5e-324, -5e-324, 1e-200, 1e200, -1e200, 1.7e308, 1.0, 1e-170, 2.0**-450, 0.0])
vectors = st.tuples(numbers, numbers, numbers) | st.tuples(close, close, close) | st.tuples(edges, edges, edges)


@given(vectors)
@examples(500)
def test_a_length_is_that_of_the_library_to_2_units_in_the_last_place(vector: Vector) -> None:
    assert norm(vector) == pytest.approx(hypot(*vector), rel=5e-16, abs=5e-324)
    assert distance(vector, ZERO) == norm(vector)
    x, y, z = vector
    assert norm((x, 0.0, 0.0)) == norm((0.0, x, 0.0)) == norm((0.0, 0.0, x)) == abs(x)
    if 1e-250 < x * x + y * y + z * z < 1e300:
        assert norm(vector) == sqrt(x * x + y * y + z * z)
    if 1e-300 < norm(vector) < inf:
        assert norm(unit(vector)) == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize("axis", range(3))
def test_what_is_not_finite_has_no_finite_length(axis: int) -> None:
    assert norm(tuple(inf if each == axis else 1.0 for each in range(3))) == inf  # type: ignore[arg-type]
    assert isnan(norm(tuple(nan if each == axis else 1e300 for each in range(3))))  # type: ignore[arg-type]
    assert distance((inf, 0.0, 0.0), ZERO) == inf


@given(st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=4), st.data(), st.floats(0.0, 5.0))
def test_a_step_goes_straight_to_the_goal_and_no_further(goal: list[float], data: st.DataObject, way: float) -> None:
    start = data.draw(st.tuples(*[st.floats(-20.0, 20.0)] * len(goal)))
    moved, apart = toward(start, tuple(goal), way), dist(start, goal)
    assert dist(start, moved) == pytest.approx(min(way, apart))
    assert dist(moved, goal) == pytest.approx(max(0.0, apart - way), abs=1e-9)
    assert moved == tuple(goal) or apart > way
    assert toward(start, tuple(goal), nan) == tuple(goal)
