"""Surfaces of scenes and of models: measured against shapes whose geometry is known."""

from math import inf, isnan, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.codec.predictors import plane as fitted_plane
from weberlink.codec.predictors import sphere as fitted_sphere
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import Vector, dot, norm, scale, unit
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.plane import PlaneShape
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.shape import Shape
from weberlink.slave.scenes.sphere import SphereShape
from weberlink.studies.moments.fitted_surface import (
    Frame,
    angle_deg,
    fitted_height,
    fitted_surface,
    frame_at,
    scene_height,
    scene_surface,
)

UP: Vector = (0.0, 0.0, 1.0)
FLAT = Frame((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), UP)


def scene(*shapes: Shape) -> Scene:
    return Scene([SceneObject(shape, 400.0 + 100.0 * number) for number, shape in enumerate(shapes)])


def test_a_plane_is_flat_a_ball_convex_and_a_hollow_concave() -> None:
    flat = scene_surface(scene(PlaneShape((0.0, 0.0, 0.002), (0.0, 0.0, 2.0))), (0.01, 0.02, -0.001))
    assert flat is not None
    assert flat.point == pytest.approx((0.01, 0.02, 0.002))
    assert (flat.normal, flat.stiffness_n_m, flat.radii_m) == (UP, 400.0, (inf, inf))
    ball = scene_surface(scene(SphereShape((0.0, 0.0, -0.03), 0.03)), (0.0, 0.0, -0.002))
    assert ball is not None
    assert ball.point == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert ball.radii_m == pytest.approx((0.03, 0.03), rel=1e-4)
    bowl = scene_surface(scene(SphereShape((0.0, 0.0, 0.03), 0.03, inside=True)), (0.0, 0.0, -0.002))
    assert bowl is not None
    assert bowl.normal == pytest.approx(UP)
    assert bowl.radii_m == pytest.approx((-0.03, -0.03), rel=1e-4)


def test_of_several_objects_the_one_that_holds_the_probe_counts() -> None:
    both = scene(PlaneShape((0.0, 0.0, 0.0), UP), SphereShape((0.0, 0.0, 0.0), 0.02))
    on_ball, on_plane = scene_surface(both, (0.0, 0.0, 0.018)), scene_surface(both, (0.09, 0.0, -0.001))
    assert on_ball is not None
    assert on_plane is not None
    assert (on_ball.stiffness_n_m, on_plane.stiffness_n_m) == (500.0, 400.0)
    assert scene_height(both, FLAT, 0.0, 0.0, 0.1) == pytest.approx(0.02, abs=1e-6)
    assert scene_height(both, FLAT, 0.05, 0.0, 0.1) == pytest.approx(0.0, abs=1e-6)


def test_an_empty_scene_has_no_surface() -> None:
    assert scene_surface(scene(), (0.0, 0.0, 0.0)) is None
    assert isnan(scene_height(scene(), FLAT, 0.0, 0.0, 0.1))


def test_a_surface_too_far_away_or_turned_away_is_none() -> None:
    far = scene(PlaneShape((0.0, 0.0, 0.5), UP))
    assert isnan(scene_height(far, FLAT, 0.0, 0.0, 0.1))
    assert scene_height(far, FLAT, 0.0, 0.0, 1.0) == pytest.approx(0.5)
    assert isnan(scene_height(scene(PlaneShape((0.0, 0.0, 0.01), (0.0, 0.0, -1.0))), FLAT, 0.0, 0.0, 0.1))


def test_a_steep_surface_is_found_exactly() -> None:
    steep = scene(PlaneShape((0.0, 0.0, 0.0), (1.0, 0.0, 0.1)))
    assert scene_height(steep, FLAT, -0.001, 0.0, 0.1) == pytest.approx(0.01, abs=2e-6)


def test_a_fitted_surface_is_where_the_force_begins() -> None:
    """Heights against the models' own forces: nothing just above, something just below."""
    models = (
        fitted_plane.Plane(unit((0.1, 0.2, 1.0)), -0.001, 500.0),
        fitted_sphere.Sphere((0.001, 0.0, -0.02), 0.02, 500.0, UP),
        fitted_sphere.Sphere((0.001, 0.0, 0.02), -0.02, 500.0, UP),
    )
    for model in models:
        for u, v in ((0.0, 0.0), (0.004, -0.003), (-0.005, 0.006)):
            height = fitted_height(model, FLAT, u, v)
            assert model.at(0, (u, v, height + 1e-6)) == (0.0, 0.0, 0.0)
            assert norm(model.at(0, (u, v, height - 1e-6))) > 0.0
            near = fitted_surface(model, (u, v, height - 1e-3))
            assert norm(model.at(0, near.point)) == pytest.approx(0.0, abs=1e-9)
            force = model.at(0, (u, v, height - 1e-3))
            assert near.normal == pytest.approx(scale(force, 1.0 / norm(force)))
    assert isnan(fitted_height(models[1], FLAT, 0.03, 0.0))
    assert fitted_surface(models[0], (0.0, 0.0, 0.0)).radii_m == (inf, inf)
    assert fitted_surface(models[1], (0.0, 0.0, 0.0)).radii_m == pytest.approx((0.02, 0.02))
    assert fitted_surface(models[2], (0.0, 0.0, 0.0)).radii_m == pytest.approx((-0.02, -0.02))


def test_a_plane_across_the_view_has_no_height() -> None:
    assert isnan(fitted_height(fitted_plane.Plane((1.0, 0.0, 0.0), 0.0, 500.0), FLAT, 0.0, 0.0))


coordinate = st.floats(-5.0, 5.0)


@given(st.tuples(coordinate, coordinate, coordinate).filter(lambda f: norm(f) > 0.1), st.tuples(*[coordinate] * 3))
def test_a_frame_is_right_handed_with_its_normal_along_the_force(force: Vector, towards: Vector) -> None:
    frame = frame_at(Sample(7, force, (0.1, 0.2, 0.3)), towards)
    axes = np.array([frame.along, frame.across, frame.normal])
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert dot(frame.normal, force) == pytest.approx(norm(force))
    assert dot(frame.across, towards) == pytest.approx(0.0, abs=1e-6)
    point = frame.point(0.01, -0.02, 0.03)
    assert frame.coordinates(np.array([point]))[0] == pytest.approx((0.01, -0.02, 0.03))


def test_angles() -> None:
    assert angle_deg(UP, UP) == 0.0
    assert angle_deg(UP, (1.0, 0.0, 0.0)) == pytest.approx(90.0)
    assert angle_deg((0.0, sqrt(0.5), sqrt(0.5)), UP) == pytest.approx(45.0)
