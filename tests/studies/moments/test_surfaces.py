"""Surfaces of scenes and of models, against shapes of known geometry."""

from math import inf, isnan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.codec.predictors import plane as fitted_plane
from weberlink.codec.predictors import sphere as fitted_sphere
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import Vector, dot, norm, scale, unit
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.shape import Shape
from weberlink.slave.scenes.solids import PlaneShape, SphereShape
from weberlink.studies.moments.surfaces import FittedSurface, SceneSurface, SurfaceFrame, frame_at

UP: Vector = (0.0, 0.0, 1.0)
FLAT = SurfaceFrame((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), UP)
coordinate = st.floats(-5.0, 5.0)


def scene(*shapes: Shape) -> SceneSurface:
    return SceneSurface(Scene([SceneObject(shape, 400.0 + 100.0 * number) for number, shape in enumerate(shapes)]))


@pytest.mark.parametrize(
    ("shape", "radius"),
    [
        (PlaneShape((0.0, 0.0, 0.0), (0.0, 0.0, 2.0)), inf),
        (SphereShape((0.0, 0.0, -0.03), 0.03), 0.03),
        (SphereShape((0.0, 0.0, 0.03), 0.03, inside=True), -0.03),
    ],
)
def test_a_scene_is_flat_convex_or_concave(shape: Shape, radius: float) -> None:
    found = scene(shape).nearest((0.0, 0.0, -0.002))
    assert found is not None
    assert found.point == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert found.normal == pytest.approx(UP)
    assert found.stiffness_n_m == 400.0
    assert found.radius_m == pytest.approx(radius, rel=1e-4)


def test_the_nearest_of_several_objects_counts() -> None:
    both = scene(PlaneShape((0.0, 0.0, 0.0), UP), SphereShape((0.0, 0.0, 0.0), 0.02))
    on_ball, on_plane = both.nearest((0.0, 0.0, 0.018)), both.nearest((0.09, 0.0, -0.001))
    assert on_ball is not None
    assert on_plane is not None
    assert (on_ball.stiffness_n_m, on_plane.stiffness_n_m) == (500.0, 400.0)
    assert both.height(FLAT, 0.0, 0.0, 0.1) == pytest.approx(0.02, abs=1e-6)
    assert both.height(FLAT, 0.05, 0.0, 0.1) == pytest.approx(0.0, abs=1e-6)


def test_heights_of_a_scene() -> None:
    assert scene().nearest((0.0, 0.0, 0.0)) is None
    assert isnan(scene().height(FLAT, 0.0, 0.0, 0.1))
    far = scene(PlaneShape((0.0, 0.0, 0.5), UP))
    assert isnan(far.height(FLAT, 0.0, 0.0, 0.1))
    assert far.height(FLAT, 0.0, 0.0, 1.0) == pytest.approx(0.5)
    turned_away = scene(PlaneShape((0.0, 0.0, 0.01), (0.0, 0.0, -1.0)))
    assert isnan(turned_away.height(FLAT, 0.0, 0.0, 0.1))
    steep = scene(PlaneShape((0.0, 0.0, 0.0), (1.0, 0.0, 0.1)))
    assert steep.height(FLAT, -0.001, 0.0, 0.1) == pytest.approx(0.01, abs=2e-6)


@pytest.mark.parametrize(
    ("model", "radius"),
    [
        (fitted_plane.Plane(unit((0.1, 0.2, 1.0)), -0.001, 500.0), inf),
        (fitted_sphere.Sphere((0.001, 0.0, -0.02), 0.02, 500.0, UP), 0.02),
        (fitted_sphere.Sphere((0.001, 0.0, 0.02), -0.02, 500.0, UP), -0.02),
    ],
)
def test_a_fitted_surface_is_where_the_force_begins(
    model: fitted_plane.Plane | fitted_sphere.Sphere, radius: float
) -> None:
    surface = FittedSurface(model.record())
    assert surface.radius == pytest.approx(radius)
    for u, v in ((0.0, 0.0), (0.004, -0.003), (-0.005, 0.006)):
        height = surface.height(FLAT, u, v)
        assert model.at(0, (u, v, height + 1e-6)) == (0.0, 0.0, 0.0)
        assert norm(model.at(0, (u, v, height - 1e-6))) > 0.0
        near = surface.nearest((u, v, height - 1e-3))
        assert near.radius_m == pytest.approx(radius)
        assert norm(model.at(0, near.point)) == pytest.approx(0.0, abs=1e-9)
        force = model.at(0, (u, v, height - 1e-3))
        assert near.normal == pytest.approx(scale(force, 1.0 / norm(force)))
    assert isnan(surface.height(FLAT, 0.03, 0.0)) == (radius < inf)


def test_a_plane_across_the_view_has_no_height() -> None:
    across = fitted_plane.Plane((1.0, 0.0, 0.0), 0.0, 500.0)
    assert isnan(FittedSurface(across.record()).height(FLAT, 0.0, 0.0))


@examples(50)
@given(st.tuples(coordinate, coordinate, coordinate).filter(lambda f: norm(f) > 0.1), st.tuples(*[coordinate] * 3))
def test_a_frame_is_right_handed_along_the_force(force: Vector, towards: Vector) -> None:
    frame = frame_at(Sample(7, force, (0.1, 0.2, 0.3)), towards)
    axes = np.array([frame.along, frame.across, frame.normal])
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert dot(frame.normal, force) == pytest.approx(norm(force))
    assert dot(frame.across, towards) == pytest.approx(0.0, abs=1e-6)
    point = frame.point(0.01, -0.02, 0.03)
    assert frame.coordinates(np.array([point]))[0] == pytest.approx((0.01, -0.02, 0.03))
