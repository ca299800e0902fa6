"""Laws of contact: proxy, friction, and objects that move."""

from math import cos, inf, nan, pi, sin
from typing import Any

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from tests.slave.scenes.solids import GROUND, SHAPES, STIFFNESS, UP, elastic, scenes, wander
from weberlink.geometry.vector import ZERO, Vector, distance, dot, is_finite, norm, scale, subtract, unit
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.slave.scenes.proxy import smallest_push
from weberlink.slave.scenes.scene import FrictionCone, Scene, SceneObject, Sway
from weberlink.slave.scenes.shape import BoxShape, SphereShape

TICK = 0.001
CONE = FrictionCone(static=0.5, dynamic=0.4)
RISING = Sway(direction=UP, amplitude_m=0.016, frequency_hz=1.0)
TWISTED = Sway(direction=(0.48, 0.6, 0.64), amplitude_m=0.002, frequency_hz=1.9, phase_deg=36.0)
FAR = Sway(direction=(1.0, 0.0, 0.0), amplitude_m=10.0, frequency_hz=0.1, phase_deg=108.0, wave="triangle")
points = st.tuples(*[st.floats(-0.08, 0.08)] * 3)
wild = st.tuples(*[st.floats(-0.05, 0.05) | st.floats() | st.sampled_from([1e300, 1e11])] * 3)
times = st.floats(0.0, 0.02) | st.floats() | st.sampled_from([-1.0, 1e11, 1e300])


@given(depth=st.floats(0.0, 0.02), azimuth=st.floats(-pi, pi), height=st.floats(-1.0, 1.0))
def test_proxy_on_a_sphere_is_the_closest_point(depth: float, azimuth: float, height: float) -> None:
    """f = k (R - L) outward, to a nanometre of depth, after a walk down and around the sphere."""
    radius = 0.03
    scene = elastic(SphereShape(ZERO, radius))
    for i in range(41):
        scene.force((0.0, 0.0, 0.05 + (radius - depth - 0.05) * i / 40.0), TICK)
    for i in range(201):
        a, b = azimuth * i / 200, height * 1.2 * i / 200
        direction = (sin(a) * cos(b), sin(b), cos(a) * cos(b))
        force = scene.force(scale(direction, radius - depth), TICK)
        assert norm(subtract(force, scale(direction, STIFFNESS * depth))) < 1e-9 * STIFFNESS + 1e-12


@pytest.mark.parametrize("thickness", [0.02, 0.002, 0.0002])
@given(x=st.floats(-0.04, 0.04), y=st.floats(-0.04, 0.04), jump=st.floats(0.001, 0.5))
def test_no_jump_passes_a_plate(thickness: float, x: float, y: float, jump: float) -> None:
    scene = elastic(BoxShape(ZERO, (0.1, 0.1, thickness)))
    scene.force((x, y, thickness / 2.0 + jump / 2.0), TICK)
    force = scene.force((x, y, -jump / 2.0), TICK)
    assert force == pytest.approx((0.0, 0.0, STIFFNESS * (thickness / 2.0 + jump / 2.0)))


@pytest.mark.parametrize("name", scenes())
def test_the_proxy_never_enters_a_solid(name: str) -> None:
    """On a smooth path, at every tick, to a micrometre."""
    # Deeper in the bumps than their radius, the proxy rolls off a crest, which takes it a tick or two.
    allowed = 2e-5 if name == "height field" else 1e-6
    scene = scenes()[name]
    shapes = [SHAPES[name]] if name in SHAPES else []
    touched = 0
    for position in wander(2500):
        scene.force(position, TICK)
        touched += bool(scene.state.touched)
        proxy = scene.proxy
        assert proxy is not None
        assert all(shape.clearance(proxy) > -allowed for shape in shapes)
        if not scene.state.touched:
            assert distance(proxy, position) < 1e-6
    assert touched > 100


@pytest.mark.parametrize("name", [*scenes(), "moving"])
@examples(60)
@given(steps=st.lists(st.tuples(points | wild, times), min_size=1, max_size=12))
def test_whatever_comes_the_force_is_finite(name: str, steps: list[tuple[Vector, float]]) -> None:
    moving = ((GROUND, RISING), (SHAPES["sphere"], TWISTED), (SHAPES["box"], FAR))
    things = [SceneObject(shape, STIFFNESS, CONE, 2.0, motion) for shape, motion in moving]
    scene = Scene(things) if name == "moving" else scenes()[name]
    for position, dt in steps:
        assert is_finite(scene.force(position, dt))
        assert scene.proxy is None or is_finite(scene.proxy)


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_non_finite_position_gives_zero_force(bad: float) -> None:
    scene = elastic(GROUND)
    scene.force((0.0, 0.0, 0.01), TICK)
    held = scene.force((0.0, 0.0, -0.01), TICK)
    for position in ((bad, 0.0, -0.01), (0.0, bad, -0.01), (0.0, 0.0, bad)):
        assert scene.force(position, TICK) == ZERO
    assert scene.force((0.0, 0.0, -0.01), TICK) == held, "the contact is as it was"


@given(st.floats(1.0, 1e5), st.floats(1e-5, 0.02), st.floats(0.0, 0.01))
@examples(40)
def test_a_softened_scene_yields_as_if_made_of_the_softer_material(most: float, depth: float, aside: float) -> None:
    """Stiffness is cut to the limit, damping falls in proportion, and friction stays a share of the pressure."""
    things = (SceneObject(GROUND, 1e4, CONE, 20.0), SceneObject(GROUND, 300.0, None, 5.0))
    softened = Scene([thing.softened(most) for thing in things])
    stiff = SceneObject(GROUND, min(1e4, most), CONE, 20.0 * min(1.0, most / 1e4))
    made = Scene([stiff, SceneObject(GROUND, min(300.0, most), None, 5.0 * min(1.0, most / 300.0))])
    assert (softened.stiffness_n_m, softened.rubs) == (min(1e4, most), True)
    assert softened.damping_n_s_m == pytest.approx(made.damping_n_s_m)
    for position in ((0.0, 0.0, 0.01), (0.0, 0.0, -depth), (aside, 0.0, -depth), (aside, 0.0, -0.5 * depth)):
        assert softened.force(position, TICK) == pytest.approx(made.force(position, TICK))
    for softer, expected in zip(softened.facing((0.0, 0.0, 0.01)), made.facing((0.0, 0.0, 0.01)), strict=True):
        assert (softer.stiffness, softer.damping) == pytest.approx((expected.stiffness, expected.damping))


@given(st.tuples(*[st.floats(-0.01, 0.01)] * 2), st.tuples(*[st.floats(-1.0, 1.0)] * 6))
def test_a_plane_far_in_front_changes_no_push(violations: tuple[float, float], sides: tuple[float, ...]) -> None:
    """To the last bit: two planes have a shorter way of their own."""
    normals = [unit(subtract(side, (0.0, 0.0, -2.0))) for side in (sides[:3], sides[3:])]
    assert smallest_push(violations, normals) == smallest_push((*violations, -1.0), [*normals, UP])


# Friction.

DEPTH = 0.004


def pressed() -> Scene:
    """On rough ground at the origin, under 2 N."""
    scene = Scene([SceneObject(GROUND, STIFFNESS, CONE)])
    scene.force((0.0, 0.0, 0.001), TICK)
    scene.force((0.0, 0.0, -DEPTH), TICK)
    return scene


@given(share=st.floats(-0.999, 0.999))
def test_within_the_static_cone_it_sticks(share: float) -> None:
    scene, x = pressed(), CONE.static * DEPTH * share
    assert scene.force((x, 0.0, -DEPTH), TICK) == pytest.approx((-STIFFNESS * x, 0.0, STIFFNESS * DEPTH))
    assert scene.force((0.0, 0.0, -DEPTH), TICK) == pytest.approx((0.0, 0.0, STIFFNESS * DEPTH))


def test_stepwise_positions_keep_the_sliding_force() -> None:
    """Nine ticks of standstill between jumps, as a decoded position has them: no return to the static limit."""
    scene = pressed()
    for jump in range(1, 60):
        for _ in range(10):
            force = scene.force((0.0004 * jump, 0.0, -DEPTH), TICK)
        if 0.0004 * jump > CONE.static * DEPTH:
            assert force[0] == pytest.approx(-CONE.dynamic * STIFFNESS * DEPTH)


@given(steps=st.lists(st.tuples(*[st.floats(-0.001, 0.001)] * 3), min_size=1, max_size=60))
def test_force_stays_in_cone_on_curved_surface(steps: list[Vector]) -> None:
    ball = SphereShape((0.0, 0.0, -0.03), 0.03)
    scene = Scene([SceneObject(ball, STIFFNESS, CONE)])
    scene.force((0.0, 0.0, 0.01), TICK)
    x, y, z = 0.0, 0.0, -0.003
    for step in steps:
        x, y, z = x + step[0], y + step[1], min(0.01, max(-0.01, z + step[2]))
        force = scene.force((x, y, z), TICK)
        if scene.state.touched:
            ((_, normal),) = ball.linearise((x, y, z))
            pressing = dot(force, normal)
            assert pressing > 0.0
            assert norm(subtract(force, scale(normal, pressing))) <= CONE.static * pressing * (1.0 + 1e-6) + 1e-9


# Objects that move.


@pytest.mark.parametrize("name", sorted(SHAPES))
def test_only_the_motion_relative_to_the_surface_counts(name: str) -> None:
    """The same relative path against the same object at rest gives the same forces."""
    still = Scene([SceneObject(SHAPES[name], STIFFNESS, CONE, 2.0)])
    scene = Scene([SceneObject(SHAPES[name], STIFFNESS, CONE, 2.0, TWISTED)])
    pressed = 0
    for tick, position in enumerate(wander(1000, depth=-0.003)):
        force = scene.force(position, TICK)
        expected = still.force(subtract(position, TWISTED.at((tick + 1) * TICK)), TICK)
        assert force == pytest.approx(expected, abs=2e-4)
        pressed += force != ZERO
    assert pressed > 50


def test_a_time_of_no_use_moves_nothing() -> None:
    scene = Scene([SceneObject(GROUND, STIFFNESS, motion=RISING)])
    scene.force((0.0, 0.0, 0.05), 0.0)  # from above, in no time, so that nothing has moved yet
    for dt in (nan, inf, -1.0, 0.0, 1e12):
        assert scene.force((0.0, 0.0, -0.004), dt) == pytest.approx((0.0, 0.0, STIFFNESS * 0.004))
    assert scene.state.time == 0.0
    with pytest.raises(ValueError, match="without motion"):
        SimulatedRobot(SimulatedOptions(), scene, TICK)


STEP = 1e-5


@pytest.mark.parametrize("wave", ["sine", "triangle"])
@given(time=st.floats(0.0, 100.0), phase=st.floats(-360.0, 360.0))
def test_it_stays_within_its_amplitude_and_its_speed(wave: Any, time: float, phase: float) -> None:
    sway = Sway(direction=(0.6, 0.0, 0.8), amplitude_m=0.02, frequency_hz=1.5, phase_deg=phase, wave=wave)
    assert norm(sway.at(time)) <= 0.02 * (1.0 + 1e-9)
    assert distance(sway.at(time), sway.at(time + STEP)) <= sway.speed * STEP * (1.0 + 1e-6)
    assert sway.at(time + 1.0 / 1.5) == pytest.approx(sway.at(time), abs=1e-9)
    later = sway.model_copy(update={"phase_deg": 0.0}).at(time + phase / 360.0 / 1.5)
    assert sway.at(time) == pytest.approx(later, abs=1e-9)
