from collections.abc import Callable
from itertools import pairwise
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.protocol.retransmission import (
    GROWTH,
    GROWTH_SLACK,
    JITTER_SLACK,
    LEAST_EARLY_PER_S,
    LONGEST_HOLD,
    LONGEST_PACE,
    MOST_COPIES,
    MOST_EARLY_PER_S,
    RAISE,
    RESIDUAL,
    SHORTEST_PACE,
    Allowance,
    OutgoingStream,
    copies_needed,
    lost_again,
)
from weberlink.protocol.wire import UpdateLayout
from weberlink.update import Update, UpdateForm

LAYOUT = UpdateLayout([UpdateForm((3,), None)])
UPDATE = Update(0, 0, (1, 2, 3))


def stream(allowance: Allowance | None = None) -> OutgoingStream:
    return OutgoingStream(LAYOUT, allowance or Allowance())


def acknowledge(stream: OutgoingStream, ack: int) -> bool:
    return stream.acknowledge(ack, ack, is_newest=True)


def test_a_repeat_is_due_until_the_update_or_a_repeat_of_it_is_acknowledged() -> None:
    retransmission = stream()
    assert retransmission.due_at(0.01, 0.1) == inf
    retransmission.begin(UPDATE, 6, 0.9)
    retransmission.begin(UPDATE, 7 + 2**16, 1.0)
    assert retransmission.due_at(0.01, 0.1) == 1.1
    retransmission.is_missed = True  # evidence of a loss
    assert retransmission.due_at(0.01, 0.1) == 1.01
    assert retransmission.due_at(0.0, 0.1) == 1.0 + SHORTEST_PACE
    retransmission.repeated(9 + 2**16, 1.1)
    assert retransmission.is_pending
    assert not acknowledge(retransmission, 6)
    assert acknowledge(retransmission, 7)
    assert retransmission.due_at(0.01, 0.1) == inf


STEPS = st.lists(st.tuples(st.floats(0.0, 0.05), st.sampled_from(["update", "acknowledged", "missed", "nothing"])))


@given(STEPS, st.integers(0, MOST_COPIES), st.floats(0.0, 0.2))
def test_repeats_keep_to_their_bound_over_any_pattern(steps: list[tuple[float, str]], copies: int, rtt: float) -> None:
    """Whatever is lost or acknowledged, whenever updates come, however late the owner looks at the clock."""
    retransmission = stream()
    now, number, begun_at, repeats = 0.0, 0, 0.0, 0
    for wait, what in steps:
        now += wait
        if what == "update":
            number, begun_at, repeats = number + 1, now, 0
            retransmission.begin(UPDATE, number, now, copies)
        elif what == "acknowledged":
            acknowledge(retransmission, number)
        elif what == "missed":
            retransmission.is_missed = True
        while retransmission.due_at(rtt, 0.0) <= now:
            assert now >= retransmission.sent_at + max(SHORTEST_PACE, 0.0 if copies else rtt) - 1e-12
            number, repeats = number + 1, repeats + 1
            retransmission.repeated(number, now)
        assert repeats <= 13 + (now - begun_at) / LONGEST_PACE


def test_streams_that_have_overdrawn_their_allowance_repeat_nothing_early() -> None:
    """Each took what was left before the other had paid."""
    allowance = Allowance()
    streams = [stream(allowance), stream(allowance)]
    for each in streams:
        each.begin(UPDATE, 1, 0.0, copies=6)
    repeats = 0
    for each in streams:
        while each.due_at(0.0, inf) < inf:
            repeats += 1
            each.repeated(1 + repeats, 0.005 * repeats)
    assert repeats == 2 * LEAST_EARLY_PER_S and allowance.left(0.06) == 0
    for each in streams:
        each.begin(UPDATE, 20, 0.06, copies=6)
        assert each.due_at(0.0, inf) == inf


REPORTS = st.lists(st.tuples(st.floats(0.0, 3.0), st.integers(-5, 400)), max_size=60)


@given(STEPS, st.integers(0, MOST_COPIES), REPORTS)
def test_early_repeats_are_bounded_by_their_allowance(
    steps: list[tuple[float, str]], copies: int, reports: list[tuple[float, int]]
) -> None:
    """Of all streams together, whatever the peer reports."""
    allowance = Allowance()
    streams = [stream(allowance), stream(allowance)]
    now, number, repeats = 0.0, 0, 0
    for place, (wait, what) in enumerate(steps):
        now += wait
        if place < len(reports):
            allowance.adapt(reports[place][1], 60 * place, 0.0, now)
            assert LEAST_EARLY_PER_S <= allowance.rate <= MOST_EARLY_PER_S
            assert allowance.left(now) <= allowance.rate
        if what == "update":
            number += 1
            streams[place % 2].begin(UPDATE, number, now, copies)
        for each in streams:
            while each.due_at(0.0, inf) <= now:  # without evidence, and without end of patience
                number, repeats = number + 1, repeats + 1
                each.repeated(number, now)
    assert repeats <= MOST_EARLY_PER_S * (1.0 + now) + 1e-9


def rates(
    loss: Callable[[int, float], float], seconds: int, late: Callable[[float], float] = lambda rate: 0.0
) -> list[float]:
    """Rates of an allowance on a link with that loss by second and rate, and that delay in queues by rate [s].

    There are 200 datagrams and one report a second.
    """
    allowance, found = Allowance(), []
    for second in range(seconds):
        rate = allowance.rate
        allowance.adapt(round(200 * loss(second, rate)), 200 * second, late(rate), float(second))
        found.append(allowance.rate)
    return found


@given(st.floats(RESIDUAL + 0.01, 1.0))
def test_allowance_is_raised_where_the_loss_does_not_grow(loss: float) -> None:
    assert set(rates(lambda second, rate: 0.0, 100)) == {LEAST_EARLY_PER_S}
    assert rates(lambda second, rate: loss, 10)[-1] == MOST_EARLY_PER_S


@given(st.floats(RESIDUAL + 0.01, 0.2), st.floats(0.02, 0.3))
def test_allowance_stays_low_where_the_loss_grows_with_it(alone: float, growth: float) -> None:
    """The attempts become rare, and each is short."""
    together = GROWTH * alone + GROWTH_SLACK + growth
    found = rates(lambda second, rate: together if rate > LEAST_EARLY_PER_S else alone, 1000)
    high = [rate for rate in found if rate > LEAST_EARLY_PER_S]
    assert 0 < len(high) <= 1000.0 / LONGEST_HOLD + 8
    attempts = [second for second, rate in enumerate(found) if rate > LEAST_EARLY_PER_S]
    pauses = [later - earlier for earlier, later in pairwise(attempts) if later - earlier > 1]
    assert all(later <= 2 * earlier + 2 for earlier, later in pairwise(pauses))
    assert max(high) <= RAISE * LEAST_EARLY_PER_S


@given(st.floats(0.0, 0.05), st.floats(0.001, 0.2))
def test_allowance_stays_low_where_queues_grow_with_it(alone: float, growth: float) -> None:
    together = GROWTH * alone + JITTER_SLACK + growth
    found = rates(lambda second, rate: 0.1, 1000, lambda rate: together if rate > LEAST_EARLY_PER_S else alone)
    assert 0 < sum(rate > LEAST_EARLY_PER_S for rate in found) <= 1000.0 / LONGEST_HOLD + 8


def test_allowance_recovers_when_the_loss_itself_has_changed() -> None:
    found = rates(lambda second, rate: 0.03 if second < 20 else 0.3, 40)
    assert found[19] == MOST_EARLY_PER_S
    assert LEAST_EARLY_PER_S in found[20:]
    assert found[39] == MOST_EARLY_PER_S


def test_early_repeats_end_with_acknowledgement_or_newer_update() -> None:
    retransmission = stream()
    retransmission.begin(UPDATE, 7, 1.0, copies=2)
    assert retransmission.due_at(0.3, 9.0) == 1.0 + SHORTEST_PACE
    retransmission.repeated(8, 1.005)
    assert retransmission.due_at(0.3, 9.0) == 1.005 + SHORTEST_PACE
    retransmission.repeated(9, 1.01)
    assert retransmission.due_at(0.3, 9.0) > 9.0
    retransmission.begin(UPDATE, 10, 2.0, copies=1)
    assert acknowledge(retransmission, 10)
    assert retransmission.due_at(0.3, 9.0) == inf
    retransmission.begin(UPDATE, 11, 2.1)
    assert retransmission.due_at(0.3, 9.0) > 9.0


@given(st.floats(0.0, 1.0), st.just(0.0) | st.floats(1.0, 50.0))
def test_copies_leave_little_lost(loss: float, burst: float) -> None:
    copies, again = copies_needed(loss, burst), lost_again(loss, burst)
    assert 0 <= copies <= MOST_COPIES
    assert lost_again(loss, 0.0) == lost_again(loss, 1.0) == loss <= again <= 1.0
    assert copies == MOST_COPIES or loss * again**copies <= RESIDUAL * (1.0 + 1e-6)
    assert copies == 0 or loss * again ** (copies - 1) > RESIDUAL * (1.0 - 1e-6)


def test_an_update_is_late_slower_with_each_repeat_and_forgotten_only_by_the_newest_datagram() -> None:
    sent = stream()
    sent.begin(UPDATE, 5, 0.0)
    assert not sent.is_lost(0.1, 0.1)
    assert sent.acknowledge(3, None, is_newest=False), "an old datagram without one says nothing"
    assert not sent.acknowledge(4, None, is_newest=True)
    for repeats, pace in ((1, 0.01), (2, 0.01), (3, 0.02), (4, 0.04)):
        sent.repeated(5 + repeats, 0.0)
        sent.is_missed = True
        assert sent.due_at(0.01, 1.0) == pytest.approx(pace), repeats
    assert sent.unambiguous(2**16) == 2**16 + 1 and sent.unambiguous(2**16 + 7) == 2**16 + 7
    assert sent.acknowledge(10, 7, is_newest=True)
    assert sent.unambiguous(2**16 + 7) == 2**16 + 8 and sent.unambiguous(2**16) == 2**16 + 1
    sent.acknowledge(9, 0, is_newest=False)
    assert not sent.is_forgotten
    sent.acknowledge(11, 0, is_newest=True)
    assert sent.is_forgotten
    assert sent.is_lost(0.2, 0.1) and not sent.is_lost(0.3, 0.1), "once"
    sent.begin(UPDATE, 12, 0.5)
    assert sent.is_lost(0.61, 0.1) and not sent.is_pending, "not arrived within the limit"
