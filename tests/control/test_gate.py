"""Steps towards what is wanted, part by part: never faster than the rate, and slowly until it is there."""

from math import dist, hypot, inf, nan

import pytest
from hypothesis import given, strategies as st

from weberlink.control.gate import Approach, toward
from weberlink.geometry.joints import Joints

TICK = 1e-3
RATES, APPROACHES = (1000.0, 50.0, inf), (100.0, 5.0, 20.0)
values = st.tuples(*[st.floats(-20.0, 20.0)] * 9)


@given(st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=4), st.data(), st.floats(0.0, 5.0))
def test_a_step_goes_straight_to_the_goal_and_no_further(goal: list[float], data: st.DataObject, way: float) -> None:
    start = data.draw(st.tuples(*[st.floats(-20.0, 20.0)] * len(goal)))
    moved, apart = toward(start, tuple(goal), way), dist(start, goal)
    assert dist(start, moved) == pytest.approx(min(way, apart))
    assert dist(moved, goal) == pytest.approx(max(0.0, apart - way), abs=1e-9)
    assert moved == tuple(goal) or apart > way


@pytest.mark.parametrize("width", [1, 3])
@given(st.lists(st.tuples(values, st.sampled_from([0.0, TICK, 2.0 * TICK])), max_size=60), st.booleans(), st.booleans())
def test_no_part_changes_faster_than_it_may(
    width: int, course: list[tuple[Joints, float]], grows: bool, follows: bool
) -> None:
    approach = Approach((0.0,) * 3 * width, width, RATES, APPROACHES, grows=grows)
    approach.arrived, before = follows, approach.held
    for nine, step in course:
        goal, arrived = nine[: 3 * width], approach.arrived
        after = approach.advance(goal, step)
        for part, (rate, slow) in enumerate(zip(RATES, APPROACHES, strict=True)):
            here, there = (each[part * width : (part + 1) * width] for each in (before, after))
            assert not dist(here, there) > rate * step * (1.0 + 1e-9) + 1e-12
            if not arrived:
                way = hypot(*there) - hypot(*here) if grows else dist(here, there)
                assert way <= slow * step * (1.0 + 1e-9) + 1e-12
        assert approach.arrived == (arrived or after == goal)
        assert approach.held_back == (after != goal) or not (arrived or approach.held_back)
        before = after


def test_a_force_falls_at_its_rate_and_grows_in_the_approach() -> None:
    approach = Approach((0.0,), 1, (1000.0,), (100.0,), grows=True)
    assert [approach.advance((5.0,), TICK)[0] for _ in range(3)] == pytest.approx([0.1, 0.2, 0.3])
    assert [approach.advance((-5.0,), TICK)[0] for _ in range(2)] == pytest.approx([-0.4, -0.5])
    assert not approach.held_back, "the approach is no slew limit"
    assert [approach.advance((0.05,), TICK)[0] for _ in range(2)] == [0.05, 0.05]
    assert approach.advance((5.0,), TICK)[0] == pytest.approx(1.05), "it follows"
    assert approach.held_back


@pytest.mark.parametrize("rates", [(0.0, 1.0), (1.0, -1.0), (nan, 1.0), (1.0, nan)])
def test_a_rate_that_is_none_is_refused(rates: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="positive"):
        Approach((0.0,), 1, rates[:1], rates[1:])
    with pytest.raises(ValueError, match="2 axes, but 1 parts of 3"):
        Approach((0.0, 0.0), 3, (1.0,), (1.0,))
