"""Laws that every shape obeys."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.slave.scenes.solids import SHAPES, field
from weberlink.geometry.vector import Vector, add, distance, dot, is_finite, norm, scale, subtract
from weberlink.slave.scenes.height_field import HeightFieldShape
from weberlink.slave.scenes.solids import BoxShape, PlaneShape, SphereShape

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
@given(point=points)
def test_the_gradient_predicts_the_distance_nearby(name: str, point: Vector) -> None:
    """Second order at a smooth surface; kinks (edges) are left out by comparing the normals at both ends."""
    shape = SHAPES[name]
    before = shape.linearise(point)
    step = scale(before[0][1], 1e-5)
    after = shape.linearise(add(point, step))
    if len(before) == len(after) == 1 and dot(before[0][1], after[0][1]) > 0.99 and abs(before[0][0]) < 1e-3:
        assert after[0][0] - before[0][0] == pytest.approx(1e-5, rel=0.05)


@every_shape
@given(point=st.tuples(everywhere, everywhere, everywhere))
def test_any_finite_point_is_answered(name: str, point: Vector) -> None:
    shape = SHAPES[name]
    assert shape.clearance(point) - shape.clearance(point) == 0.0
    assert all(is_finite(normal) for _, normal in shape.linearise(point))


@given(excess=st.floats(0.0, 1e-160))
def test_a_corner_is_safe_however_near(excess: float) -> None:
    box = BoxShape((0.0, 0.0, 0.0), (2.0, 2.0, 2.0))
    for _, normal in box.linearise((1.0 + excess, 1.0 + excess, 1.0 + excess)):
        assert norm(normal) == pytest.approx(1.0)


@given(point=points)
def test_height_field_is_smooth(point: Vector) -> None:
    surface = field()
    for axis in ((1e-9, 0.0, 0.0), (0.0, 1e-9, 0.0)):
        ((a, m),), ((b, n),) = surface.linearise(point), surface.linearise(add(point, axis))
        assert abs(a - b) < 1e-8
        assert norm(subtract(m, n)) < 1e-5


@given(
    seed=st.integers(0, 1000),
    surface=st.tuples(*[st.floats(0.0, 0.01)] * 2),
    offset=st.tuples(*[st.floats(-0.0015, 0.0015)] * 3),
)
def test_clearance_of_steep_height_field_is_conservative(
    seed: int, surface: tuple[float, float], offset: Vector
) -> None:
    """Cliffs of 5 mm over 1 mm, where the vertical distance says little."""
    draw = Random(seed)
    cliffs = HeightFieldShape(
        [[draw.choice((0.0, 0.005)) for _ in range(11)] for _ in range(11)], 0.001, (0.0, 0.0, 0.0)
    )
    height = -cliffs.clearance((*surface, -1.0)) - 1.0
    clearance = cliffs.clearance(add((*surface, height), offset))
    if clearance > 0.0:
        assert norm(offset) >= clearance - 1e-12


def test_the_height_field_passes_through_its_samples() -> None:
    heights = [[0.0, 0.001, 0.0], [0.002, -0.001, 0.004]]
    surface = HeightFieldShape(heights, 0.01, (0.5, 0.25, 0.1))
    for row, values in enumerate(heights):
        for column, height in enumerate(values):
            assert surface.clearance((0.5 + 0.01 * column, 0.25 + 0.01 * row, 0.1 + height)) == pytest.approx(
                0.0, abs=1e-15
            )


@pytest.mark.parametrize(
    ("build", "named"),
    [
        (lambda: PlaneShape((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), "normal"),
        (lambda: SphereShape((0.0, 0.0, 0.0), 0.0), "radius"),
        (lambda: SphereShape((0.0, 0.0, 0.0), -1.0, inside=True), "radius"),
        (lambda: BoxShape((0.0, 0.0, 0.0), (1.0, 0.0, 1.0)), "size"),
        (lambda: HeightFieldShape([[0.0, 0.0]], 0.01, (0.0, 0.0, 0.0)), "heights"),
        (lambda: HeightFieldShape([[0.0, 0.0], [0.0]], 0.01, (0.0, 0.0, 0.0)), "heights"),
        (lambda: HeightFieldShape([[0.0, float("nan")], [0.0, 0.0]], 0.01, (0.0, 0.0, 0.0)), "heights"),
        (lambda: HeightFieldShape([[0.0, 0.0], [0.0, 0.0]], 0.0, (0.0, 0.0, 0.0)), "spacing"),
    ],
)
def test_an_impossible_shape_is_refused_by_name(build: object, named: str) -> None:
    assert callable(build)
    with pytest.raises(ValueError, match=named):
        build()
