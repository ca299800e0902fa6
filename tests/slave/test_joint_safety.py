"""Limits of a follower arm: engagement, range, speed, press limit, trips."""

from itertools import pairwise
from math import inf, nan
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.joints import Joints
from weberlink.slave.joint_safety import TRIP_RETREAT, JointGuard, JointPressLimit, toward
from weberlink.slave.safety import REBOUND, TRIP_PAUSE

TICK = 1e-3
LOWER, UPPER = (-1.0, -0.5, 0.0), (1.0, 0.5, 0.8)
SPEED, APPROACH, RAMP = 4.0, 0.5, 0.05
angles = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


def guard(start: Joints = (0.0, 0.0, 0.4)) -> JointGuard:
    made = JointGuard(lower=LOWER, upper=UPPER, trip=(1.0, 1.0, 0.5), speed=SPEED, approach_speed=APPROACH, ramp=RAMP)
    made.place(start)
    return made


def steps(way: list[Joints]) -> list[float]:
    """Largest step of an axis, tick by tick."""
    return [max(abs(b - a) for a, b in zip(before, after, strict=True)) for before, after in pairwise(way)]


@given(angles, angles, st.floats(0.0, 1.0))
def test_each_axis_goes_its_own_way(start: Joints, goal: Joints, way: float) -> None:
    for angle, end, moved in zip(start, goal, toward(start, goal, way), strict=True):
        assert min(angle, end) <= moved <= max(angle, end)
        assert moved == end or abs(moved - angle) == pytest.approx(way)


def test_arm_outside_its_range_holds_there_until_led() -> None:
    outside = guard((1.2, 0.0, 0.4))
    assert outside.hold(TICK) == (1.2, 0.0, 0.4)
    assert outside.follow((1.2, 0.0, 0.4), TICK)[0] == pytest.approx(1.2 - APPROACH * TICK)


def test_trip_backs_off_the_axes_that_were_too_strong() -> None:
    tripped = guard()
    torques, where = (0.9, -1.4, 0.1), (0.0, -0.03, 0.4)
    assert tripped.is_overloaded(torques)
    tripped.follow((0.0, 0.0, 0.4), TICK)
    tripped.trip(torques, where)
    assert not tripped.following
    way = [tripped.follow((0.3, 0.3, 0.4), TICK) for _ in range(600)]
    assert max(steps(way)) <= APPROACH * TICK * (1 + 1e-9)
    assert way[-1] == (0.0, pytest.approx(-0.03 - TRIP_RETREAT), 0.4)
    assert tripped.tripped


def test_sagging_axis_backs_off_from_its_command() -> None:
    tripped = guard()
    tripped.trip((0.0, 1.4, 0.0), (0.0, -0.08, 0.4))
    assert [tripped.hold(TICK) for _ in range(200)][-1] == (0.0, pytest.approx(TRIP_RETREAT), 0.4)


def test_after_a_trip_it_follows_once_led_out() -> None:
    tripped, inside, out = guard(), (0.0, -0.9 * TRIP_RETREAT, 0.4), (0.1, -TRIP_RETREAT, 0.4)
    tripped.trip((0.0, -1.4, 0.0), (0.0, 0.0, 0.4))
    for _ in range(round(0.8 * TRIP_PAUSE / TICK)):
        tripped.follow(out, TICK)
    assert tripped.tripped, "not before the pause is over"
    for _ in range(round(0.4 * TRIP_PAUSE / TICK)):
        tripped.follow(inside, TICK)
    assert tripped.tripped, "not while the hand is in the contact"
    held = tripped.hold(TICK)
    assert max(steps([held, tripped.follow(out, TICK)])) <= APPROACH * TICK * (1 + 1e-9)
    assert not tripped.tripped


@pytest.mark.parametrize(("lower", "upper"), [((1.0,), (0.0,)), ((-1.0, 1.0), (1.0, 0.0)), ((nan, -1.0), (1.0, 1.0))])
def test_range_without_an_angle_is_refused(lower: Joints, upper: Joints) -> None:
    with pytest.raises(ValueError, match="range"):
        JointGuard(lower=lower, upper=upper, trip=(1.0, 1.0), speed=1.0, approach_speed=1.0, ramp=1.0)


def test_an_axis_that_does_not_move_has_a_range_of_one_angle() -> None:
    fixed = JointGuard(lower=(0.5, 0.0), upper=(0.5, 1.0), trip=(1.0, 1.0), speed=1.0, approach_speed=1.0, ramp=1.0)
    assert fixed.hold(TICK) == (0.0, 0.0)
    assert [fixed.follow((0.0, 2.0), TICK) for _ in range(2000)][-1] == pytest.approx((0.5, 1.0))


MOST, STIFFNESS, NOISE = (1.0, 1.0, 0.5), (10.0, 20.0, 5.0), 0.02
REACH = (0.1, 0.05, 0.1)


def press_limit() -> JointPressLimit:
    return JointPressLimit(MOST, STIFFNESS, NOISE)


@given(target=angles, measured=angles, torques=st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_pressing_axis_is_commanded_no_deeper_than_its_limit(target: Joints, measured: Joints, torques: Joints) -> None:
    bounded = press_limit().bounded(target, measured, measured, torques, TICK)
    for axis, torque in enumerate(torques):
        depth = (measured[axis] - bounded[axis]) * (1.0 if torque > 0.0 else -1.0)
        wanted = (measured[axis] - target[axis]) * (1.0 if torque > 0.0 else -1.0)
        if abs(torque) < 0.1 * MOST[axis] or wanted <= REACH[axis]:
            assert bounded[axis] == target[axis]
        else:
            assert depth == pytest.approx(REACH[axis])


def test_press_limit_outlasts_the_contact_by_the_rebound() -> None:
    limit, still = press_limit(), (0.0, 0.0, 0.0)
    limit.bounded(still, still, still, (0.5, 0.0, 0.0), TICK)
    for _ in range(round(REBOUND / TICK) - 1):
        assert limit.bounded((-0.5, 0.0, 0.0), still, still, still, TICK)[0] == pytest.approx(-0.1)
    target = (-0.5, 0.0, 0.0)
    assert limit.bounded(target, still, still, still, TICK) is target
    limit.bounded(still, still, still, (0.5, 0.0, 0.0), TICK)
    limit.bounded((0.1, 0.0, 0.0), still, still, still, TICK)
    assert limit.bounded(target, still, still, still, TICK) is target, "out of the contact, it is over at once"


@pytest.mark.parametrize("held", [0.0, -0.15])
@pytest.mark.parametrize("ends", ["forgets", "rebound", "out"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_after_a_contact_it_bounds_as_a_new_one(ends: str, held: float, sign: float) -> None:
    limit, new = (JointPressLimit((1.0,), (10.0,), NOISE) for _ in range(2))
    for before in (-0.12, -0.04):
        limit.bounded((-sign,), (sign * before,), (0.0,), (sign,), TICK)
    if ends == "forgets":
        limit.forget()
    for _ in range(round(REBOUND / TICK) + 2 if ends == "rebound" else ends == "out"):
        for each in (limit, new):
            each.bounded((-sign if ends == "rebound" else 0.1 * sign,), (0.0,), (0.0,), (0.0,), TICK)
    for _ in range(2):
        found, expected = (each.bounded((-sign,), (sign * held,), (0.0,), (sign,), TICK) for each in (limit, new))
        assert found == expected


@pytest.mark.parametrize(("sign", "shift"), [(-1.0, 0.0), (1.0, 0.7), (-1.0, -0.4)])
def test_where_and_in_which_direction_an_axis_presses_makes_no_difference(sign: float, shift: float) -> None:
    limit, plain = (JointPressLimit((1.0,), (10.0,), NOISE) for _ in range(2))
    draw, bounds = Random(4), 0
    for _ in range(400):
        target, held, angle = draw.uniform(-0.6, 0.1), draw.uniform(-0.2, 0.1), draw.uniform(-0.1, 0.1)
        torque = draw.choice([0.0, 0.1, 0.94, 0.96])
        moved = [(sign * each + shift,) for each in (target, held, angle)]
        (found,) = limit.bounded(*moved, (sign * torque,), TICK)
        (expected,) = plain.bounded((target,), (held,), (angle,), (torque,), TICK)
        assert found == pytest.approx(sign * expected + shift, abs=1e-12)
        bounds += expected != target
    assert bounds > 100


def test_light_load_does_not_make_a_sagging_arm_sink() -> None:
    """It sags by 0.08 rad under its weight and takes up 0.3 N m: together beyond 0.1 rad."""
    held, sagged = (0.0, 0.0, 0.0), (-0.11, 0.0, 0.0)
    assert press_limit().bounded(held, held, sagged, (-0.3, 0.0, 0.0), TICK) == held
    higher = (0.2, 0.0, 0.0)
    assert press_limit().bounded(higher, held, sagged, (-0.3, 0.0, 0.0), TICK) == held, "no deeper"


def test_load_above_the_limit_makes_the_arm_yield() -> None:
    held, pushed = (0.0, 0.0, 0.0), (-0.3, 0.0, 0.0)
    assert press_limit().bounded(held, held, pushed, (-1.5, 0.0, 0.0), TICK)[0] == pytest.approx(-0.2)


@pytest.mark.parametrize(("most", "stiffness"), [(1.0, inf), (0.0, 10.0), (inf, 10.0)])
def test_axis_is_not_bounded_without_a_limit(most: float, stiffness: float) -> None:
    limit, target = JointPressLimit((most,), (stiffness,), 0.0), (-5.0,)
    assert limit.bounded(target, (0.0,), (0.0,), (0.9,), TICK) is target


def test_held_angles_move_near_the_measured_ones() -> None:
    assert press_limit().near((0.0, 0.04, -1.0), (0.5, 0.0, 0.0)) == (0.4, 0.04, -0.1)


@pytest.mark.parametrize("most", [(-1.0,), (1.0, -1.0), (nan, 1.0)])
def test_negative_press_limit_is_refused(most: Joints) -> None:
    with pytest.raises(ValueError, match="negative"):
        JointPressLimit(most, (1.0,) * len(most), 0.0)
