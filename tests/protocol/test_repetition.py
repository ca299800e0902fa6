from math import inf

from hypothesis import given
from hypothesis import strategies as st

from protocol.repetition import LONGEST_PACE, SHORTEST_PACE, Repetition


def test_nothing_is_due_without_an_update_or_once_it_is_acknowledged() -> None:
    repetition = Repetition()
    assert repetition.due_at(0.01, 0.1) == inf
    repetition.begin(7, 1.0)
    assert repetition.is_pending
    assert not repetition.acknowledge(6)
    assert repetition.acknowledge(7)
    assert repetition.due_at(0.01, 0.1) == inf


def test_evidence_is_worth_more_than_waiting() -> None:
    repetition = Repetition()
    repetition.begin(7, 1.0)
    assert repetition.due_at(0.01, 0.1) == 1.1
    repetition.miss()
    assert repetition.due_at(0.01, 0.1) == 1.01
    assert repetition.due_at(0.0, 0.1) == 1.0 + SHORTEST_PACE


def test_any_transmission_of_the_state_acknowledges_it_and_no_older_one() -> None:
    repetition = Repetition()
    repetition.begin(6, 0.9)
    repetition.begin(7 + 2**16, 1.0)
    repetition.repeated(9 + 2**16, 1.1)
    assert not repetition.acknowledge(6)
    assert repetition.acknowledge(7)


@given(st.floats(0.0, 1.0), st.floats(0.01, 30.0))
def test_the_stated_bound_on_repeats(rtt: float, duration: float) -> None:
    repetition = Repetition()
    repetition.begin(0, 0.0)
    now, count = 0.0, 0
    while True:
        repetition.miss()
        due = repetition.due_at(rtt, 0.0)
        assert due - now >= max(SHORTEST_PACE, rtt) - 1e-12
        if due > duration:
            break
        now, count = due, count + 1
        repetition.repeated(count, now)
    assert count <= 7 + duration / LONGEST_PACE
