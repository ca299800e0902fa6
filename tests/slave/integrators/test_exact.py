"""`exact` on flat contact against solutions that share nothing with it, at any step."""

from collections.abc import Callable
from math import log10, pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from tests.examples import examples
from tests.slave.integrators.problems import OFF, UP, corner, difference, moving, run, wall
from weberlink.geometry.vector import ZERO, Vector, dot, norm, unit
from weberlink.slave.integrators import INTEGRATORS, ControlledMass, MassState
from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.plane import PlaneShape
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.sphere import SphereShape

STEEL = 1e7
OBLIQUE = ((UP, 3000.0, None), (unit((1.0, 0.3, 0.6)), 800.0, 4.0), (unit((-0.4, 1.0, 0.5)), 1500.0, None))
RIGHT = ((UP, 3000.0, 2.0), ((1.0, 0.0, 0.0), 800.0, None))


def tenfold(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(log10(low), log10(high)).map(lambda exponent: 10.0**exponent)


Event = Callable[[float, np.ndarray], float]


class HeightOverWall:
    """The motion along the normal of a wall at 0, in pieces between events that scipy locates."""

    def __init__(self, body: ControlledMass, stiffness: float, damping: float, goal: float) -> None:
        self.body, self.stiffness, self.damping, self.goal = body, stiffness, damping, goal

    def after(self, height: float, speed: float, duration: float) -> np.ndarray:
        """Height and speed; starts above the wall."""
        y, now, mode = np.array([height, speed]), 0.0, "free"
        fastest = sqrt((self.body.stiffness + self.stiffness) / self.body.mass)
        for _ in range(2000):
            ends = self.ends(mode)
            piece = solve_ivp(
                self.derivative(mode),
                (now, duration),
                y,
                "DOP853",
                rtol=3e-14,
                atol=1e-18,
                events=[event for event, _ in ends],
                max_step=0.5 / fastest,
            )
            y, now = piece.y[:, -1].copy(), float(piece.t[-1])
            if piece.status == 0:
                return y
            mode = next(following for (_, following), at in zip(ends, piece.t_events, strict=True) if at.size)
            if mode == "free" or (mode == "press" and abs(y[0]) < 1e-15):
                y[0] = 0.0
        raise AssertionError("too many events")

    def derivative(self, mode: str) -> Callable[[float, np.ndarray], list[float]]:
        mass, control, brake = self.body

        def rates(_: float, y: np.ndarray) -> list[float]:
            force = self.push(y) if mode == "press" else 0.0
            return [y[1], (control * (self.goal - y[0]) - brake * y[1] + force) / mass]

        return rates

    def push(self, y: np.ndarray) -> float:
        return float(-self.stiffness * y[0] - self.damping * y[1])

    def ends(self, mode: str) -> list[tuple[Event, str]]:
        """What ends a piece, and what follows: a touch, a force that would pull, a way out, a force again."""
        if mode == "free":
            return [(terminal(lambda _, y: float(y[0]), -1.0), "press")]
        if mode == "press":
            return [(terminal(lambda _, y: self.push(y), -1.0), "slack" if self.damping else "free")]
        return [
            (terminal(lambda _, y: float(y[0]), 1.0), "free"),
            (terminal(lambda _, y: self.push(y), 1.0), "press"),
        ]


def terminal(event: Event, direction: float) -> Event:
    event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
    return event


@pytest.mark.parametrize("step", [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1])
@pytest.mark.parametrize("damping", [0.0, 3.0, 60.0])
@pytest.mark.parametrize(("mass", "stiffness"), [(0.1, 500.0), (0.1, 1e5), (1.0, 2e6)])
def test_it_is_the_solution_that_scipy_finds(mass: float, stiffness: float, damping: float, step: float) -> None:
    body = ControlledMass(mass, 800.0, 3.0)
    z, v, goal = 1e-4 if step < 1e-2 else 0.003, -0.4, -0.001
    truth = HeightOverWall(body, stiffness, damping, goal).after(z, v, step)
    end = run(
        "exact", body, lambda: wall(stiffness, damping or None), (0.0, 0.0, z), (0.0, 0.0, v), (0.0, 0.0, goal), step, 1
    )
    assert end.position[2] == pytest.approx(truth[0], abs=1e-9 * (abs(v) / sqrt((800.0 + stiffness) / mass) + 1e-3))
    assert end.velocity[2] == pytest.approx(truth[1], abs=1e-9 * abs(v) * max(1.0, 1e-3 * stiffness / 800.0))


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
@pytest.mark.parametrize("duration", [1e-3, 1e-2, 1e-1])
def test_several_contacts_at_once_against_a_brute_force_solution(
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
def test_an_undamped_oscillation_through_the_surface_keeps_its_energy(step: float) -> None:
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


@pytest.mark.parametrize("miss", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_contact_that_only_grazes_within_a_step_is_found(miss: float) -> None:
    """Half a swing of the control dips to `miss` below the surface and is out again before the step ends."""
    body = ControlledMass(1.0, 100.0, 0.0)  # omega 10 rad/s: down and up again in 0.628 s
    start, goal = (0.0, 0.0, 0.02), (0.0, 0.0, 0.01 - miss / 2.0)
    free = run("exact", body, lambda: None, start, ZERO, goal, 0.6, 1)
    touched = run("exact", body, lambda: wall(1e5), start, ZERO, goal, 0.6, 1)
    often = run("exact", body, lambda: wall(1e5), start, ZERO, goal, 0.6, 3001)
    assert touched.position[2] > 0.0
    assert difference(touched, often, 0.1) < 1e-11
    if miss > 1e-9:
        assert difference(touched, free, 0.1) > 1e-3 * miss


def test_with_damping_the_force_ends_before_the_depth_does_and_never_pulls() -> None:
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


def test_steel_is_no_trouble_for_a_gram() -> None:
    """Pressed by its control at a tick of 1 ms, 100 rad of contact oscillation."""
    body, scene = ControlledMass(1e-3, 5e4, 2.0 * sqrt(50.0)), wall(STEEL)
    integrator = INTEGRATORS["exact"].build(body, scene)
    motion = moving(scene, (0.0, 0.0, 0.01), ZERO)
    for tick in range(1, 300):
        motion = integrator.advance(motion, (0.0, 0.0, max(-0.001, 0.01 - 0.0001 * tick)), 1e-3)
        assert motion.position[2] > -2e-5
    assert motion.force[2] == pytest.approx(5e4 * 0.001 * STEEL / (STEEL + 5e4), rel=1e-9)


def test_a_slot_narrower_than_nothing_ends_all_the_same() -> None:
    """Two planes face each other and overlap: no push satisfies both, yet the motion is bounded."""
    scene = corner((UP, 1e6, None), ((0.0, 0.0, -1.0), 1e6, None), ((0.0, 0.0, 1.0), 500.0, 3.0))
    integrator = INTEGRATORS["exact"].build(ControlledMass(0.1, 1000.0, 1.0), scene)
    motion = MassState((0.001, 0.0, 0.002), (0.1, 0.0, -0.3), ZERO)
    for _ in range(300):
        motion = integrator.advance(motion, (0.0, 0.0, -0.003), 1e-3)
        assert norm(motion.position) < 0.02


def test_it_is_the_tangent_elsewhere_and_says_how_good_that_is() -> None:
    """A stiff ball with friction, stuck: the error against fine steps is far below that of ignoring the curvature."""

    def rough() -> Scene:
        return Scene([SceneObject(SphereShape((0.0, 0.0, -0.03), 0.03), 1e5, FrictionCone(0.5, 0.4))])

    body, start, goal = ControlledMass(0.1, 2000.0, 28.0), (0.0, 0.0, 0.0005), (0.002, 0.0, -0.003)
    truth = run("exact", body, rough, start, (0.1, 0.0, -0.1), goal, 0.1, 5000)
    coarse = run("exact", body, rough, start, (0.1, 0.0, -0.1), goal, 0.1, 100)
    assert difference(coarse, truth, 0.001) < 2e-5
