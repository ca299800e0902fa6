"""A patch of a surface: stiffness, curvature, friction and motion, and their rounding on the wire."""

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given, strategies as st

from plugins.predictors.tests.signals import GodObject
from tests.examples import examples
from weberlink.codec import Channel, Decoder, Update, force_channel
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, add, distance, dot, norm, scale, subtract, unit
from weberlink_predictors.surface import SURFACE, SurfacePatch

UP: Vector = (0.0, 0.0, 1.0)
S = 500.0
MU = 0.3
coordinates = st.floats(-0.01, 0.01)
vectors = st.tuples(coordinates, coordinates, coordinates)
normals = vectors.filter(lambda v: norm(v) > 1e-3).map(unit)
curvatures = st.sampled_from([0.0, 20.0, -20.0, 5.0, -50.0])
paths = st.lists(st.tuples(coordinates, coordinates, st.floats(-0.006, 0.001)), min_size=2, max_size=30)

FLAT = SurfacePatch(UP, ZERO, 0, S, friction=MU)


@given(normal=normals, point=vectors, probe=vectors, stiffness=st.floats(1.0, 1e5))
def test_a_flat_patch_at_rest_is_a_wall(normal: Vector, point: Vector, probe: Vector, stiffness: float) -> None:
    depth = max(0.0, -dot(normal, subtract(probe, point)))
    expected = scale(normal, stiffness * depth)
    assert distance(SurfacePatch(normal, point, 0, stiffness).at(7, probe), expected) <= 1e-12 * stiffness


@given(normal=normals, point=vectors, probe=vectors, curvature=st.floats(1.0, 80.0))
def test_a_curved_patch_is_a_ball_or_a_cavity(normal: Vector, point: Vector, probe: Vector, curvature: float) -> None:
    radius = 1.0 / curvature
    for sign in (1.0, -1.0):
        centre = subtract(point, scale(normal, sign * radius))
        away = subtract(probe, centre)
        depth = max(0.0, sign * (radius - norm(away)))
        expected = scale(unit(away), sign * S * depth)
        assert distance(SurfacePatch(normal, point, 0, S, sign * curvature).at(0, probe), expected) <= 1e-9


def test_at_the_centre_of_curvature_there_is_no_force() -> None:
    assert SurfacePatch(UP, (0.0, 0.0, 0.05), 0, S, 20.0).at(0, ZERO) == ZERO
    assert SurfacePatch(UP, (0.0, 0.0, 0.05), 0, S, 20.0, MU).advance(0, ZERO, ZERO) == (ZERO, ZERO)


# Friction.


def test_it_sticks_inside_the_cone_and_slides_on_it() -> None:
    depth = 2e-3
    cone = MU * depth
    # A spring of the same stiffness in all directions, about the god-object.
    force, held = FLAT.advance(1, (4e-4, -3e-4, -depth), ZERO)
    assert force == pytest.approx(scale((-4e-4, 3e-4, depth), S))
    assert held == pytest.approx(ZERO, abs=1e-15)
    force, held = FLAT.advance(2, (3e-3, 4e-3, -depth), ZERO)
    assert force == pytest.approx((-0.6 * MU, -0.8 * MU, 1.0))
    assert held == pytest.approx((3e-3 - 0.6 * cone, 4e-3 - 0.8 * cone, 0.0))
    # Back by half the length of the spring: half the pull, and the god-object stays.
    force, same = FLAT.advance(3, (3e-3 - 0.3 * cone, 4e-3 - 0.4 * cone, -depth), held)
    assert force == pytest.approx((-0.3 * MU, -0.4 * MU, 1.0))
    assert same == pytest.approx(held, abs=1e-15)
    # Back by more than twice its length: it slides the other way.
    force, held = FLAT.advance(4, (3e-3 - 1.8 * cone, 4e-3 - 2.4 * cone, -depth), held)
    assert force == pytest.approx((0.6 * MU, 0.8 * MU, 1.0))
    # With less pressure it slips; off the surface there is no force.
    force, held = FLAT.advance(5, (5e-4, 0.0, -1e-3), ZERO)
    assert force == pytest.approx((-MU * 0.5, 0.0, 0.5))
    assert held == pytest.approx((5e-4 - MU * 1e-3, 0.0, 0.0))
    free = (0.01, 0.0, 1e-4)
    assert FLAT.advance(6, free, held) == (ZERO, free)
    assert (SurfacePatch(UP, free, 0, S).memory, SurfacePatch(UP, free, 0, S, friction=0.1).memory) == (None, free)


@given(path=paths, normal=normals, curvature=curvatures, friction=st.floats(0.01, 1.5))
@examples(40)
def test_it_pulls_as_a_god_object_does(path: list[Vector], normal: Vector, curvature: float, friction: float) -> None:
    """Compared with an independent implementation, with matrices in a frame whose z is the normal."""
    z = np.array(normal)
    x = np.cross(z, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.6 else [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    frame = np.stack([x, np.cross(z, x), z], axis=1)
    god, surface = GodObject(S, curvature, friction), SurfacePatch(normal, ZERO, 0, S, curvature, friction)
    god.proxy, held = np.zeros(3), ZERO
    for tick, probe in enumerate(path):
        a, b, c = (float(each) for each in frame @ probe)
        expected = frame @ god.force(np.array(probe))
        force, held = surface.advance(tick, (a, b, c), held)
        assert np.linalg.norm(expected - force) <= 1e-9


# Damping.


def test_damping_adds_to_the_push_and_never_pulls() -> None:
    damped = SurfacePatch(UP, ZERO, 0, S, damping=1e3, rate=2e-4)
    # In the first tick the rate of the sample; then that of the last two positions, over no less than a tick.
    steps = [
        (1.0, -1e-3, 0.5 + 0.2),
        (2.0, -1.1e-3, 0.55 + 0.1),
        (4.0, -1.5e-3, 0.75 + 0.2),
        (4.5, -1.6e-3, 0.8 + 0.1),
        (5.5, -1.4e-3, 0.7 - 0.2),
        (6.5, -0.9e-3, 0.0),  # 0.45 - 0.5
        (7.5, 1e-4, 0.0),
        (8.5, -2e-4, 0.1 + 0.2),
    ]
    memory = damped.memory
    for tick, height, push in steps:
        force, memory = damped.advance(tick, (1e-3, 2e-3, height), memory)
        assert force == pytest.approx((0.0, 0.0, push), abs=1e-12)
    assert damped.at(1, (0.0, 0.0, -1e-3)) == pytest.approx((0.0, 0.0, 0.5))


@given(path=paths, normal=normals)
def test_damping_leaves_friction_as_it_is(path: list[Vector], normal: Vector) -> None:
    rubbing = SurfacePatch(normal, ZERO, 0, S, friction=MU)
    damped = SurfacePatch(normal, ZERO, 0, S, friction=MU, damping=1e3, rate=1e-4)
    held, memory = rubbing.memory, damped.memory
    for tick, probe in enumerate(path):
        force, held = rubbing.advance(tick, probe, held)
        more, memory = damped.advance(tick, probe, memory)
        assert memory[0] == held
        beside = subtract(more, force)
        assert distance(beside, scale(normal, dot(normal, beside))) <= 1e-9
        assert dot(normal, more) >= -1e-12


# Motion.


@pytest.mark.parametrize("ahead", [0, 1, 37, 400, 1000.5])
def test_an_oscillation_is_a_sine(ahead: float) -> None:
    """z(t) = A sin(w t + phi) - A sin(phi) at 1 Hz."""
    frequency, amplitude, phase = 2.0 * pi * 1e-3, 0.016, 0.7
    surface = SurfacePatch(
        UP,
        ZERO,
        50,
        S,
        velocity=amplitude * frequency * cos(phase),
        acceleration=-amplitude * frequency * frequency * sin(phase),
        frequency=frequency,
    )
    height = amplitude * (sin(frequency * ahead + phase) - sin(phase))
    probe = (0.0, 0.0, height - 2e-3)
    assert surface.at(50 + ahead, probe) == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)
    assert surface.at(50 + ahead, (0.0, 0.0, height + 1e-7)) == ZERO


@given(ahead=st.floats(-300, 300), velocity=st.floats(-1e-4, 1e-4), acceleration=st.floats(-1e-6, 1e-6))
def test_without_a_frequency_the_motion_is_a_parabola(ahead: float, velocity: float, acceleration: float) -> None:
    height = velocity * ahead + 0.5 * acceleration * ahead * ahead
    probe = (0.0, 0.0, height - 2e-3)
    for frequency, allowed in ((0.0, 1e-9), (1e-5, 1e-3)):
        surface = SurfacePatch(UP, ZERO, 0, S, velocity=velocity, acceleration=acceleration, frequency=frequency)
        assert surface.at(ahead, probe)[2] == pytest.approx(1.0, abs=allowed)


# Over the wire.


def sent(model: SurfacePatch, force: Vector, position: Vector, channel: Channel) -> tuple[Decoder, Sample]:
    (levels, newest), decoder = channel.grid.quantize(model.tick, force, position), Decoder(channel)
    decoder.apply(Update(model.tick, 0, levels, SURFACE.packed(model, newest, channel.grid)))
    return decoder, newest


@given(
    normal=normals, stiffness=st.floats(2.0, 1e5), curvature=st.floats(0.5, 80.0), sign=st.sampled_from([1.0, -1.0]),
    friction=st.floats(0.02, 1.5), frequency=st.floats(1e-4, 6e-2), damping=st.sampled_from([0.0, 3.0, 300.0, 1e5]),
)  # fmt: skip
def test_its_numbers_survive_within_their_grids(
    normal: Vector, stiffness: float, curvature: float, sign: float, friction: float, frequency: float, damping: float
) -> None:
    moves = (0.0, 0.0, frequency, damping, -2e-4) if damping else (3e-5, -4e-7, frequency)  # one or the other
    model = SurfacePatch(normal, ZERO, 9, stiffness, sign * curvature, friction, *moves)
    decoder, newest = sent(model, scale(normal, 2.0), ZERO, force_channel(predictor="surface"))
    said = decoder.model
    assert isinstance(said, SurfacePatch)
    assert said.tick == 9
    assert norm(said.normal) == pytest.approx(1.0)
    assert distance(said.normal, normal) <= 2.0**-9
    assert said.stiffness == pytest.approx(stiffness, rel=2.0**-8)
    assert said.curvature == pytest.approx(sign * curvature, rel=2.0**-7)
    assert said.friction == pytest.approx(friction, abs=2.0**-8)
    assert said.velocity == pytest.approx(model.velocity, rel=2.0**-7)
    assert said.acceleration == pytest.approx(model.acceleration, rel=2.0**-6)
    assert said.frequency == pytest.approx(frequency, abs=2.0**-17)
    assert said.damping == pytest.approx(damping, rel=2.0**-8)
    assert said.rate == pytest.approx(model.rate, rel=2.0**-7)
    # The god-object is at p + f / s: along the force without that of the damping, not along the normal.
    sprung = subtract(newest.value, scale(said.normal, said.damping * said.rate))
    assert said.point == pytest.approx(add(newest.position, scale(sprung, 1.0 / said.stiffness)))


@given(force=st.tuples(*[st.floats(0.3, 5.0)] * 3), position=vectors, curvature=curvatures)
def test_with_friction_it_passes_through_its_own_sample(force: Vector, position: Vector, curvature: float) -> None:
    """With any rounding of the normal: the god-object is at p + f / s, along the force itself."""
    model = SurfacePatch(unit((1.0, 1.0, 1.0)), ZERO, 3, 2000.0, curvature, 1.5)
    decoder, newest = sent(model, force, position, force_channel(predictor="surface"))
    said = decoder.model
    assert isinstance(said, SurfacePatch)
    inside = norm(subtract(newest.value, scale(said.normal, dot(said.normal, newest.value))))
    if curvature == 0.0 and inside < 1.49 * dot(said.normal, newest.value):
        shown = said.advance(4, newest.position, said.point)[0]
        assert distance(shown, newest.value) <= 1e-9
    # A curved one is straight within the depth, which is small beside the radius.
    elif inside < 0.5 * dot(said.normal, newest.value):
        shown = said.advance(4, newest.position, said.point)[0]
        assert distance(shown, newest.value) <= 0.1 * norm(newest.value)
