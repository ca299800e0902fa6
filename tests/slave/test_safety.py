"""The limit of the force with which a robot presses, and its guard, which is tested with its port too."""

from math import inf
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.control.contract import LEAST_CONTACT
from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract, unit
from weberlink.slave.safety import LEAST_STEP, REBOUND, SPRING, TRIP_PAUSE, CommandGuard, PressLimit, PressStep

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


# How far a command goes in within a tick, where the largest press is 1.


@pytest.mark.parametrize(("wanted", "goes"), [(-0.3, -0.3), (0.6, 0.6), (0.61, 0.6), (5.0, 0.6)])
def test_a_command_goes_as_deep_as_the_press_may_become(wanted: float, goes: float) -> None:
    step = PressStep(1.0, 0.0)
    assert step.allowed(wanted, 0.4, 0.4, 0.0, TICK) == pytest.approx(goes)
    assert not step.catches_up


@pytest.mark.parametrize(
    ("press", "before", "goes"), [(1.5, 1.5, -0.5), (1.5, 1.2, -0.2), (1.5, 0.9, 0.0), (9.0, 9.0, -8.0)]
)
@pytest.mark.parametrize("retreats", [True, False])
def test_an_excess_stops_the_command_and_one_that_stays_takes_it_out(
    press: float, before: float, goes: float, retreats: bool
) -> None:
    step = PressStep(1.0, 0.0)
    assert step.allowed(5.0, press, before, 0.0, TICK, retreats=retreats) == pytest.approx(goes if retreats else 0.0)


@pytest.mark.parametrize(("last", "now"), [(0.01, 0.0), (0.0, 0.01), (-0.02, 0.01), (0.01, -0.02), (-0.02, -0.03)])
def test_after_an_excess_a_command_goes_in_at_twice_its_last_speed_at_most(last: float, now: float) -> None:
    step = PressStep(1.0, 0.0)
    step.allowed(5.0, 1.5, 1.5, last, TICK)
    fastest = max(abs(last), abs(now))
    assert step.allowed(5.0, 0.0, 0.0, now, TICK) == pytest.approx(2.0 * fastest + LEAST_STEP)
    assert step.allowed(5.0, 0.0, 0.0, 9.0, TICK) == pytest.approx(1.0 / max(1.0, 2.0 * SPRING)), "of a spring"


@pytest.mark.parametrize(("damping", "answers"), [(0.0, 1.0), (3.0, 4.0), (9.0, 5.0)])
def test_a_press_that_follows_the_speed_of_a_command_slows_it_down(damping: float, answers: float) -> None:
    """The press changes by five times the change of the speed; no more is believed than the largest damping gives."""
    step = PressStep(1.0, damping * TICK)
    step.allowed(5.0, 1.5, 1.5, 0.0, TICK)
    goes = step.allowed(5.0, 0.5, 0.0, 0.1, TICK)
    assert goes == pytest.approx(min(0.5 / (2.0 * answers), 0.2 + LEAST_STEP))
    assert step.catches_up is (answers > 2.0)
    step.rest()
    assert not step.catches_up
    assert step.allowed(5.0, 0.5, 0.5, 0.1, TICK) == 0.5, "of the contact, which is over"


@pytest.mark.parametrize("most", [1.0, 0.5])
@pytest.mark.parametrize(
    ("went", "press", "answers"),
    [
        ((0.2, 0.5), (0.1, 0.7), 2.0),
        ((0.0, 0.01), (0.92, 0.96), 4.0), ((0.0, -0.01), (0.96, 0.92), 4.0),
        ((0.0, 0.01), (0.96, 0.98), None),  # less than the noise
        ((0.0, -0.01), (0.92, 0.96), None), ((0.0, 0.01), (0.96, 0.92), None),  # against the motion
        ((0.5, 0.51), (0.92, 0.96), None), ((0.1, 0.19), (0.5, 0.9), None),  # too little for the speed
        ((0.1, 0.21), (0.5, 0.9), 0.4 / 0.11),
    ],
)  # fmt: skip
def test_the_answer_is_measured_where_the_speed_changes_enough(
    most: float, went: tuple[float, float], press: tuple[float, float], answers: float | None
) -> None:
    step = PressStep(most, 9.0 * TICK)
    step.allowed(5.0, 1.5 * most, 1.5 * most, went[0] * most, TICK)
    goes = step.allowed(5.0, press[1] * most, press[0] * most, went[1] * most, TICK)
    share = 1.0 / max(1.0, 2.0 * (answers or SPRING))
    fastest = max(map(abs, went))
    assert goes == pytest.approx(most * min(share * (1.0 - press[1]), 2.0 * fastest + LEAST_STEP))


def test_without_time_between_two_presses_the_answer_is_that_of_a_spring() -> None:
    step = PressStep(1.0, 9.0)
    step.allowed(5.0, 1.5, 1.5, 0.0, 0.0)
    assert step.allowed(5.0, 0.96, 0.92, 0.01, 0.0) == pytest.approx(0.04 / 2.0)


# The guard.


def guard(**changes: float) -> CommandGuard:
    box = (-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)
    return CommandGuard(workspace=box, speed=1.0, approach_speed=0.25, ramp=0.05, **changes)


def test_force_is_shown_from_the_end_of_the_approach_on_and_fades() -> None:
    follower, felt, goal = guard(), (0.0, 0.0, 2.0), (0.0, 0.0, 0.001)
    shown = [follower.shown(felt)[2] for _ in range(70) if follower.follow(goal, TICK)]
    assert shown == pytest.approx([*[0.0] * 3, *(min(2.0, 0.04 * tick) for tick in range(1, 68))])
    assert (follower.ramping, follower.following, follower.clipped) == (False, True, False)
    follower.place(goal)
    assert (follower.shown(felt), follower.ramping, follower.following) == (ZERO, True, False)
    assert all(follower.follow(goal, TICK) for _ in range(60))
    follower.release()
    faded = [follower.shown(felt)[2] for _ in range(60) if follower.hold(TICK)]
    assert faded == pytest.approx([max(0.0, 2.0 - 0.04 * tick) for tick in range(1, 61)], abs=1e-12)


def test_a_new_guard_shows_nothing_and_holds() -> None:
    follower = guard()
    assert (follower.clipped, follower.following, follower.tripped) == (False, False, False)
    assert follower.shown((0.0, 0.0, 2.0)) == ZERO
    assert follower.hold(TICK) == ZERO


def test_speed_and_workspace_bound_the_command_and_tell_so() -> None:
    follower = guard()
    assert follower.follow((0.0, 0.0, 0.0001), TICK)[2] == pytest.approx(0.0001)
    assert follower.follow((0.0, 0.0, 0.5), TICK)[2] == pytest.approx(0.0011)
    assert follower.clipped
    for _ in range(200):
        at = follower.follow((0.5, -0.5, 0.5), TICK)
    assert at == pytest.approx((0.1, -0.1, 0.1))
    assert follower.clipped
    assert follower.follow((0.1, -0.1, 0.1), TICK) == at
    assert not follower.clipped


@pytest.mark.parametrize("where", [None, (0.0, 0.0, 0.004)])
def test_a_trip_backs_off_and_ends_once_the_command_is_out_and_the_pause_over(where: Vector | None) -> None:
    follower = guard(trip_retract=0.02)
    follower.trip((0.0, 0.0, 5.0), where)
    end = 0.02 + (0.0 if where is None else 0.004)
    first = follower.follow((0.0, 0.0, 0.05), TICK)
    assert first == pytest.approx((0.0, 0.0, 0.25e-3))
    ticks = round(TRIP_PAUSE / TICK)
    held = [follower.follow((0.0, 0.0, end - 1e-4), TICK)[2] for _ in range(ticks + 10)]
    assert held[-1] == pytest.approx(end)
    assert follower.tripped, "not out yet"
    follower.follow((0.0, 0.0, end), TICK)
    assert not follower.tripped


@pytest.mark.parametrize(("retract", "goes"), [(0.0, 0.0), (0.02, 0.02)])
def test_a_release_holds_or_backs_off(retract: float, goes: float) -> None:
    follower = guard(retract=retract)
    follower.release((0.0, 3.0, 0.0))
    assert [follower.hold(TICK) for _ in range(200)][-1] == pytest.approx((0.0, goes, 0.0))
    follower.release(ZERO)
    assert follower.hold(TICK) == pytest.approx((0.0, goes, 0.0))
