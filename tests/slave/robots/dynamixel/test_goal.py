"""Commands that come, stop and come back: no jump, and no pressing without anybody there."""

from itertools import pairwise

from weberlink.geometry.vector import Vector, distance
from weberlink.slave.robots.dynamixel.impedance import TipGoal

HERE: Vector = (0.2, 0.0, 0.1)
THERE: Vector = (0.2, 0.0, 0.12)
PERIOD = 0.004


def run(goal: TipGoal, command: Vector | None, tip: Vector, begin: float, cycles: int) -> list[Vector]:
    return [goal.next(command, tip, begin + (number + 1) * PERIOD) for number in range(cycles)]


def test_without_a_command_it_stays() -> None:
    goal = TipGoal(0.1, 0.1)
    goal.place(HERE, 5.0)
    assert set(run(goal, None, THERE, 5.0, 100)) == {HERE}
    assert goal.holding


def test_it_approaches_the_first_command_at_a_limited_speed_and_then_follows_at_once() -> None:
    goal = TipGoal(0.1, 0.1)
    goal.place(HERE, 5.0)
    points = run(goal, THERE, HERE, 5.0, 60)
    assert not goal.holding
    for a, b in pairwise([HERE, *points]):
        assert distance(a, b) <= 0.1 * PERIOD + 1e-12
    assert points[40] != THERE
    assert points[-1] == THERE
    assert goal.next(HERE, HERE, 6.0) == HERE


def test_a_gap_shorter_than_the_patience_changes_nothing() -> None:
    goal = TipGoal(0.1, 0.1)
    goal.place(HERE, 5.0)
    run(goal, THERE, HERE, 5.0, 60)
    assert set(run(goal, None, HERE, 5.24, 24)) == {THERE}


def test_after_it_the_tip_is_held_where_it_is_and_comes_back_without_a_jump() -> None:
    goal = TipGoal(0.1, 0.1)
    goal.place(HERE, 5.0)
    run(goal, THERE, HERE, 5.0, 60)
    pressed_at = (0.2, 0.0, 0.113)
    run(goal, None, pressed_at, 5.24, 30)
    assert goal.holding
    assert goal.next(None, (0.21, 0.0, 0.1), 5.4) == pressed_at, "where it was then, not where it drifts to"
    first = goal.next(THERE, pressed_at, 5.404)
    assert 0.0 < distance(first, pressed_at) <= 0.1 * PERIOD + 1e-12
