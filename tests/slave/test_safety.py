from itertools import pairwise, product
from math import inf

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from weberlink.control.contract import LEAST_CONTACT
from weberlink.geometry.rotation import IDENTITY, Quaternion, angle_between, quaternion, toward
from weberlink.geometry.vector import ZERO, Vector, add, distance, dot, norm, scale, subtract, unit
from weberlink.slave.safety import REBOUND, TRIP_PAUSE, CommandGuard, Follower, PressLimit

WORKSPACE = ((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))
TICK = 1e-3
coordinates = st.floats(-1.0, 1.0)
directions = st.tuples(coordinates, coordinates, coordinates).filter(lambda v: norm(v) > 0.1).map(unit)


def guard(retract: float = 0.0) -> CommandGuard:
    made = CommandGuard(workspace=WORKSPACE, speed=1.0, approach_speed=0.1, ramp=0.05, retract=retract)
    made.place((0.0, 0.0, 0.05))
    return made


def test_it_approaches_at_a_limited_speed_and_follows_without_delay_once_there() -> None:
    engaging = guard()
    goal = (0.0, 0.0, 0.04)
    way = [engaging.follow(goal, TICK) for _ in range(101)]
    assert distance(way[0], (0.0, 0.0, 0.05)) == pytest.approx(0.1 * TICK)
    assert way[-1] == goal
    assert engaging.following
    assert engaging.follow((0.0, 0.0005, 0.04), TICK) == (0.0, 0.0005, 0.04)


@given(st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=1, max_size=50))
def test_whatever_is_commanded_stays_in_the_workspace_and_below_the_speed(commands: list[Vector]) -> None:
    moving = guard()
    last = (0.0, 0.0, 0.05)
    for command in commands:
        applied = moving.follow(command, TICK)
        assert all(low <= value <= high for value, low, high in zip(applied, *WORKSPACE, strict=True))
        assert distance(applied, last) <= 1.0 * TICK * (1 + 1e-9)
        last = applied


def test_force_is_shown_only_where_the_operator_is_and_fades_in_there() -> None:
    engaging = guard()
    shown = []
    for _ in range(160):
        engaging.follow((0.0, 0.0, 0.04), TICK)
        shown.append(engaging.shown((0.0, 0.0, 5.0))[2])
    assert shown[:98] == [0.0] * 98
    assert max(b - a for a, b in pairwise(shown)) <= 5.0 * TICK / 0.05 * (1 + 1e-9)
    assert shown[-1] == 5.0
    assert not engaging.ramping
    engaging.release()
    shown = [5.0]
    for _ in range(60):
        engaging.hold(TICK)
        shown.append(engaging.shown((0.0, 0.0, 5.0))[2])
    assert max(a - b for a, b in pairwise(shown)) <= 5.0 * TICK / 0.05 * (1 + 1e-9)
    assert shown[-1] == 0.0


def test_without_a_session_it_holds_where_it_was() -> None:
    lost = guard()
    for _ in range(200):
        lost.follow((0.01, 0.0, 0.04), TICK)
    lost.release((0.0, 0.0, 5.0))
    assert {lost.hold(TICK) for _ in range(100)} == {(0.01, 0.0, 0.04)}
    assert not lost.following


def test_it_retreats_along_the_contact_force_at_the_approach_speed() -> None:
    lost = guard(retract=0.01)
    lost.place((0.0, 0.0, -0.005))
    lost.release((0.0, 0.0, 3.0))
    way = [lost.hold(TICK) for _ in range(200)]
    assert way[0][2] == pytest.approx(-0.005 + 0.1 * TICK)
    assert way[-1] == (0.0, 0.0, 0.005)


def test_free_of_contact_there_is_nothing_to_retreat_from() -> None:
    lost = guard(retract=0.01)
    lost.release((0.0, 0.0, 0.0))
    assert lost.hold(TICK) == (0.0, 0.0, 0.05)


def test_a_peer_that_returns_elsewhere_is_approached_not_jumped_to() -> None:
    returning = guard()
    for _ in range(200):
        returning.follow((0.0, 0.0, 0.04), TICK)
    returning.release()
    returning.hold(TICK)
    assert distance(returning.follow((0.09, 0.0, 0.0), TICK), (0.0, 0.0, 0.04)) == pytest.approx(0.1 * TICK)


@given(st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=1, max_size=50))
def test_an_orientation_is_approached_and_followed_as_a_position_is(rotations: list[Vector]) -> None:
    turning = Follower[Quaternion](IDENTITY, toward, speed=20.0, approach_speed=1.0, ramp=0.05)
    last, there = IDENTITY, False
    for rotation in rotations:
        applied = turning.pursue(quaternion(rotation), TICK)
        assert angle_between(last, applied) <= (20.0 if there else 1.0) * TICK * (1 + 1e-6) + 1e-9
        assert turning.clipped == (there and applied != quaternion(rotation))
        last, there = applied, turning.following
    turning.release()
    assert turning.hold(0.05) == last
    assert turning.shown((1.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)


def pressing(retract: float = 0.01) -> CommandGuard:
    """Follows a hand that is 4 cm deep in a floor at z = 0."""
    guarding = CommandGuard(workspace=WORKSPACE, speed=1.0, approach_speed=0.1, ramp=0.05, trip_retract=retract)
    guarding.place((0.0, 0.0, -0.04))
    for _ in range(60):
        guarding.follow((0.0, 0.0, -0.04), TICK)
    assert guarding.shown((0.0, 0.0, 5.0))[2] == 5.0
    return guarding


def test_a_trip_backs_off_from_where_the_robot_is_and_what_is_shown_fades_out() -> None:
    tripped = pressing()
    tripped.trip((0.0, 0.0, 30.0), where=(0.0, 0.0, -0.005))
    way, shown = [], [5.0]
    for _ in range(600):
        way.append(tripped.follow((0.0, 0.0, -0.04), TICK)[2])
        shown.append(tripped.shown((0.0, 0.0, 5.0))[2])
    assert way[0] == pytest.approx(-0.04 + 0.1 * TICK)
    assert max(b - a for a, b in pairwise(way)) <= 0.1 * TICK * (1 + 1e-9)
    assert way[-1] == pytest.approx(0.005)
    assert max(a - b for a, b in pairwise(shown)) <= 5.0 * TICK / 0.05 * (1 + 1e-9)
    assert shown[60:] == [0.0] * len(shown[60:])
    assert tripped.tripped


def test_after_a_trip_it_follows_again_once_the_hand_is_out_and_the_pause_is_over() -> None:
    inside, outside = (0.0, 0.0, -0.04), (0.0, 0.0, -0.029)
    tripped = pressing()
    tripped.trip((0.0, 0.0, 30.0))
    for _ in range(round(0.8 * TRIP_PAUSE / TICK)):  # the hand is out at once, and waits
        tripped.follow(outside, TICK)
    assert tripped.tripped
    for _ in range(round(0.4 * TRIP_PAUSE / TICK)):  # it waits inside
        tripped.follow(inside, TICK)
    assert tripped.tripped
    held = tripped.hold(TICK)
    applied = tripped.follow(outside, TICK)
    assert not tripped.tripped
    assert distance(held, applied) <= 0.1 * TICK * (1 + 1e-9)
    assert tripped.shown((0.0, 0.0, 5.0))[2] <= 5.0 * TICK / 0.05 * (1 + 1e-9)


@given(
    st.sampled_from([*product((-0.1, 0.1), repeat=3), (0.0, 0.0, 0.05)]),
    st.lists(
        st.one_of(
            st.tuples(coordinates, coordinates, coordinates),
            st.tuples(st.sampled_from(["hold", "release", "trip", "reset"]), directions),
        ),
        min_size=1,
        max_size=60,
    ),
)
@example((-0.1, -0.1, -0.1), [(-1.0, -1.0, -1.0), ("release", (-1.0, 0.0, 0.0)), *[("hold", (1.0, 0.0, 0.0))] * 20])
@example((0.1, 0.1, 0.1), [("trip", (0.0, 0.0, 1.0)), *[(0.0, 0.0, 0.0)] * 20])
def test_in_every_state_the_robot_stays_in_the_workspace_and_nothing_jumps(
    start: Vector, steps: list[Vector | tuple[str, Vector]]
) -> None:
    guarding = guard(retract=0.01)
    guarding.place(start)
    last, share = start, 0.0
    for step in steps:
        following, interrupts = guarding.following, len(step) == 2
        match step:
            case "release", out:
                guarding.release(scale(out, 5.0))
            case "trip", out:
                guarding.trip(scale(out, 5.0))
            case "reset", _:
                guarding.reset()
        applied = guarding.hold(TICK) if interrupts else guarding.follow(step, TICK)  # type: ignore[arg-type]
        assert all(low <= value <= high for value, low, high in zip(applied, *WORKSPACE, strict=True))
        speed = 1.0 if following and not interrupts else 0.1
        assert distance(applied, last) <= speed * TICK * (1 + 1e-6) + 1e-12
        assert guarding.clipped == (guarding.following and applied != step)
        shown = norm(guarding.shown((0.0, 0.0, 1.0)))
        assert shown - share <= TICK / 0.05 * (1 + 1e-9)
        last, share = applied, shown


# --- the limit of the force with which the robot presses

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


def test_a_limit_that_forgets_bounds_as_a_new_one() -> None:
    limit, up = PressLimit(MOST, COUPLING), (0.0, 0.0, 3.0)
    deep, surface = (0.0, 0.0, -0.02), (0.0, 0.0, 0.0)
    for depth, height in ((0.0, 0.0), (0.001, 0.005), (0.001, 0.0)):  # an excess that goes when the command stops
        limit.bounded(deep, (0.0, 0.0, -depth), (0.0, 0.0, height), up, TICK)
    as_new = PressLimit(MOST, COUPLING).bounded(deep, surface, surface, up, TICK)
    assert limit.bounded(deep, surface, surface, up, TICK) != as_new
    limit.forget()
    assert limit.bounded(deep, surface, surface, up, TICK) == as_new
