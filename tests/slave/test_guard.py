"""What leaves for a robot: the press limit of a tip and of an axis of an arm, and the guard with its trips."""

from functools import partial
from math import dist, hypot, inf, isfinite, nan
from typing import Any

import pytest
from hypothesis import example, given, strategies as st

from tests.examples import examples
from weberlink.control.contract import LEAST_CONTACT
from weberlink.geometry.joints import Joints
from weberlink.slave.guard import (
    LEAST_STEP,
    REBOUND,
    SPRING,
    TRIP_PAUSE,
    Approach,
    Guard,
    PressLimit,
    PressStep,
    axis_press_limit,
)

TICK = 1e-3
MOST, COUPLING = 6.0, 2500.0
DEEP = 0.02


def tip(most: float = MOST, stiffness: float = COUPLING) -> PressLimit:
    return PressLimit(most, stiffness, damping=100.0, contact=LEAST_CONTACT)


def axis(most: float = MOST, stiffness: float = COUPLING) -> PressLimit:
    return axis_press_limit(most, stiffness, 0.02)


LIMITS = {  # a limit, and the direction out of the contact
    **{
        f"tip {out}": (tip, out)
        for out in ((0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (-0.6, 0.0, -0.8), (2 / 3, -1 / 3, 2 / 3))
    },
    **{f"axis {out}": (axis, (out,)) for out in (1.0, -1.0)},
}
anywhere = pytest.mark.parametrize("name", LIMITS)


def along(direction: Joints, way: float) -> Joints:
    return tuple(way * share for share in direction)


def bounded(name: str, limit: PressLimit, target: float, held: float, where: float, force: float) -> float:
    """What is left of a target, all of them as ways out of the contact."""
    out = LIMITS[name][1]
    places = [along(out, way) for way in (target, held, where)]
    goal = limit.bounded(*places, along(out, force), TICK)
    away = [there - here for here, there in zip(places[0], goal, strict=True)]
    way = sum(there * share for there, share in zip(away, out, strict=True))
    assert hypot(*away) == pytest.approx(abs(way), abs=1e-12), "along the force alone"
    assert way >= 0.0
    return target + way


@anywhere
@given(
    target=st.floats(-0.05, 0.05), held=st.floats(-0.05, 0.05), where=st.floats(-0.05, 0.05),
    force=st.floats(6.0, 30.0), most=st.floats(0.1, 6.0), stiffness=st.floats(10.0, 1e6),
)  # fmt: skip
@examples(20)
def test_the_spring_never_presses_with_more_than_the_limit(
    name: str, target: float, held: float, where: float, force: float, most: float, stiffness: float
) -> None:
    goal = bounded(name, LIMITS[name][0](most, stiffness), target, held, where, force)
    deepest = where - most / stiffness
    assert goal == pytest.approx(max(target, deepest), abs=1e-12)
    assert target < deepest or goal == target


@given(st.tuples(*[st.floats(-0.05, 0.05)] * 2), st.floats(0.0, 0.05))
def test_motion_along_a_contact_and_out_of_it_is_not_bounded(aside: tuple[float, float], out: float) -> None:
    target = (*aside, out)
    assert tip().bounded(target, target, (0.0, 0.0, 0.0), (0.0, 0.0, 5.0), TICK) == target


@anywhere
def test_a_robot_that_bounces_is_held_back_until_the_rebound_is_over(name: str) -> None:
    limit, deepest = LIMITS[name][0](), 0.001 - MOST / COUPLING
    least = (LEAST_CONTACT if name.startswith("tip") else 0.1 * MOST) * 0.9
    assert bounded(name, limit, -DEEP, -DEEP, 0.001, 0.0) == -DEEP, "before any contact"
    bounded(name, limit, -DEEP, -DEEP, 0.001, MOST)
    for _ in range(round(REBOUND / TICK) - 2):
        assert bounded(name, limit, -DEEP, -DEEP, 0.001, 0.0) == pytest.approx(
            deepest if name.startswith("tip") else -DEEP
        )
    assert [bounded(name, limit, -DEEP, -DEEP, 0.001, least) for _ in range(4)][-1] == -DEEP


@anywhere
def test_the_rebound_is_over_once_the_operator_has_pulled_out(name: str) -> None:
    limit = LIMITS[name][0]()
    assert bounded(name, limit, -DEEP, 0.001, 0.001, MOST) > -DEEP
    assert bounded(name, limit, 0.002, 0.001, 0.001, MOST) == 0.002
    assert bounded(name, limit, -DEEP, 0.001, 0.001, 0.0) > -DEEP, "out within the contact is not out of it"
    assert bounded(name, limit, 0.002, 0.001, 0.001, 0.0) == 0.002
    assert bounded(name, limit, -DEEP, 0.001, 0.001, 0.0) == -DEEP


@pytest.mark.parametrize(("most", "stiffness"), [(MOST, inf), (0.0, COUPLING), (inf, COUPLING)])
@pytest.mark.parametrize("made", [tip, axis])
def test_without_a_limit_nothing_is_bounded(made: type, most: float, stiffness: float) -> None:
    assert made(most, stiffness).bounded((-1.0,), (-1.0,), (0.0,), (5.0,), TICK) == (-1.0,)


@pytest.mark.parametrize("most", [-1.0, nan])
def test_a_limit_that_is_none_is_refused(most: float) -> None:
    with pytest.raises(ValueError, match="negative"):
        tip(most)


@anywhere
@pytest.mark.parametrize("held", [0.0, -0.004])
@pytest.mark.parametrize("ends", ["forgets", "rebound", "out"])
def test_after_a_contact_it_bounds_as_a_new_one(ends: str, held: float, name: str) -> None:
    limit, new = LIMITS[name][0](), LIMITS[name][0]()
    for before in (-0.003, -0.001):
        bounded(name, limit, -DEEP, before, 0.0, MOST)
    if ends == "forgets":
        limit.forget()
    for _ in range(round(REBOUND / TICK) + 2 if ends == "rebound" else ends == "out"):
        for each in (limit, new):
            bounded(name, each, -DEEP if ends == "rebound" else 0.001, 0.0, 0.0, 0.0)
    for _ in range(2):
        found, expected = (bounded(name, each, -DEEP, held, 0.0, MOST) for each in (limit, new))
        assert found == expected


@pytest.mark.parametrize(
    ("target", "angle", "torque", "goes"),
    [(0.0, -0.11, -0.3, 0.0), (0.2, -0.11, -0.3, 0.0), (0.0, -0.3, -1.5, -0.2)],
    ids=["a light load is kept up", "it goes no deeper", "it yields to a large one"],
)
def test_an_arm_that_sags_yields_to_what_presses_too_much_alone(
    target: float, angle: float, torque: float, goes: float
) -> None:
    """It may press over 0.1 rad; the first sags by 0.08 under its weight and takes up 0.3 N m."""
    assert axis(1.0, 10.0).bounded((target,), (0.0,), (angle,), (torque,), TICK)[0] == pytest.approx(goes)


# How far a command goes in within a tick.

EXCESS = (5.0, 1.5, 1.5, 0.0)
"""What was wanted, the press and the one before, and how far the command went in since; the largest press is 1."""


@pytest.mark.parametrize(
    ("calls", "damping", "goes"),
    [
        # As deep as the press may become.
        *(([(wanted, 0.4, 0.4, 0.0)], 0.0, min(wanted, 0.6)) for wanted in (-0.3, 0.6, 0.61, 5.0)),
        # An excess stops the command, and one that stays takes it out.
        ([EXCESS], 0.0, -0.5), ([(5.0, 1.5, 1.2, 0.0)], 0.0, -0.2), ([(5.0, 1.5, 0.9, 0.0)], 0.0, 0.0),
        ([(5.0, 9.0, 9.0, 0.0)], 0.0, -8.0),
        # After an excess it goes in at twice its last speed at most, or as a spring lets it.
        *(([(5.0, 1.5, 1.5, last), (5.0, 0.0, 0.0, now)], 0.0, 2.0 * max(abs(last), abs(now)) + LEAST_STEP)
          for last, now in ((0.01, 0.0), (0.0, 0.01), (-0.02, 0.01), (0.01, -0.02), (-0.02, -0.03))),
        ([EXCESS, (5.0, 0.0, 0.0, 9.0)], 0.0, 1.0 / max(1.0, 2.0 * SPRING)),
        # A press that changes by five times the change of the speed slows it down: as far as a damping can do that.
        ([EXCESS, (5.0, 0.5, 0.0, 0.1)], 0.0, 0.2 + LEAST_STEP), ([EXCESS, (5.0, 0.5, 0.0, 0.1)], 3.0, 0.5 / 8.0),
        ([EXCESS, (5.0, 0.5, 0.0, 0.1)], 9.0, 0.5 / 10.0),
        # That answer is measured where the speed changes enough, and with it the press by more than the noise.
        *(([(5.0, 1.5, 1.5, went[0]), (5.0, press[1], press[0], went[1])], 9.0,
           min((1.0 - press[1]) / max(1.0, 2.0 * answers), 2.0 * max(map(abs, went)) + LEAST_STEP))
          for went, press, answers in (
              ((0.2, 0.5), (0.1, 0.7), 2.0), ((0.0, 0.01), (0.92, 0.96), 4.0), ((0.0, -0.01), (0.96, 0.92), 4.0),
              ((0.1, 0.21), (0.5, 0.9), 0.4 / 0.11), ((0.0, 0.01), (0.96, 0.98), SPRING),  # noise
              ((0.0, -0.01), (0.92, 0.96), SPRING), ((0.0, 0.01), (0.96, 0.92), SPRING),  # against the motion
              ((0.5, 0.51), (0.92, 0.96), SPRING), ((0.1, 0.19), (0.5, 0.9), SPRING),  # too little for the speed
          )),
    ],
)  # fmt: skip
@pytest.mark.parametrize("most", [1.0, 0.5])
def test_how_far_a_command_may_go_in(most: float, calls: list[tuple[float, ...]], damping: float, goes: float) -> None:
    step, still = PressStep(most, damping * TICK), PressStep(most, damping * TICK)
    for wanted, press, before, went in calls:
        scaled = [most * each for each in (wanted, press, before, went)]
        found, kept = step.allowed(*scaled, TICK), still.allowed(*scaled, TICK, retreats=False)
    assert found == pytest.approx(most * goes)
    assert kept == pytest.approx(most * (goes if press <= 1.0 else 0.0))


@pytest.mark.parametrize(("damping", "catches_up"), [(0.0, False), (3.0, True)])
def test_a_command_that_a_damping_slowed_down_catches_up_until_the_contact_is_over(
    damping: float, catches_up: bool
) -> None:
    step = PressStep(1.0, damping * TICK)
    step.allowed(*EXCESS, TICK)
    assert not step.catches_up
    step.allowed(5.0, 0.5, 0.0, 0.1, TICK)
    assert step.catches_up is catches_up
    step.rest()
    assert not step.catches_up
    assert step.allowed(5.0, 0.5, 0.5, 0.1, TICK) == 0.5


def test_without_time_between_two_presses_the_answer_is_that_of_a_spring() -> None:
    step = PressStep(1.0, 9.0)
    step.allowed(*EXCESS, 0.0)
    assert step.allowed(5.0, 0.96, 0.92, 0.01, 0.0) == pytest.approx(0.04 / 2.0)


# The guard.


LOWER, UPPER = (-0.1, -0.2, -0.3), (0.4, 0.5, 0.6)
SPEED, APPROACH, RAMP, RETRACT, TRIP_RETRACT = 1.0, 0.25, 0.05, 0.005, 0.02
TRIPS = {"hand": (20.0,), "arm": (20.0, 20.0, 10.0)}  # the forces that trip each part
FREE = (0.0, 0.0, 0.0)
both = pytest.mark.parametrize("kind", TRIPS)


def guard(kind: str, **options: Any) -> Guard:
    """Without a press limit, unless `presses` are given."""
    limits = {"presses": [tip(inf) for _ in TRIPS[kind]], "workspace": (LOWER, UPPER), "trips": TRIPS[kind]}
    pace = {"speed": SPEED, "approach_speed": APPROACH, "ramp": RAMP, "trip_retract": TRIP_RETRACT}
    return Guard(**limits | pace | options)  # type: ignore[arg-type]


def parts(kind: str, values: Joints) -> list[Joints]:
    return [values] if kind == "hand" else [(value,) for value in values]


def follow(guarded: Guard, goal: Joints, count: int = 1, *, where: Joints = FREE, force: Joints = FREE) -> Joints:
    for _ in range(count):
        guarded.follow(goal, where, force, TICK)
    return guarded.held


def inside(place: Joints) -> Joints:
    return tuple(min(max(value, low), high) for value, low, high in zip(place, LOWER, UPPER, strict=True))


wild = st.floats(-1.0, 1.0) | st.sampled_from([1e300, inf, -inf, nan])
pushes = st.floats(-15.0, 15.0) | st.sampled_from([0.0, 20.0, -20.0, 30.0])
events = st.lists(
    st.tuples(st.just("lead"), st.tuples(wild, wild, wild), st.sampled_from([1, 40, 300]))
    | st.tuples(st.sampled_from(["hold", "release", "retreat", "reset", "place"]), st.just(FREE), st.just(3))
    | st.tuples(st.just("push"), st.tuples(pushes, pushes, pushes), st.integers(1, 20)),
    max_size=15,
)


@both
@given(happens=events)
@example(happens=[("lead", (1.0, 1.0, -1.0), 1500)])
@example(happens=[("lead", (1.0, 1.0, -1.0), 300), ("push", (30.0, 0.0, -30.0), 30), ("lead", (0.0, 0.0, 0.0), 40)])
@example(happens=[("lead", (0.01, 0.0, 0.0), 300), ("hold", FREE, 3), ("lead", (0.3, nan, 0.0), 9)])
@examples(60)
def test_in_every_state_commands_are_slow_and_inside_and_nothing_jumps(
    kind: str, happens: list[tuple[str, Joints, int]]
) -> None:
    guarded, force, share = guard(kind, retract=RETRACT), FREE, 0.0
    last = guarded.held
    for event, value, count in happens:
        force = value if event == "push" else force
        change = {
            "release": guarded.release,
            "retreat": partial(guarded.retreat, force, last),
            "reset": guarded.reset,
            "place": partial(guarded.place, (0.1, 0.1, 0.1)),
        }.get(event)
        if change is not None:
            change()
            last = guarded.held
        for _ in range(count):
            overloaded = guarded.is_overloaded(force)
            if overloaded and not guarded.tripped:
                guarded.trip(force, last)
            follows, leads = guarded.arrived, event == "lead" and not overloaded
            out = guarded.follow(value, last, force, TICK) if leads else guarded.hold(TICK)
            assert all(map(isfinite, out))
            assert out == inside(out), "it never leaves where it may be"
            speed = SPEED if follows and leads and all(map(isfinite, value)) else APPROACH
            for before, after in zip(parts(kind, last), parts(kind, out), strict=True):
                assert dist(before, after) <= speed * TICK * (1.0 + 1e-6) + 1e-12
            assert guarded.tripped or not overloaded
            assert guarded.share <= min(1.0, share + TICK / RAMP * (1.0 + 1e-9)), "it fades in"
            if not (guarded.arrived or guarded.touches):
                assert guarded.share <= max(0.0, share - TICK / RAMP) + 1e-9, "and out, where it does not follow"
            assert guarded.clipped == (guarded.arrived and leads and out != value)
            last, share = out, guarded.share


@both
def test_what_is_felt_is_shown_from_the_end_of_the_approach_on(kind: str) -> None:
    guarded, goal = guard(kind), (0.0, 0.0, 0.001)
    assert (guarded.share, guarded.clipped, guarded.arrived, guarded.tripped) == (0, *[False] * 3)
    shown = [guarded.share for _ in range(70) if follow(guarded, goal)]
    assert shown == pytest.approx([*[0.0] * 3, *(min(1.0, 0.02 * tick) for tick in range(1, 68))])
    assert guarded.arrived
    assert follow(guarded, (0.0, 0.0, 0.5))[2] == pytest.approx(0.002)
    assert guarded.clipped
    guarded.release()
    faded = [guarded.share for _ in range(60) if guarded.hold(TICK)]
    assert faded == pytest.approx([max(0.0, 1.0 - 0.02 * tick) for tick in range(1, 61)], abs=1e-12)


@both
@pytest.mark.parametrize("at", [0, 1, 2])
def test_each_axis_has_bounds_of_its_own(kind: str, at: int) -> None:
    guarded = guard(kind)
    for edge in (LOWER[at], UPPER[at]):
        for share, clips in ((1.0, False), (1.1, True)):
            goal = tuple(share * edge * (each == at) for each in range(3))
            assert follow(guarded, goal, 3000)[at] == pytest.approx(edge)
            assert guarded.clipped is clips


@both
@pytest.mark.parametrize("where", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.004), (0.0, 0.0, -0.03)])
def test_a_trip_backs_off_and_ends_once_led_out_and_the_pause_over(kind: str, where: Joints) -> None:
    """From where it is or from what it was commanded: from what is farther out."""
    guarded, force = guard(kind), (0.0, 0.0, 20.0 * (1.0 + 1e-6))
    follow(guarded, FREE)
    assert not guarded.is_overloaded((0.0, 0.0, 20.0 if kind == "hand" else 10.0)), (
        "a reading at the limit is not above"
    )
    assert guarded.is_overloaded(force)
    guarded.trip(force, where)
    assert not guarded.arrived
    end = TRIP_RETRACT + max(0.0, where[2])
    assert follow(guarded, (0.0, 0.0, 0.05)) == pytest.approx((0.0, 0.0, APPROACH * TICK))
    follow(guarded, (0.0, 0.0, 0.05), round(0.9 * TRIP_PAUSE / TICK))
    assert guarded.held == pytest.approx((0.0, 0.0, end))
    assert guarded.tripped, "not before the pause is over"
    follow(guarded, (0.0, 0.0, end - 1e-4), round(0.2 * TRIP_PAUSE / TICK))
    assert guarded.tripped, "not while the hand is in the contact"
    assert follow(guarded, (0.0, 0.0, 0.1))[2] == pytest.approx(end + APPROACH * TICK)
    assert not guarded.tripped


def test_the_axes_that_were_too_strong_back_off_alone() -> None:
    guarded = guard("arm")
    follow(guarded, (0.01, 0.02, 0.03), 200)
    guarded.trip((19.0, -21.0, 11.0), (0.01, 0.0, 0.03))
    assert [guarded.hold(TICK) for _ in range(600)][-1] == pytest.approx((0.01, -TRIP_RETRACT, 0.03 + TRIP_RETRACT))


@both
def test_a_retreat_ends_at_the_edge_and_where_the_robot_is_placed_or_led(kind: str) -> None:
    guarded = guard(kind)
    guarded.trip((-30.0, 0.0, 0.0), (-0.095, 0.0, 0.0))
    assert [guarded.hold(TICK) for _ in range(900)][-1] == pytest.approx((LOWER[0], 0.0, 0.0))
    guarded.trip((30.0, 0.0, 0.0), FREE)
    guarded.place((0.0, 0.0, -0.05))
    assert [guarded.hold(TICK) for _ in range(9)][-1] == (0.0, 0.0, -0.05)
    guarded = guard(kind, retract=0.02)
    guarded.retreat((0.0, 0.5, 0.0), FREE)
    assert guarded.hold(TICK) == pytest.approx((0.0, 0.25e-3, 0.0))
    led = follow(guarded, (0.0, 0.0, 0.05))
    guarded.release()
    assert [guarded.hold(TICK) for _ in range(9)][-1] == led


@both
@pytest.mark.parametrize(("retract", "goes"), [(0.0, -0.01), (0.02, 0.02)])
def test_a_release_holds_or_backs_off(kind: str, retract: float, goes: float) -> None:
    """Whoever holds goes on pressing: the command lies deeper than the robot is."""
    guarded = guard(kind, retract=retract)
    guarded.place((0.0, -0.01, 0.0))
    for force in ((0.0, 3.0, 0.0), FREE):
        guarded.retreat(force, FREE)
        assert [guarded.hold(TICK) for _ in range(200)][-1] == pytest.approx((0.0, goes, 0.0))


@both
def test_outside_its_range_it_holds_until_led(kind: str) -> None:
    guarded = guard(kind)
    guarded.place((0.6, 0.0, 0.4))
    assert guarded.hold(TICK) == (0.6, 0.0, 0.4)
    assert follow(guarded, (0.6, 0.0, 0.4))[0] == pytest.approx(0.6 - APPROACH * TICK)


def test_each_part_presses_with_no_more_than_its_limit_and_ticks_that_it_bounds_are_counted() -> None:
    guarded = guard("arm", presses=[axis(1.0, 10.0), axis(1.0, 20.0), axis(0.5, 5.0)])
    guarded.place((0.0, 0.04, -1.0))
    assert guarded.near((0.5, 0.0, 0.0)) == pytest.approx((0.4, 0.04, -0.1))
    for torque, ticks in ((0.0, 0), (1.5, 1), (1.5, 2), (0.0, 3)):
        guarded.follow((-0.4, 0.04, -1.0), (0.0, 0.04, -1.0), (torque, 0.0, 0.0), TICK)
        assert (guarded.contact_ticks, guarded.touches) == (ticks, torque > 0.0)


@pytest.mark.parametrize(("lower", "upper"), [((1.0, 0.0, 0.0), (0.0,) * 3), ((nan, 0.0, 0.0), (1.0,) * 3)])
def test_a_range_that_is_none_is_refused(lower: Joints, upper: Joints) -> None:
    with pytest.raises(ValueError, match="range"):
        guard("arm", workspace=(lower, upper))
    with pytest.raises(ValueError, match="2 press limits, but 1 of a trip"):
        guard("hand", presses=[tip(), tip()])


@pytest.mark.parametrize("speeds", [(0.0, 1.0), (1.0, -1.0), (nan, 1.0), (1.0, nan)])
def test_a_speed_that_is_none_is_refused(speeds: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="positive"):
        Approach((0.0,), 1, *speeds)
    with pytest.raises(ValueError, match="2 axes are no parts of 3"):
        Approach((0.0, 0.0), 3, 1.0, 1.0)
