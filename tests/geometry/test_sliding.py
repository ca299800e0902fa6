"""The normal of a contact with friction."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.sliding import LEAST_WAY, Sliding
from weberlink.geometry.vector import ZERO, Vector, subtract

STIFFNESS = 1000.0


def contact(friction: float, normal_force: float, way: float, side: float) -> tuple[Sliding, Vector]:
    """A probe that presses on z, and then slides on x as far as `way` [m]; returns it with the force [N]."""
    sliding, at, force = Sliding(), ZERO, ZERO
    for share in (0.5, 1.0):
        there = (0.0, 0.0, -share * normal_force / STIFFNESS)
        then = (0.0, 0.0, share * normal_force)
        sliding.move(subtract(there, at), subtract(then, force), STIFFNESS)
        at, force = there, then
    for step in range(1, 21):
        there = (side * way * step / 20.0, 0.0, at[2])
        then = (-side * friction * normal_force, 0.0, normal_force)
        sliding.move(subtract(there, at), subtract(then, force), STIFFNESS)
        at, force = there, then
    return sliding, force


@given(st.floats(0.0, 0.9), st.floats(0.1, 1.0), st.sampled_from([-1.0, 1.0]))
def test_the_normal_part_of_a_force_is_without_friction(friction: float, normal_force: float, side: float) -> None:
    sliding, force = contact(friction, normal_force, 0.01, side)
    assert sliding.normal_part(force) == pytest.approx((0.0, 0.0, normal_force), abs=1e-9)


@given(st.floats(0.0, 0.9), st.floats(0.1, 1.0))
def test_without_sliding_it_is_the_whole_force(friction: float, normal_force: float) -> None:
    sliding, force = contact(friction, normal_force, 0.0, 1.0)
    assert force == (-friction * normal_force, 0.0, normal_force)
    if friction * normal_force / STIFFNESS < LEAST_WAY:
        assert sliding.normal_part(force) == force


def test_pressing_with_an_unknown_stiffness_is_not_taken_for_sliding() -> None:
    sliding = Sliding()
    for step in range(20):
        sliding.move((0.0, 0.0, -1e-4), (0.0, 0.0, 0.1), float("inf"))
        assert sliding.normal_part((0.0, 0.0, 0.1 * step)) == (0.0, 0.0, 0.1 * step)


def test_reset_forgets() -> None:
    sliding, force = contact(0.5, 1.0, 0.01, 1.0)
    sliding.reset()
    assert sliding.normal_part(force) == force
