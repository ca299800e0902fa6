"""Laws of contact."""

from math import cos, inf, nan, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.slave.scenes.solids import GROUND, SHAPES, STIFFNESS, elastic, scenes, wander
from weberlink.geometry.vector import ZERO, Vector, distance, interpolate, is_finite, norm, scale, subtract
from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import BoxShape, SphereShape

TICK = 0.001
near = st.floats(-0.08, 0.08)
points = st.tuples(near, near, near)
finite = st.floats(allow_nan=False, allow_infinity=False)
SCENES = tuple(scenes())


def walked(scene: Scene, start: Vector, end: Vector, steps: int) -> Vector:
    """The force at `end` after a straight walk."""
    force = ZERO
    for i in range(steps + 1):
        force = scene.force(interpolate(start, end, i / steps), TICK)
    return force


@given(depth=st.floats(0.0, 0.02), azimuth=st.floats(-pi, pi), height=st.floats(-1.0, 1.0))
def test_proxy_on_a_sphere_is_the_closest_point(depth: float, azimuth: float, height: float) -> None:
    """f = k (R - L) outward, to a nanometre of depth, after a walk around the sphere."""
    radius = 0.03
    scene = elastic(SphereShape(ZERO, radius))
    walked(scene, (0.0, 0.0, 0.05), (0.0, 0.0, radius - depth), 40)
    position = ZERO
    for i in range(201):
        a, b = azimuth * i / 200, height * 1.2 * i / 200
        direction = (sin(a) * cos(b), sin(b), cos(a) * cos(b))
        position = scale(direction, radius - depth)
        force = scene.force(position, TICK)
        assert norm(subtract(force, scale(direction, STIFFNESS * depth))) < 1e-9 * STIFFNESS + 1e-12


@pytest.mark.parametrize("thickness", [0.02, 0.002, 0.0002])
@given(x=st.floats(-0.04, 0.04), y=st.floats(-0.04, 0.04), jump=st.floats(0.001, 0.5))
def test_no_jump_passes_a_plate(thickness: float, x: float, y: float, jump: float) -> None:
    scene = elastic(BoxShape(ZERO, (0.1, 0.1, thickness)))
    scene.force((x, y, thickness / 2.0 + jump / 2.0), TICK)
    force = scene.force((x, y, -jump / 2.0), TICK)
    assert force == pytest.approx((0.0, 0.0, STIFFNESS * (thickness / 2.0 + jump / 2.0)))


@pytest.mark.parametrize("name", SCENES)
def test_the_proxy_never_enters_a_solid(name: str) -> None:
    """On a smooth path, at every tick, to a micrometre."""
    # Deeper in the bumps than their radius, the proxy rolls off a crest, which takes it a tick or two.
    allowed = 2e-5 if name == "height field" else 1e-6
    scene = scenes()[name]
    shapes = [SHAPES[name]] if name in SHAPES else []
    touched = 0
    for position in wander(2500):
        scene.force(position, TICK)
        touched += scene.contacts > 0
        proxy = scene.proxy
        assert proxy is not None
        assert all(shape.clearance(proxy) > -allowed for shape in shapes)
        if not scene.contacts:
            assert distance(proxy, position) < 1e-6
    assert touched > 100


@pytest.mark.parametrize("name", SCENES)
@examples(60)
@given(
    path=st.lists(st.one_of(points, st.tuples(finite, finite, finite)), min_size=1, max_size=8), dt=st.floats(0.0, 1.0)
)
def test_whatever_the_positions_the_force_is_finite(name: str, path: list[Vector], dt: float) -> None:
    scene = scenes()[name]
    for position in path:
        assert is_finite(scene.force(position, dt))
        assert scene.proxy is None or is_finite(scene.proxy)


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_non_finite_position_gives_zero_force(bad: float) -> None:
    scene = elastic(GROUND)
    scene.force((0.0, 0.0, 0.01), TICK)
    held = scene.force((0.0, 0.0, -0.01), TICK)
    for position in ((bad, 0.0, -0.01), (0.0, bad, -0.01), (0.0, 0.0, bad)):
        assert scene.force(position, TICK) == ZERO
    assert scene.rejected == 3
    assert scene.force((0.0, 0.0, -0.01), TICK) == held, "the contact is as it was"


@given(st.floats(1.0, 1e5), st.floats(1e-5, 0.02), st.floats(0.0, 0.01))
@examples(40)
def test_a_softened_scene_yields_as_if_made_of_the_softer_material(most: float, depth: float, aside: float) -> None:
    """Stiffness is cut to the limit, damping falls in proportion, and friction stays a share of the pressure."""
    cone = FrictionCone(static=0.6, dynamic=0.4)
    softened = Scene([SceneObject(GROUND, 1e4, cone, 20.0), SceneObject(GROUND, 300.0, None, 5.0)])
    softened.soften(most)
    made = Scene(
        [
            SceneObject(GROUND, min(1e4, most), cone, 20.0 * min(1.0, most / 1e4)),
            SceneObject(GROUND, min(300.0, most), None, 5.0 * min(1.0, most / 300.0)),
        ]
    )
    assert softened.stiffness_n_m == min(1e4, most)
    assert softened.damping_n_s_m == pytest.approx(made.damping_n_s_m)
    assert softened.rubs
    for position in ((0.0, 0.0, 0.01), (0.0, 0.0, -depth), (aside, 0.0, -depth), (aside, 0.0, -0.5 * depth)):
        assert softened.force(position, TICK) == pytest.approx(made.force(position, TICK))
    for softer, expected in zip(softened.facing((0.0, 0.0, 0.01)), made.facing((0.0, 0.0, 0.01)), strict=True):
        assert (softer.stiffness, softer.damping) == pytest.approx((expected.stiffness, expected.damping))
