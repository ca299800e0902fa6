"""The choice of a scheme by delay: hysteresis, dwell time, and passivity control of an active loop."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.control.teleoperation import Quality
from weberlink.control.auto import CALM, DWELL, FALLING, MMT, NONE, RISING, TDPA, SchemeChoice

TICK = 0.01
delays = st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, *RISING, *FALLING, 1.0]))
elapsed_times = st.floats(0.0, 0.3)


class Chooser:
    """A choice that is followed at once, or after some ticks."""

    def __init__(self, lead: int = 0) -> None:
        self.choice = SchemeChoice()
        self.active = TDPA
        self._lead, self._since = lead, 0

    def tick(
        self, delay: float | None, elapsed: float, *, jitter: float = 0.0, touches: bool = False, in_debt: bool = False
    ) -> int:
        wanted = self.choice.follow(self.active, Quality(delay, jitter), elapsed, touches=touches, in_debt=in_debt)
        self._since = self._since + 1 if wanted != self.active else 0
        if self._since > self._lead:
            self.active, self._since = wanted, 0
        return wanted

    def follow(self, delay: float | None, seconds: float, **conditions: float) -> int:
        for _ in range(round(seconds / TICK)):
            self.tick(delay, TICK, **conditions)  # type: ignore[arg-type]
        return self.active


@pytest.mark.parametrize("lead", [0, 10])
@pytest.mark.parametrize(("delay", "scheme"), [(0.001, NONE), (0.02, TDPA), (0.05, TDPA), (0.7, MMT)])
@pytest.mark.parametrize("first", [0.001, 0.03, 0.7])
def test_each_delay_ends_up_in_its_scheme_from_anywhere(first: float, delay: float, scheme: int, lead: int) -> None:
    chooser = Chooser(lead)
    chooser.follow(first, 3.0)
    assert chooser.follow(delay, 3.0) == scheme


def test_it_starts_with_what_is_passive_at_any_delay_and_stays_there_while_none_is_known() -> None:
    chooser = Chooser()
    assert chooser.active == TDPA
    assert chooser.follow(None, 10.0) == TDPA


def test_jitter_counts_as_delay() -> None:
    assert Chooser().follow(0.06, 3.0, jitter=0.04) == MMT


@given(st.lists(st.tuples(delays, elapsed_times), max_size=300))
def test_changes_are_to_a_neighbour_and_at_least_a_dwell_apart(course: list[tuple[float, float]]) -> None:
    chooser, now, changes = Chooser(), 0.0, [(0.0, TDPA)]
    for delay, elapsed in course:
        now += elapsed
        chooser.tick(delay, elapsed)
        if chooser.active != changes[-1][1]:
            changes.append((now, chooser.active))
    for (before, left), (at, taken) in pairwise(changes):
        assert abs(taken - left) == 1
        assert at - before >= DWELL - 1e-9
    assert len(changes) - 1 <= now / DWELL + 1e-9


@given(st.lists(st.tuples(delays, elapsed_times, st.booleans(), st.booleans()), max_size=300))
def test_an_active_loop_calls_for_control_at_once_and_for_a_while(
    course: list[tuple[float, float, bool, bool]],
) -> None:
    """With any delays, contacts and debts, there are few changes: one more per `CALM`."""
    chooser, now, changes, called_at = Chooser(), 0.0, 0, -CALM
    for delay, elapsed, touches, in_debt in course:
        now += elapsed
        before = chooser.active
        chooser.tick(delay, elapsed, touches=touches, in_debt=in_debt)
        if before == NONE and in_debt:
            assert chooser.active == TDPA
            called_at = now
        if chooser.active == NONE != before:
            assert now - called_at >= CALM - 1e-9
            assert not touches
        changes += chooser.active != before
    assert changes <= now / DWELL + now / CALM + 1.0 + 1e-9


def test_the_call_for_control_lasts_until_it_is_heard() -> None:
    chooser = Chooser(lead=20)
    assert chooser.follow(0.001, 3.0) == NONE
    assert chooser.tick(0.001, TICK, in_debt=True) == TDPA
    for _ in range(20):
        assert chooser.active == NONE
        assert chooser.tick(0.001, TICK) == TDPA
    assert chooser.active == TDPA


def test_a_loop_that_was_active_stays_under_control_until_it_has_been_calm() -> None:
    chooser = Chooser()
    assert chooser.follow(0.001, 3.0) == NONE
    assert chooser.follow(0.001, TICK, in_debt=True) == TDPA
    assert chooser.follow(0.001, CALM - 2.0 * TICK) == TDPA
    assert chooser.follow(0.001, DWELL + 4.0 * TICK) == NONE


def test_control_is_not_given_up_in_contact() -> None:
    chooser = Chooser()
    assert chooser.follow(0.001, 10.0, touches=True) == TDPA
    assert chooser.follow(0.001, TICK) == NONE
    assert chooser.follow(0.03, 3.0, touches=True) == TDPA, "but taken up"


@pytest.mark.parametrize("delay", [None, 0.001, 0.03, 0.7])
@pytest.mark.parametrize("first", [0.001, 0.7])
def test_after_a_silence_the_scheme_that_is_passive_at_any_delay_comes_first(first: float, delay: float | None) -> None:
    chooser = Chooser(lead=5)
    assert chooser.follow(first, 3.0) != TDPA
    chooser.choice.fall_back()
    assert chooser.tick(delay, TICK) == TDPA
    assert chooser.follow(delay, 0.5 * DWELL) == TDPA
    assert chooser.follow(first, 3.0) != TDPA, "and then the delay decides again"


@pytest.mark.parametrize("threshold", [0, 1])
@pytest.mark.parametrize("extreme", [0.0, 1.0])
def test_a_delay_between_the_thresholds_changes_nothing(threshold: int, extreme: float) -> None:
    """Neither the scheme below the threshold nor the one above it."""
    between = 0.5 * (RISING[threshold] + FALLING[threshold])
    chooser = Chooser()
    beside = {0.0: threshold, 1.0: threshold + 1}[extreme]
    for _ in range(2000):
        if chooser.active == beside:
            break
        chooser.tick(extreme, TICK)
    assert chooser.active == beside
    assert chooser.follow(between, 10.0) == beside
