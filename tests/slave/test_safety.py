"""The limit of the force with which a robot presses; its guard is tested with its port."""

from math import inf
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.control.contract import LEAST_CONTACT
from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract, unit
from weberlink.slave.safety import REBOUND, PressLimit

TICK = 1e-3


coordinates = st.floats(-1.0, 1.0)
directions = st.tuples(coordinates, coordinates, coordinates).filter(lambda v: norm(v) > 0.1).map(unit)
MOST, COUPLING = 6.0, 2500.0
near = st.floats(-0.05, 0.05)
places = st.tuples(near, near, near)


def pressed(target: Vector, tip: Vector, outward: Vector, stiffness: float = COUPLING) -> float:
    """Force of the robot's spring into the contact [N]."""
    return stiffness * dot(subtract(tip, target), outward)


@given(
    places, places, places, directions, st.floats(LEAST_CONTACT * 1.001, 30.0), st.floats(0.1, 20.0),
    st.floats(10.0, 1e6),
)  # fmt: skip
def test_the_spring_of_the_robot_never_presses_with_more_than_the_limit(
    target: Vector, held: Vector, tip: Vector, outward: Vector, force: float, most: float, stiffness: float
) -> None:
    goal = PressLimit(most, stiffness).bounded(target, held, tip, scale(outward, force), TICK)
    assert pressed(goal, tip, outward, stiffness) <= most + 1e-9 * stiffness
    if pressed(target, tip, outward, stiffness) <= most - 1e-9 * stiffness:
        assert goal == target
    else:
        moved = subtract(goal, target)
        assert norm(moved) == pytest.approx(abs(dot(moved, outward)), abs=1e-12)  # along the force alone
        assert dot(moved, outward) >= -1e-12
        assert pressed(goal, tip, outward, stiffness) == pytest.approx(most, abs=1e-9 * stiffness)


@given(places, directions, places, st.floats(0.0, 0.05))
def test_motion_along_a_contact_and_out_of_it_is_not_bounded(
    tip: Vector, outward: Vector, aside: Vector, out: float
) -> None:
    along = subtract(aside, scale(outward, dot(aside, outward)))
    target = add(tip, add(along, scale(outward, out)))
    assert PressLimit(MOST, COUPLING).bounded(target, target, tip, scale(outward, 5.0), TICK) == target


def test_a_robot_that_bounces_is_held_back_until_the_rebound_is_over() -> None:
    limit = PressLimit(MOST, COUPLING)
    deep, tip, up = (0.01, 0.0, -0.02), (0.0, 0.0, 0.001), (0.0, 0.0, 1.0)
    assert limit.bounded(deep, deep, tip, ZERO, TICK) == deep  # before any contact
    limit.bounded(deep, deep, tip, (0.0, 0.0, 3.0), TICK)
    ticks = round(REBOUND / TICK)
    for _ in range(ticks - 2):
        assert pressed(limit.bounded(deep, deep, tip, ZERO, TICK), tip, up) == pytest.approx(MOST)
    free = [limit.bounded(deep, deep, tip, (0.0, 0.0, 0.9 * LEAST_CONTACT), TICK) == deep for _ in range(4)]
    assert free[-1]


def test_the_rebound_is_over_once_the_operator_has_pulled_out() -> None:
    limit = PressLimit(MOST, COUPLING)
    deep, tip, out = (0.0, 0.0, -0.02), (0.0, 0.0, 0.001), (0.0, 0.0, 0.002)
    assert limit.bounded(deep, tip, tip, (0.0, 0.0, 3.0), TICK) != deep
    assert limit.bounded(out, tip, tip, (0.0, 0.0, 3.0), TICK) == out
    assert limit.bounded(deep, tip, tip, ZERO, TICK) != deep, "out within the contact is not out of it"
    assert limit.bounded(out, tip, tip, ZERO, TICK) == out
    assert limit.bounded(deep, tip, tip, ZERO, TICK) == deep


def test_a_robot_of_unstated_stiffness_is_not_bounded() -> None:
    deep = (0.0, 0.0, -1.0)
    assert PressLimit(MOST, inf).bounded(deep, deep, ZERO, (0.0, 0.0, 5.0), TICK) == deep


@pytest.mark.parametrize("held", [ZERO, (0.0, 0.0, -0.004)])
@pytest.mark.parametrize("ends", ["forgets", "rebound", "out"])
def test_after_a_contact_it_bounds_as_a_new_one(ends: str, held: Vector) -> None:
    limit, new = PressLimit(MOST, COUPLING), PressLimit(MOST, COUPLING)
    deep, up = (0.0, 0.0, -0.02), (0.0, 0.0, 3.0)
    limit.bounded(deep, (0.0, 0.0, -0.003), ZERO, up, TICK)
    limit.bounded(deep, (0.0, 0.0, -0.001), ZERO, up, TICK)
    if ends == "forgets":
        limit.forget()
    for _ in range(round(REBOUND / TICK) + 2 if ends == "rebound" else ends == "out"):
        for each in (limit, new):
            each.bounded(deep if ends == "rebound" else (0.0, 0.0, 0.001), ZERO, ZERO, ZERO, TICK)
    for _ in range(2):
        assert limit.bounded(deep, held, ZERO, up, TICK) == new.bounded(deep, held, ZERO, up, TICK)


@pytest.mark.parametrize("out", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.0, -0.8), (2 / 3, -1 / 3, 2 / 3)])
def test_the_direction_of_the_contact_makes_no_difference(out: Vector) -> None:
    limit, upward, draw = PressLimit(MOST, COUPLING), PressLimit(MOST, COUPLING), Random(4)
    most, bounds = MOST / COUPLING, 0
    for _ in range(400):
        target, held, tip = (
            draw.uniform(-6.0, 1.0) * most,
            draw.uniform(-2.0, 1.0) * most,
            draw.uniform(-1.0, 1.0) * most,
        )
        force = draw.choice([0.0, LEAST_CONTACT, 5.0])
        bounded = limit.bounded(*(scale(out, along) for along in (target, held, tip, force)), TICK)
        expected = upward.bounded(*((0.0, 0.0, along) for along in (target, held, tip, force)), TICK)[2]
        assert bounded == pytest.approx(scale(out, expected), abs=1e-12)
        bounds += expected != target
    assert bounds > 100
