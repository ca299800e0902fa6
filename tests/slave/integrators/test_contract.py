"""The contract of every integrator: what it does in any scene, its order, and where it is stable."""

from collections.abc import Callable
from functools import cache
from math import sqrt
from typing import Any

import numpy as np
import pytest

from tests.slave.integrators.problems import BODY, UP, ball, corner, difference, moving, run, wall
from tests.slave.scenes.solids import scenes
from weberlink.geometry.vector import ZERO
from weberlink.slave.integrators import INTEGRATORS, ControlledMass, MassState
from weberlink.slave.integrators.problem import contact_force
from weberlink.slave.scenes.contact import FrictionCone
from weberlink.slave.scenes.scene import Scene

TICK = 0.001
CONE = FrictionCone(static=0.5, dynamic=0.4)
every_integrator = pytest.mark.parametrize("name", sorted(INTEGRATORS))
SCENES: dict[str, Callable[[], Scene]] = {
    "wall": lambda: wall(2000.0),
    "damped wall": lambda: wall(2000.0, 5.0),
    "rough wall": lambda: wall(2000.0, 5.0, CONE),
    "ball": lambda: ball(2000.0),
    "rough ball": lambda: ball(2000.0, 5.0, CONE),
    "corner": lambda: corner((UP, 2000.0, None), ((1.0, 0.0, 1.0), 1000.0, 3.0)),
    "box cavity": lambda: scenes()["box cavity"],
    "everything": lambda: scenes()["everything"],
}
every_scene = pytest.mark.parametrize("place", sorted(SCENES))


@every_scene
@every_integrator
def test_force_and_scene_match_returned_position(name: str, place: str) -> None:
    scene = SCENES[place]()
    integrator = INTEGRATORS[name].build(BODY, scene)
    motion = moving(scene, (0.0, 0.0, 0.004), (0.0, 0.0, -0.1))
    touched = 0
    for tick in range(300):
        motion = integrator.advance(motion, (0.00002 * tick, 0.0, -0.02), TICK / 2.0)
        state = scene.state
        touches = scene.touch(motion.position)
        # Asked again, a proxy between many curved shapes comes a little closer still.
        assert motion.force == pytest.approx(contact_force(touches, motion.velocity), rel=1e-3, abs=1e-4)
        assert scene.proxy == pytest.approx(state.proxy, abs=1e-6)
        scene.restore(state)
        touched += bool(touches)
    assert touched > 50


@every_integrator
def test_rests_where_control_and_contact_balance(name: str) -> None:
    end = run(name, BODY, lambda: wall(2000.0, 5.0), (0.0, 0.0, 0.01), ZERO, (0.01, 0.0, -0.01), 2.0, 4000)
    assert end.position == pytest.approx((0.01, 0.0, -0.002), abs=1e-9)
    assert end.velocity == pytest.approx(ZERO, abs=1e-9)
    assert end.force == pytest.approx((0.0, 0.0, 4.0), abs=1e-6)


@every_integrator
def test_mass_sticks_within_the_static_cone(name: str) -> None:
    """Drawn sideways by 1.2 N while pressed by 4 N: the springs of control and surface share the way."""
    body = ControlledMass(0.1, 2000.0, 2.0 * sqrt(200.0))
    scene = wall(2000.0, 5.0, CONE)
    integrator = INTEGRATORS[name].build(body, scene)
    motion = moving(scene, (0.0, 0.0, 0.001), ZERO)
    for tick in range(3000):
        motion = integrator.advance(motion, (min(0.0012, 0.000001 * tick), 0.0, -0.004), TICK / 2.0)
    assert motion.force == pytest.approx((-1.2, 0.0, 4.0), rel=1e-3)
    assert motion.position == pytest.approx((0.0006, 0.0, -0.002), rel=1e-3)


STEPS = (40, 80, 160, 320)
FINEST = 3000


SMOOTH: dict[str, tuple[Any, ...]] = {  # scene, position, velocity, goal, duration
    "free": (lambda: None, (0.0, 0.0, 0.03), (0.1, 0.2, 0.3), (0.01, 0.0, 0.02), 0.05),
    "in a wall": (lambda: wall(2000.0, 5.0), (0.0, 0.0, -0.004), (0.1, 0.0, -0.05), (0.01, 0.0, -0.02), 0.02),
    "in a ball": (lambda: ball(2000.0, 5.0), (0.001, 0.0, -0.004), (0.2, 0.1, 0.0), (0.02, 0.01, -0.02), 0.02),
    "in a corner": (
        lambda: corner((UP, 3000.0, 2.0), ((1.0, 0.3, 0.6), 800.0, None)),
        (-0.004, 0.0, -0.006), (-0.05, 0.1, -0.05), (-0.01, 0.01, -0.02), 0.01,
    ),
}  # fmt: skip


@cache
def arrived(problem: str, name: str, steps: int) -> MassState:
    return run(name, BODY, *SMOOTH[problem], steps)


@pytest.mark.parametrize("problem", SMOOTH)
@every_integrator
def test_order_on_smooth_motion_is_as_tabulated(name: str, problem: str) -> None:
    scheme, truth = INTEGRATORS[name], arrived(problem, "exact", FINEST)
    if scheme.exact_if_linear and "ball" not in problem:
        assert difference(arrived(problem, name, STEPS[0]), truth, 0.01) < 1e-13
        return
    errors = [difference(arrived(problem, name, steps), truth, 0.01) for steps in STEPS]
    slope = -float(np.polyfit(np.log(STEPS), np.log(errors), 1)[0])
    assert slope == pytest.approx(scheme.order, abs=0.2)


@pytest.mark.parametrize("damping", [0.0, 30.0])
@pytest.mark.parametrize(("factor", "stable"), [(0.999, True), (1.001, False)])
def test_symplectic_euler_is_stable_just_where_it_says(damping: float, factor: float, stable: bool) -> None:
    """2 a + b < 4, to a tenth of a percent."""
    mass, stiffness = 0.05, 1e4
    limit = (-damping + sqrt(damping**2 + 4.0 * mass * stiffness)) / stiffness  # of 2 c h / m + k h^2 / m = 4
    integrator = INTEGRATORS["semi_implicit"].build(ControlledMass(mass, stiffness, damping), None)
    motion, farthest = moving(None, (0.0, 0.0, -1.0), ZERO), 0.0
    for _ in range(4000):
        motion = integrator.advance(motion, ZERO, factor * limit)
        farthest = max(farthest, abs(motion.position[2]))
    assert (farthest < 100.0) == stable
