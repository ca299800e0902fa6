"""Laws that every shape obeys."""

from math import cos, pi, sin
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.slave.scenes.solids import SHAPES, field
from weberlink.geometry.vector import Vector, add, distance, dot, is_finite, norm, scale, subtract
from weberlink.slave.scenes.box import BoxShape
from weberlink.slave.scenes.derived import TurnedShape
from weberlink.slave.scenes.height_field import HeightFieldShape, bumps
from weberlink.slave.scenes.plane import PlaneShape
from weberlink.slave.scenes.sphere import SphereShape

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


def test_the_centre_of_a_sphere_has_a_way_out() -> None:
    ((gap, normal),) = SphereShape((0.01, 0.02, 0.03), 0.05).linearise((0.01, 0.02, 0.03))
    assert (gap, norm(normal)) == (-0.05, 1.0)
    ((gap, normal),) = SphereShape((0.01, 0.02, 0.03), 0.05, inside=True).linearise((0.01, 0.02, 0.03))
    assert (gap, norm(normal)) == (0.05, 1.0)


@given(excess=st.floats(0.0, 1e-160))
def test_a_corner_is_safe_however_near(excess: float) -> None:
    box = BoxShape((0.0, 0.0, 0.0), (2.0, 2.0, 2.0))
    for _, normal in box.linearise((1.0 + excess, 1.0 + excess, 1.0 + excess)):
        assert norm(normal) == pytest.approx(1.0)


@given(point=points, angles=st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_turning_keeps_distances(point: Vector, angles: Vector) -> None:
    pivot = (0.01, -0.02, 0.03)
    ball = SphereShape(pivot, 0.02)
    assert TurnedShape(ball, pivot, angles).clearance(point) == pytest.approx(ball.clearance(point), abs=1e-12)


def test_yaw_turns_from_x_to_y() -> None:
    long_in_y = TurnedShape(BoxShape((0.0, 0.0, 0.0), (0.1, 0.02, 0.02)), (0.0, 0.0, 0.0), (0.0, 0.0, pi / 2.0))
    assert long_in_y.clearance((0.0, 0.04, 0.0)) == pytest.approx(-0.01)
    ((gap, normal),) = long_in_y.linearise((0.0, 0.06, 0.0))
    assert gap == pytest.approx(0.01)
    assert normal == pytest.approx((0.0, 1.0, 0.0))


@given(point=points)
def test_the_height_field_has_no_step_in_height_or_normal(point: Vector) -> None:
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
def test_a_steep_height_field_is_not_nearer_than_it_says(
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


def test_bumps_are_the_formula_to_interpolation_accuracy() -> None:
    heights, spacing = bumps(0.003, 0.02, 0.06)
    surface = HeightFieldShape(heights, spacing, (0.0, 0.0, 0.0))
    for i in range(50):
        x, y = 0.06 * i / 49.0, 0.06 * ((7 * i) % 50) / 49.0
        exact = 0.003 * (1.0 - cos(2.0 * pi * x / 0.02)) * (1.0 - cos(2.0 * pi * y / 0.02)) / 4.0
        ((gap, normal),) = surface.linearise((x, y, exact))
        assert abs(gap) < 1e-5
        slope = 0.003 * sin(2.0 * pi * x / 0.02) * (2.0 * pi / 0.02) * (1.0 - cos(2.0 * pi * y / 0.02)) / 4.0
        assert -normal[0] / normal[2] == pytest.approx(slope, abs=0.05), "the border sees level ground beyond it"


def test_beyond_its_grid_the_border_of_a_height_field_goes_on() -> None:
    surface = HeightFieldShape([[0.01, 0.02], [0.03, 0.04]], 0.01, (0.0, 0.0, 0.0))
    assert surface.clearance((-1.0, -1.0, 0.01)) == pytest.approx(0.0, abs=1e-12)
    assert surface.clearance((1e6, 1e6, 0.04)) == pytest.approx(0.0, abs=1e-12)
    ((_, normal),) = surface.linearise((1.0, -1.0, 0.0))
    assert normal == pytest.approx((0.0, 0.0, 1.0))


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
