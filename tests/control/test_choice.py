"""The choice of a scheme by delay: hysteresis, dwell time, and passivity control of an active loop."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.control.auto import CALM, DWELL, FALLING, MMT, NONE, RISING, TDPA, SchemeChoice
from weberlink.control.contract import LinkQuality

TICK = 0.01
LEVEL = 0.05
delays = st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, *RISING, *FALLING, 1.0]))
courses = st.lists(st.tuples(delays, st.floats(0.0, 0.3)), max_size=300)


def follow(choice: SchemeChoice, delay: float | None, seconds: float, jitter: float = 0.0, tank: float = LEVEL) -> int:
    for _ in range(round(seconds / TICK)):
        choice.follow(LinkQuality(delay, jitter), tank, TICK)
    return choice.active


@pytest.mark.parametrize(("delay", "scheme"), [(0.001, NONE), (0.02, TDPA), (0.1, TDPA), (0.7, MMT)])
@pytest.mark.parametrize("first", [0.001, 0.1, 0.7])
def test_each_delay_ends_up_in_its_scheme_from_anywhere(first: float, delay: float, scheme: int) -> None:
    choice = SchemeChoice(LEVEL)
    follow(choice, first, 3.0)
    assert follow(choice, delay, 3.0) == scheme


def test_it_starts_with_what_is_passive_at_any_delay_and_stays_there_while_none_is_known() -> None:
    choice = SchemeChoice(LEVEL)
    assert choice.active == TDPA
    assert follow(choice, None, 10.0) == TDPA


def test_jitter_counts_as_delay() -> None:
    assert follow(SchemeChoice(LEVEL), 0.15, 3.0, jitter=0.1) == MMT


@given(courses)
def test_changes_are_to_a_neighbour_and_at_least_a_dwell_apart(course: list[tuple[float, float]]) -> None:
    choice, now, changes = SchemeChoice(LEVEL), 0.0, [(0.0, TDPA)]
    for delay, elapsed in course:
        now += elapsed
        active = choice.follow(LinkQuality(delay, 0.0), 0.0, elapsed)
        if active != changes[-1][1]:
            changes.append((now, active))
    for (before, left), (at, taken) in pairwise(changes):
        assert abs(taken - left) == 1
        assert at - before >= DWELL - 1e-9
    assert len(changes) - 1 <= now / DWELL + 1e-9


@given(
    st.lists(
        st.tuples(delays, st.floats(0.0, 0.3), st.sampled_from([0.0, -0.5 * LEVEL, -1.1 * LEVEL])),
        max_size=300,
    )
)
def test_a_debt_without_control_calls_for_control_at_once_and_for_a_while(
    course: list[tuple[float, float, float]],
) -> None:
    """With any delays and debts, there are few changes: one more per `CALM`."""
    choice, now, changes, called_at = SchemeChoice(LEVEL), 0.0, 0, -CALM
    for delay, elapsed, tank in course:
        now += elapsed
        before = choice.active
        after = choice.follow(LinkQuality(delay, 0.0), tank, elapsed)
        if before == NONE and tank < -LEVEL:
            assert after == TDPA
            called_at = now
        if after == NONE != before:
            assert now - called_at >= CALM - 1e-9
        changes += after != before
    assert changes <= now / DWELL + now / CALM + 1.0 + 1e-9


def test_a_loop_that_was_active_stays_under_control_until_it_has_been_calm() -> None:
    choice = SchemeChoice(LEVEL)
    assert follow(choice, 0.001, 3.0) == NONE
    assert follow(choice, 0.001, TICK, tank=-1.1 * LEVEL) == TDPA
    assert follow(choice, 0.001, CALM - 2.0 * TICK) == TDPA
    assert follow(choice, 0.001, DWELL + 4.0 * TICK) == NONE


@pytest.mark.parametrize("threshold", [0, 1])
@pytest.mark.parametrize("extreme", [0.0, 1.0])
def test_a_delay_between_the_thresholds_changes_nothing(threshold: int, extreme: float) -> None:
    """Neither the scheme below the threshold nor the one above it."""
    between = 0.5 * (RISING[threshold] + FALLING[threshold])
    choice = SchemeChoice(LEVEL)
    beside = {0.0: threshold, 1.0: threshold + 1}[extreme]
    for _ in range(2000):
        if choice.active == beside:
            break
        choice.follow(LinkQuality(extreme, 0.0), 0.0, TICK)
    assert choice.active == beside
    assert follow(choice, between, 10.0) == beside
