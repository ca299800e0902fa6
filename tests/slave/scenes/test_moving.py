"""Objects that move: the scene in the frame of each, and what that does to a probe."""

from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.slave.scenes.solids import GROUND, SHAPES, UP, wander
from weberlink.geometry.vector import ZERO, Vector, distance, is_finite, norm, subtract
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.slave.scenes.contact import FrictionCone, SceneObject, Sway
from weberlink.slave.scenes.scene import Scene

TICK = 0.001
STIFFNESS = 500.0
CONE = FrictionCone(static=0.5, dynamic=0.4)
RISING = Sway(direction=UP, amplitude_m=0.016, frequency_hz=1.0)
TWISTED = Sway(direction=(0.48, 0.6, 0.64), amplitude_m=0.002, frequency_hz=1.9, phase_deg=36.0)
FAR = Sway(direction=(1.0, 0.0, 0.0), amplitude_m=10.0, frequency_hz=0.1, phase_deg=108.0, wave="triangle")


def moving() -> Scene:
    """The ground alone."""
    return Scene([SceneObject(GROUND, STIFFNESS, motion=RISING)])


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


@given(
    steps=st.lists(
        st.tuples(
            st.tuples(*[st.floats(-0.05, 0.05) | st.sampled_from([nan, inf, -inf, 1e300, 1e11])] * 3),
            st.floats(0.0, 0.02) | st.sampled_from([nan, inf, -inf, -1.0, 1e11, 1e300]),
        ),
        max_size=30,
    )
)
def test_whatever_comes_the_force_is_finite(steps: list[tuple[Vector, float]]) -> None:
    moving = ((GROUND, RISING), (SHAPES["sphere"], TWISTED), (SHAPES["box"], FAR))
    scene = Scene([SceneObject(shape, STIFFNESS, CONE, 2.0, motion) for shape, motion in moving])
    for position, dt in steps:
        assert is_finite(scene.force(position, dt))
        assert scene.proxy is None or is_finite(scene.proxy)


def test_a_time_of_no_use_moves_nothing() -> None:
    scene = moving()
    scene.force((0.0, 0.0, 0.05), 0.0)  # from above, in no time, so that nothing has moved yet
    for dt in (nan, inf, -1.0, 0.0, 1e12):
        assert scene.force((0.0, 0.0, -0.004), dt) == pytest.approx((0.0, 0.0, STIFFNESS * 0.004))
    assert scene.state.time == 0.0


def test_a_robot_with_mass_refuses_moving_objects() -> None:
    assert moving().moves
    with pytest.raises(ValueError, match="without motion"):
        SimulatedRobot(SimulatedOptions(), moving(), TICK)


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
