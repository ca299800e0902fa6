from math import inf

from hypothesis import given
from hypothesis import strategies as st

from weberlink.protocol.retransmission import (
    EARLY_PER_S,
    LONGEST_PACE,
    LOSSY,
    MOST_COPIES,
    RESIDUAL,
    SHORTEST_PACE,
    Retransmission,
    copies_needed,
)


def test_nothing_is_due_without_a_pending_update() -> None:
    retransmission = Retransmission()
    assert retransmission.due_at(0.01, 0.1) == inf
    retransmission.begin(7, 1.0)
    assert retransmission.is_pending
    assert not retransmission.acknowledge(6)
    assert retransmission.acknowledge(7)
    assert retransmission.due_at(0.01, 0.1) == inf


def test_evidence_brings_the_repeat_forward() -> None:
    retransmission = Retransmission()
    retransmission.begin(7, 1.0)
    assert retransmission.due_at(0.01, 0.1) == 1.1
    retransmission.miss()
    assert retransmission.due_at(0.01, 0.1) == 1.01
    assert retransmission.due_at(0.0, 0.1) == 1.0 + SHORTEST_PACE


def test_acknowledgement_of_any_repeat_counts_but_no_older_one() -> None:
    retransmission = Retransmission()
    retransmission.begin(6, 0.9)
    retransmission.begin(7 + 2**16, 1.0)
    retransmission.repeated(9 + 2**16, 1.1)
    assert not retransmission.acknowledge(6)
    assert retransmission.acknowledge(7)


@given(st.floats(0.0, 1.0), st.floats(0.01, 30.0))
def test_repeats_keep_to_their_bound_without_acknowledgements(rtt: float, duration: float) -> None:
    retransmission = Retransmission()
    retransmission.begin(0, 0.0)
    now, count = 0.0, 0
    while True:
        retransmission.miss()
        due = retransmission.due_at(rtt, 0.0)
        assert due - now >= max(SHORTEST_PACE, rtt) - 1e-12
        if due > duration:
            break
        now, count = due, count + 1
        retransmission.repeated(count, now)
    assert count <= 7 + duration / LONGEST_PACE


STEPS = st.lists(st.tuples(st.floats(0.0, 0.05), st.sampled_from(["update", "acknowledged", "missed", "nothing"])))


@given(STEPS, st.integers(0, MOST_COPIES), st.floats(0.0, 0.2))
def test_repeats_keep_to_their_bound_over_any_pattern(steps: list[tuple[float, str]], copies: int, rtt: float) -> None:
    """Whatever is lost or acknowledged, whenever updates come, however late the owner looks at the clock."""
    retransmission = Retransmission()
    now, number, begun_at, repeats = 0.0, 0, 0.0, 0
    for wait, what in steps:
        now += wait
        if what == "update":
            number, begun_at, repeats = number + 1, now, 0
            retransmission.begin(number, now, copies)
        elif what == "acknowledged":
            retransmission.acknowledge(number)
        elif what == "missed":
            retransmission.miss()
        while retransmission.due_at(rtt, 0.0) <= now:
            assert now >= retransmission.sent_at + SHORTEST_PACE
            number, repeats = number + 1, repeats + 1
            retransmission.repeated(number, now)
        assert repeats <= 10 + (now - begun_at) / LONGEST_PACE


@given(STEPS, st.integers(0, MOST_COPIES))
def test_early_repeats_are_bounded_by_their_allowance(steps: list[tuple[float, str]], copies: int) -> None:
    retransmission = Retransmission()
    now, number, repeats = 0.0, 0, 0
    for wait, what in steps:
        now += wait
        if what == "update":
            number += 1
            retransmission.begin(number, now, copies)
        while retransmission.due_at(0.0, inf) <= now:  # without evidence, and without end of patience
            number, repeats = number + 1, repeats + 1
            retransmission.repeated(number, now)
    assert repeats <= EARLY_PER_S * (1.0 + now) + 1e-9


def test_early_repeats_end_with_acknowledgement_or_newer_update() -> None:
    retransmission = Retransmission()
    retransmission.begin(7, 1.0, copies=2)
    assert retransmission.due_at(0.3, 9.0) == 1.0 + SHORTEST_PACE
    retransmission.repeated(8, 1.005)
    assert retransmission.due_at(0.3, 9.0) == 1.005 + SHORTEST_PACE
    retransmission.repeated(9, 1.01)
    assert retransmission.due_at(0.3, 9.0) > 9.0
    retransmission.begin(10, 2.0, copies=1)
    assert retransmission.acknowledge(10)
    assert retransmission.due_at(0.3, 9.0) == inf
    retransmission.begin(11, 2.1)
    assert retransmission.due_at(0.3, 9.0) > 9.0


@given(st.floats(0.0, 1.0))
def test_copies_leave_little_lost(loss: float) -> None:
    copies = copies_needed(loss)
    assert 0 <= copies <= MOST_COPIES
    assert loss <= LOSSY or copies == MOST_COPIES or loss ** (1 + copies) <= RESIDUAL * (1.0 + 1e-6)
    assert copies == 0 or loss**copies > RESIDUAL * (1.0 - 1e-6)
