"""`exact` against solutions that share nothing with it, at any step: flat contact, and one rough plane."""

from collections.abc import Callable
from math import asin, atan2, cos, log10, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from tests.examples import examples
from tests.slave.integrators.problems import OFF, UP, corner, difference, moving, run, wall
from weberlink.geometry.vector import ZERO, Vector, dot, norm, scale, subtract, unit
from weberlink.slave.integrators import INTEGRATORS, ControlledMass
from weberlink.slave.integrators.linear_contact import Faces
from weberlink.slave.integrators.stick_slip import trailing
from weberlink.slave.scenes.active_set import smallest_push
from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import PlaneShape

STEEL = 1e7
OBLIQUE = ((UP, 3000.0, None), (unit((1.0, 0.3, 0.6)), 800.0, 4.0), (unit((-0.4, 1.0, 0.5)), 1500.0, None))
RIGHT = ((UP, 3000.0, 2.0), ((1.0, 0.0, 0.0), 800.0, None))


def tenfold(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(log10(low), log10(high)).map(lambda exponent: 10.0**exponent)


Event = Callable[[float, np.ndarray], float]


@examples(40)
@given(
    mass=tenfold(1e-3, 10.0),
    stiffness=tenfold(10.0, STEEL),
    damping=st.one_of(st.none(), tenfold(0.1, 1000.0)),
    control=st.one_of(st.just(0.0), tenfold(10.0, 1e5)),
    ratio=st.sampled_from([0.0, 0.05, 1.0, 5.0]),
    step=tenfold(1e-6, 0.1),
    height=st.floats(-1e-4, 1e-3),
    velocity=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
)
def test_one_step_goes_as_far_as_two_hundred(
    mass: float,
    stiffness: float,
    damping: float | None,
    control: float,
    ratio: float,
    step: float,
    height: float,
    velocity: Vector,
) -> None:
    body = ControlledMass(mass, control, 2.0 * ratio * sqrt(control * mass))
    start, goal = (0.0, 0.0, height), (0.01, 0.0, -0.002)
    once = run("exact", body, lambda: wall(stiffness, damping), start, velocity, goal, step, 1)
    often = run("exact", body, lambda: wall(stiffness, damping), start, velocity, goal, step, 200)
    omega = sqrt((stiffness + control) / mass)
    size = norm(velocity) / omega + abs(height) + 1e-4
    # Each swing of the contact may double the rounding of where it began.
    assert difference(once, often, 0.0) < 1e-9 * max(size, norm(velocity) * step)
    assert difference(once, often, 1.0 / omega) < 1e-9 * (size + norm(velocity) * step + 0.01)


@pytest.mark.parametrize("planes", [OBLIQUE, RIGHT], ids=["oblique", "right angles"])
@pytest.mark.parametrize("duration", [1e-3, 7e-2])
def test_several_contacts_match_brute_force_solution(
    planes: tuple[tuple[Vector, float, float | None], ...], duration: float
) -> None:
    """Smallest push over all subsets of planes, by numpy, and DOP853 that sees kinks as they come."""
    body = ControlledMass(0.1, 400.0, 3.0)
    normals = np.array([normal for normal, _, _ in planes])
    start, velocity, goal = (0.002, 0.003, 0.001), (-0.3, -0.2, -0.4), (-0.004, -0.003, -0.005)

    def derivative(_: float, y: np.ndarray) -> np.ndarray:
        force = brute_force(normals, planes, y[:3], y[3:])
        return np.concatenate([y[3:], (400.0 * (goal - y[:3]) - 3.0 * y[3:] + force) / 0.1])

    initial = np.array([*start, *velocity])
    piece = solve_ivp(derivative, (0.0, duration), initial, "DOP853", rtol=1e-12, atol=1e-15, max_step=2e-4)
    for steps in (1, 7):
        end = run("exact", body, lambda: corner(*planes), start, velocity, goal, duration, steps)
        assert end.position == pytest.approx(piece.y[:3, -1], abs=1e-10)
        assert end.velocity == pytest.approx(piece.y[3:, -1], abs=1e-8)
    assert duration < 1e-2 or sum(f != 0.0 for f in end.force) >= 2, "the motion must end where planes meet"


def brute_force(
    normals: np.ndarray, planes: tuple[tuple[Vector, float, float | None], ...], x: np.ndarray, v: np.ndarray
) -> np.ndarray:
    """The active planes are the subset that needs the smallest push; each gives max(0, k depth + b rate)."""
    best: tuple[float, np.ndarray] | None = None
    for code in range(2 ** len(planes)):
        active = [i for i in range(len(planes)) if code >> i & 1]
        some = normals[active]
        gram = some @ some.T
        depths = np.linalg.solve(gram, -some @ x) if active else np.zeros(0)
        push = some.T @ depths
        if (depths < 0.0).any() or (normals @ (x + push) < -1e-13).any():
            continue
        if best is None or push @ push < best[0]:
            rates = np.linalg.solve(gram, -some @ v) if active else depths
            forces = [
                max(0.0, planes[i][1] * d + (planes[i][2] or 0.0) * r)
                for i, d, r in zip(active, depths, rates, strict=True)
            ]
            best = (push @ push, some.T @ np.array(forces) if active else np.zeros(3))
    assert best is not None
    return best[1]


@examples(60)
@given(tenfold(10.0, STEEL), tenfold(1e-3, 10.0), st.floats(0.01, 2.0), st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_a_bounce_gives_back_all_of_the_speed(stiffness: float, mass: float, speed: float, normal: Vector) -> None:
    """Undamped, control off, within a single step: mirrored velocity, and pi / omega spent inside."""
    if dot(normal, normal) < 0.1:
        normal = UP
    n, body = unit(normal), ControlledMass(mass, 0.0, 0.0)
    scene = Scene([SceneObject(PlaneShape(ZERO, n), stiffness)])
    start, velocity = (0.001 * n[0], 0.001 * n[1], 0.001 * n[2]), (-speed * n[0], -speed * n[1], -speed * n[2])
    inside = pi / sqrt(stiffness / mass)
    end = INTEGRATORS["exact"].build(body, scene).advance(moving(scene, start, velocity), ZERO, 0.003 / speed + inside)
    assert end.velocity == pytest.approx((speed * n[0], speed * n[1], speed * n[2]), rel=1e-9, abs=1e-9 * speed)
    assert dot(end.position, n) == pytest.approx(0.002, rel=1e-9)
    assert end.force == ZERO


@pytest.mark.parametrize("step", [1e-4, 1e-3, 1e-2, 0.1])
def test_undamped_bouncing_keeps_its_energy(step: float) -> None:
    """1 g against 1e7 N/m with an undamped control: hundreds of bounces."""
    body, scene = ControlledMass(1e-3, 1000.0, 0.0), wall(STEEL)
    integrator = INTEGRATORS["exact"].build(body, scene)
    motion, goal = moving(scene, (0.0, 0.0, 0.0005), ZERO), (0.0, 0.0, -0.0005)
    before = 0.5 * 1000.0 * 0.001**2
    for _ in range(round(0.2 / step)):
        motion = integrator.advance(motion, goal, step)
        depth = max(0.0, -motion.position[2])
        energy = 0.5 * (1e-3 * motion.velocity[2] ** 2 + 1000.0 * (motion.position[2] + 0.0005) ** 2 + STEEL * depth**2)
        assert energy == pytest.approx(before, rel=1e-9)


def test_damped_contact_never_pulls() -> None:
    body, stiffness, damping = OFF, 1e4, 20.0
    scene = wall(stiffness, damping)
    integrator = INTEGRATORS["exact"].build(body, scene)
    motion = moving(scene, (0.0, 0.0, 1e-4), (0.0, 0.0, -0.5))
    slack = []
    for _ in range(4000):
        motion = integrator.advance(motion, ZERO, 1e-5)
        assert motion.force[2] >= 0.0
        if motion.position[2] < 0.0 and motion.velocity[2] > 0.0 and motion.force[2] == 0.0:
            slack.append(motion.velocity[2])
    assert len(slack) > 3
    assert slack == pytest.approx([slack[0]] * len(slack), rel=1e-12), "nothing acts on it any more"
    once = run("exact", body, lambda: wall(stiffness, damping), (0.0, 0.0, 1e-4), (0.0, 0.0, -0.5), ZERO, 0.04, 1)
    assert difference(once, motion, 0.01) < 1e-12


directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda n: dot(n, n) > 0.1).map(unit)
points = st.tuples(*[st.floats(-0.01, 0.01)] * 3)


@given(st.lists(directions, min_size=1, max_size=4), st.lists(st.floats(0.0, 0.005), min_size=4, max_size=4), points)
def test_the_depths_are_those_of_the_smallest_push(normals: list[Vector], offsets: list[float], x: Vector) -> None:
    faces = Faces(normals, offsets[: len(normals)])
    gaps = [dot(n, x) + offset for n, offset in zip(normals, offsets, strict=False)]
    pushes = {i: depth for i, depth in smallest_push([-gap for gap in gaps], normals) if depth > 0.0}
    assert faces.active(x) == set(pushes)
    face = faces.face(frozenset(pushes))
    assert face is not None
    for depth in face.depths:
        assert depth.of(x) == pytest.approx(pushes[depth.plane], rel=1e-6, abs=1e-12)


@given(st.lists(directions, min_size=2, max_size=4), points)
def test_depth_coordinates_are_independent(normals: list[Vector], x: Vector) -> None:
    """Moving the probe along one active normal changes that depth alone; the proxy, and so the gaps, stay."""
    active = frozenset(range(min(2, len(normals))))
    assume(abs(dot(normals[0], normals[1])) < 0.99)
    face = Faces(normals, [0.0] * len(normals)).face(active)
    assert face is not None
    for moved in active:
        for depth in face.depths:
            assert dot(depth.vector, normals[moved]) == pytest.approx(-1.0 if depth.plane == moved else 0.0, abs=1e-9)
        for gap in face.gaps:
            assert dot(gap.vector, normals[moved]) == pytest.approx(0.0, abs=1e-9)


BODY = ControlledMass(0.05, 2000.0, 4.0)


@examples(60)
@given(
    mass=tenfold(1e-3, 10.0),
    stiffness=tenfold(10.0, 1e6),
    ratio=st.sampled_from([0.05, 1.0, 5.0]),
    step=tenfold(1e-4, 0.03),
    cone=st.sampled_from([FrictionCone(0.5, 0.5), FrictionCone(0.8, 0.3), FrictionCone(0.1, 0.05)]),
    sideways=st.floats(-0.5, 0.5),
    aim=st.floats(-0.01, 0.01),
)
def test_along_a_line_one_step_goes_as_far_as_fifty(
    mass: float, stiffness: float, ratio: float, step: float, cone: FrictionCone, sideways: float, aim: float
) -> None:
    control = 2000.0
    body = ControlledMass(mass, control, 2.0 * ratio * sqrt(control * mass))
    start, velocity, goal = (0.0, 0.0, 1e-4), (0.6 * sideways, 0.8 * sideways, -0.2), (0.6 * aim, 0.8 * aim, -0.003)
    once = run("exact", body, lambda: wall(stiffness, None, cone), start, velocity, goal, step, 1)
    often = run("exact", body, lambda: wall(stiffness, None, cone), start, velocity, goal, step, 50)
    assert difference(once, often, 0.0) < 1e-8 * (norm(velocity) * step + 0.001)


def test_it_slides_as_under_a_constant_force_and_stops_for_good() -> None:
    """Pressed at a constant depth, thrown along the surface: half a swing about the goal displaced by the friction."""
    depth, stiffness, mass, static, mu, speed = 1e-3, 1e4, 0.1, 0.5, 0.4, 0.5
    body, scene = ControlledMass(mass, 50.0, 0.0), wall(stiffness, None, FrictionCone(static, mu))
    scene.touch((0.0, 0.0, 1e-3))
    start, goal = (0.0, 0.0, -depth), (0.0, 0.0, -depth * (1.0 + stiffness / body.stiffness))
    motion = moving(scene, start, (speed, 0.0, 0.0))
    integrator = INTEGRATORS["exact"].build(body, scene)
    # It slips where the spring has taken up the static friction, and from there swings about -mu k depth / k_control.
    stuck, sliding = sqrt((stiffness + body.stiffness) / mass), sqrt(body.stiffness / mass)
    slipped = static * depth
    rate = sqrt(speed * speed - (stuck * slipped) ** 2)
    rest = -mu * stiffness * depth / body.stiffness
    turn = atan2(rate, sliding * (slipped - rest)) / sliding
    farthest = rest + sqrt((slipped - rest) ** 2 + (rate / sliding) ** 2)
    began = asin(stuck * slipped / speed) / stuck
    motion = integrator.advance(motion, goal, began + turn)
    assert motion.position == pytest.approx((farthest, 0.0, -depth), abs=1e-12)
    assert motion.velocity == pytest.approx(ZERO, abs=1e-9)
    centre = (farthest - mu * depth) * stiffness / (stiffness + body.stiffness)
    for _ in range(100):  # it swings about its anchor and does not slide back
        motion = integrator.advance(motion, goal, 1e-3)
        assert 2.0 * centre - farthest - 1e-12 < motion.position[0] < farthest + 1e-12


def test_where_sliding_turns_the_order_is_two() -> None:
    def path(substeps: int) -> list[Vector]:
        scene = Scene([SceneObject(PlaneShape(ZERO, unit((0.2, -0.3, 1.0))), 5000.0, FrictionCone(0.5, 0.3))])
        integrator = INTEGRATORS["exact"].build(BODY, scene)
        motion, places = moving(scene, (0.0, 0.0, 4e-4), ZERO), []
        for tick in range(40):
            goal = (0.004 * sin(0.13 * tick), 0.004 * (1.0 - cos(0.13 * tick)), -0.002)
            for _ in range(substeps):
                motion = integrator.advance(motion, goal, 1e-3 / substeps)
            places.append(motion.position)
        return places

    truth = path(128)
    errors = [
        max(norm(subtract(a, b)) for a, b in zip(path(substeps), truth, strict=True)) for substeps in (4, 8, 16, 32)
    ]
    assert errors[0] < 1e-5
    assert errors[0] / errors[-1] > 30.0  # of 64


@given(st.floats(-pi, pi), st.floats(1e-6, 1.0), st.integers(1, 20))
def test_the_anchor_trails_the_same_in_one_piece_or_many(angle: float, way: float, pieces: int) -> None:
    mu, depth = 0.4, 0.01
    start, whole = (depth, 0.0, 0.0), (depth, way, 0.0)
    toward = once = (cos(angle), sin(angle))
    for piece in range(pieces):
        a, b = (depth, way * piece / pieces, 0.0), (depth, way * (piece + 1) / pieces, 0.0)
        toward = trailing(toward, a, b, mu)
    once = trailing(once, start, whole, mu)
    assert toward == pytest.approx(once, abs=1e-6)
    assert dot((*once, 0.0), scale((1.0, 0.0, 0.0), -1.0)) >= -cos(angle) - 1e-9
