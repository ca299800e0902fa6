"""Contact far stiffer than a step resolves: bounded, and never more energy than was put in."""

from math import sqrt

import pytest

from tests.slave.integrators.problems import energy, moving, wall
from tests.slave.scenes.solids import SHAPES
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.slave.integrators import INTEGRATORS, ControlledMass
from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.scene import Scene


@pytest.mark.parametrize("damping", [None, 100.0])
def test_the_implicit_scheme_is_l_stable(damping: float | None) -> None:
    """One step into contact a million times too stiff for it, and nothing is left of the motion along the normal."""
    scene = wall(1e7, damping)
    integrator = INTEGRATORS["implicit"].build(ControlledMass(1e-3, 1.0, 0.0), scene)
    motion = moving(scene, (0.0, 0.0, -1e-5), (0.1, 0.0, -0.01))
    left = []
    for _ in range(6):
        motion = integrator.advance(motion, (0.0, 0.0, -0.001), 0.1)
        left.append(abs(motion.velocity[2]))
    assert left[-1] < 1e-7
    assert left[-1] < 1e-4 * 0.01


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


@pytest.mark.parametrize(
    ("shape", "stiffness", "mass", "tick", "position", "velocity"),
    [
        ("sphere", 3.2e6, 3.1e-3, 3.8e-3, (0.00586, -0.00034, 0.02415), (1.558, -0.0913, -5.546)),
        ("turned box", 9.9e6, 4.7e-3, 9.3e-3, (0.01191, 0.00786, 0.00596), (1.287, 0.849, -4.219)),
        ("box cavity", 7.5e6, 1.4, 7.8e-3, (0.0, 0.0, 0.01), (1.0, 1.0, -1.0)),
        ("pocket", 2e6, 4e-3, 1e-3, (0.0, 0.0, -0.004), (3.0, 2.0, -1.0)),
    ],
)
def test_failed_newton_iteration_still_loses_energy(
    shape: str, stiffness: float, mass: float, tick: float, position: Vector, velocity: Vector
) -> None:
    """Metres per second against a rough, stiff, curved surface, a centimetre per step."""
    body, goal = ControlledMass(mass, 1000.0, 2.0 * sqrt(1000.0 * mass)), (0.0, 0.0, -0.015)
    scene = Scene([SceneObject(SHAPES[shape], stiffness, FrictionCone(0.5, 0.4), 60.0)])
    integrator = INTEGRATORS["implicit"].build(body, scene)
    motion = moving(scene, position, velocity)
    first = energy(body, motion, goal, scene, stiffness)
    for _ in range(100):
        motion = integrator.advance(motion, goal, tick)
        assert energy(body, motion, goal, scene, stiffness) <= first * 1.001
    assert norm(motion.velocity) < 0.1 * norm(velocity)
