"""Laws that every shape obeys."""

import pytest
from hypothesis import given, strategies as st

from tests.slave.scenes.solids import SHAPES
from weberlink.geometry.vector import Vector, distance, is_finite, norm
from weberlink.slave.scenes.height_field import HeightFieldShape

near = st.floats(-0.08, 0.08)
points = st.tuples(near, near, near)
everywhere = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12)
every_shape = pytest.mark.parametrize("name", SHAPES)


@every_shape
@given(free=points, other=points)
def test_clearance_is_a_free_ball(name: str, free: Vector, other: Vector) -> None:
    shape = SHAPES[name]
    if shape.clearance(other) < 0.0:
        assert distance(free, other) >= shape.clearance(free) - 1e-12


@every_shape
@given(point=points)
def test_normals_are_unit_and_distances_agree_in_sign(name: str, point: Vector) -> None:
    shape = SHAPES[name]
    tangents = shape.linearise(point)
    for _, normal in tangents:
        assert norm(normal) == pytest.approx(1.0, abs=1e-12)
    smallest = min(distance for distance, _ in tangents)
    assert (smallest > 0.0) == (shape.clearance(point) > 0.0)


@every_shape
@given(point=st.tuples(everywhere, everywhere, everywhere))
def test_any_finite_point_is_answered(name: str, point: Vector) -> None:
    shape = SHAPES[name]
    assert shape.clearance(point) - shape.clearance(point) == 0.0
    assert all(is_finite(normal) for _, normal in shape.linearise(point))


def test_the_height_field_passes_through_its_samples() -> None:
    heights = [[0.0, 0.001, 0.0], [0.002, -0.001, 0.004]]
    surface = HeightFieldShape(heights, 0.01, (0.5, 0.25, 0.1))
    for row, values in enumerate(heights):
        for column, height in enumerate(values):
            assert surface.clearance((0.5 + 0.01 * column, 0.25 + 0.01 * row, 0.1 + height)) == pytest.approx(
                0.0, abs=1e-15
            )
