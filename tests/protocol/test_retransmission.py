"""The newest update of a stream: when it is sent again, and how often."""

from collections.abc import Callable
from itertools import pairwise
from math import inf

import pytest
from hypothesis import given, strategies as st

from weberlink.protocol.liveness import Liveness
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
    URGENT_PACE,
    Allowance,
    OutgoingStream,
    copies_needed,
    lost_again,
)
from weberlink.protocol.wire import UpdateLayout
from weberlink.update import Update, UpdateForm

LAYOUT = UpdateLayout([UpdateForm((3,), None)])
UPDATE = Update(0, 0, (1, 2, 3))
SILENCE = 0.1


def stream(allowance: Allowance | None = None, round_trip: float = inf) -> OutgoingStream:
    """That of an end with this round trip; with an infinite one nothing is urgent."""
    end = Liveness(0.0, SILENCE, 0.0, 0.0)
    end.round_trip = round_trip
    made = OutgoingStream(LAYOUT, allowance or Allowance(), end)
    made.update = UPDATE
    return made


def acknowledge(stream: OutgoingStream, ack: int) -> bool:
    return stream.acknowledge(ack, ack, is_newest=True)


def test_a_repeat_is_due_until_the_update_or_a_repeat_of_it_is_acknowledged() -> None:
    sent = stream()
    assert sent.due_at(0.01, 0.1) == inf
    sent.begin(6, 0.9)
    sent.begin(7 + 2**16, 1.0)
    assert sent.due_at(0.01, 0.1) == 1.1
    sent.is_missed = True  # evidence of a loss
    assert (sent.due_at(0.01, 0.1), sent.due_at(0.0, 0.1)) == (1.01, 1.0 + SHORTEST_PACE)
    sent.repeated(9 + 2**16, 1.1)
    assert not acknowledge(sent, 6) and sent.is_pending
    assert acknowledge(sent, 7)
    assert sent.due_at(0.01, 0.1) == inf
    sent.begin(20, 2.0, copies=1)  # early, without evidence
    assert sent.due_at(0.3, 9.0) == 2.0 + SHORTEST_PACE
    sent.repeated(21, 2.005)
    assert sent.due_at(0.3, 9.0) > 9.0


def test_an_update_is_lost_slower_with_each_repeat_and_forgotten_only_by_the_newest_datagram() -> None:
    sent = stream()
    sent.begin(5, 0.0)
    assert not sent.is_lost(0.1)
    assert sent.acknowledge(3, None, is_newest=False), "an old datagram without one says nothing"
    assert not sent.acknowledge(4, None, is_newest=True)
    for repeats, pace in ((1, 0.01), (2, 0.01), (3, 0.02), (4, 0.04)):
        sent.repeated(5 + repeats, 0.0)
        sent.is_missed = True
        assert sent.due_at(0.01, 1.0) == pytest.approx(pace), repeats
    assert sent.acknowledge(10, 7, is_newest=True)
    sent.acknowledge(9, 0, is_newest=False)
    assert not sent.is_forgotten
    sent.acknowledge(11, 0, is_newest=True)
    assert sent.is_lost(0.2) and not sent.is_lost(0.3), "once"
    sent.begin(12, 0.5)
    assert sent.is_lost(0.61) and not sent.is_pending, "not arrived within the limit"


def test_what_the_peer_lacks_is_as_old_as_the_first_update_after_the_one_that_it_holds() -> None:
    sent = stream()
    first = 2**16 - 5
    for index in range(10):
        sent.begin(first + 2 * index, 0.02 * index)
    sent.repeated(first + 19, 0.19)
    assert (sent.unheld_since, sent.is_held) == (0.0, False)
    sent.acknowledge(1, first + 7 & 0xFFFF, is_newest=True)  # what the fourth one left in is not known: a repeat of it
    assert (sent.unheld_since, sent.is_held) == (pytest.approx(0.08), True)
    sent.acknowledge(2, None, is_newest=True)
    sent.acknowledge(3, first + 7 & 0xFFFF, is_newest=True)
    assert sent.unheld_since == pytest.approx(0.08)
    sent.acknowledge(4, first + 19 & 0xFFFF, is_newest=True)
    assert sent.unheld_since == inf and not sent.is_pending
    sent.begin(first + 2**16 + 18, 0.3)
    sent.repeated(first + 2**16 + 20, 0.301)
    for number, ack in ((5, None), (6, first + 19 & 0xFFFF)):
        sent.acknowledge(number, ack, is_newest=True)
        assert sent.unheld_since == 0.3, "one that was acknowledged 2^16 numbers ago says nothing"
    sent.begin(first + 2**16 + 21, 0.302)
    sent.acknowledge(7, first & 0xFFFF, is_newest=True)
    assert sent.unheld_since == 0.3, "what left within 6 ms counts as old as its first"
    sent.forget()
    assert (sent.unheld_since, sent.is_held) == (0.302, False), "it is still to arrive"


def test_an_update_is_urgent_when_its_time_runs_out() -> None:
    """It must be acknowledged within 0.1 s and the round trip; then nothing follows, and nothing is urgent."""
    sent = stream(round_trip=0.06)
    sent.begin(1, 1.0)
    assert sent.due_at(0.05, 9.0) == pytest.approx(1.125)
    assert not sent.repeated(2, 1.124)
    assert sent.due_at(0.05, 9.0) == pytest.approx(1.128)
    assert sent.repeated(3, 1.158) and sent.due_at(0.05, 9.0) > 9.0
    sent.begin(4, 1.16)
    assert sent.due_at(0.05, 9.0) > 9.0, "there is no time left for one"
    sent.acknowledge(1, 3, is_newest=True)
    assert sent.due_at(0.05, 9.0) == pytest.approx(1.285)


STEPS = st.lists(st.tuples(st.floats(0.0, 0.05), st.sampled_from(["update", "acknowledged", "missed", "nothing"])))


@given(STEPS, st.integers(0, MOST_COPIES), st.floats(0.0, 0.2), st.just(inf) | st.floats(0.0, 0.4))
def test_repeats_keep_to_their_bound_over_any_pattern(
    steps: list[tuple[float, str]], copies: int, rtt: float, agreed: float
) -> None:
    """Whatever is lost or acknowledged, whenever updates come, however late the owner looks at the clock. Only where a
    round trip is agreed on is anything urgent."""
    pace, most = (max(SHORTEST_PACE, 0.0 if copies else rtt), 13) if agreed == inf else (URGENT_PACE * SILENCE, 23)
    sent = stream(round_trip=agreed)
    now, number, begun_at, repeats = 0.0, 0, 0.0, 0
    for wait, what in steps:
        now += wait
        if what == "update":
            number, begun_at, repeats = number + 1, now, 0
            sent.begin(number, now, copies)
        elif what == "acknowledged":
            acknowledge(sent, number)
        elif what == "missed":
            sent.is_missed = True
        while sent.due_at(rtt, 0.0) <= now:
            assert now >= sent.sent_at + pace - 1e-12
            number, repeats = number + 1, repeats + 1
            sent.repeated(number, now)
        assert repeats <= most + (now - begun_at) / LONGEST_PACE


REPORTS = st.lists(st.tuples(st.floats(0.0, 3.0), st.integers(-5, 400)), max_size=60)


@given(STEPS, st.integers(0, MOST_COPIES), REPORTS)
def test_early_repeats_are_bounded_by_their_allowance(
    steps: list[tuple[float, str]], copies: int, reports: list[tuple[float, int]]
) -> None:
    """Of all streams together, whatever the peer reports; also where they have spent more than there was."""
    allowance = Allowance()
    streams = [stream(allowance), stream(allowance)]
    now, number, repeats = 0.0, 0, 0
    for place, (wait, what) in enumerate(steps):
        now += wait
        if place < len(reports):
            allowance.adapt(reports[place][1], 60 * place, 0.0, now)
            assert LEAST_EARLY_PER_S <= allowance.rate <= MOST_EARLY_PER_S
            assert 0 <= allowance.left(now) <= allowance.rate
        if what == "update":
            number += 1
            streams[place % 2].begin(number, now, copies)
        for each in streams:
            while each.due_at(0.0, inf) <= now:  # without evidence, and without end of patience
                number, repeats = number + 1, repeats + 1
                each.repeated(number, now)
    assert repeats <= MOST_EARLY_PER_S * (1.0 + now) + 1e-9


def rates(
    loss: Callable[[int, float], float], seconds: int, jitter: Callable[[float], float] = lambda rate: 0.0
) -> list[float]:
    """Rates of an allowance on a link with that loss by second and rate, and that delay in queues by rate [s].

    There are 200 datagrams and one report a second."""
    allowance, found = Allowance(), []
    for second in range(seconds):
        rate = allowance.rate
        allowance.adapt(round(200 * loss(second, rate)), 200 * second, jitter(rate), float(second))
        found.append(allowance.rate)
    return found


@given(st.floats(RESIDUAL + 0.01, 1.0))
def test_the_allowance_is_raised_where_the_loss_does_not_grow(loss: float) -> None:
    assert set(rates(lambda second, rate: 0.0, 100)) == {LEAST_EARLY_PER_S}
    assert rates(lambda second, rate: loss, 10)[-1] == MOST_EARLY_PER_S
    found = rates(lambda second, rate: 0.03 if second < 20 else 0.3, 40)  # the loss itself has changed
    assert found[19] == found[39] == MOST_EARLY_PER_S and LEAST_EARLY_PER_S in found[20:]


@given(st.floats(RESIDUAL + 0.01, 0.2), st.floats(0.02, 0.3), st.booleans())
def test_the_allowance_stays_low_where_the_loss_or_queues_grow_with_it(
    alone: float, growth: float, in_queues: bool
) -> None:
    """The attempts become rare, and each is short."""
    together = GROWTH * alone + (JITTER_SLACK if in_queues else GROWTH_SLACK) + growth

    def of(rate: float) -> float:
        return together if rate > LEAST_EARLY_PER_S else alone

    found = rates(lambda second, rate: 0.1, 1000, of) if in_queues else rates(lambda second, rate: of(rate), 1000)
    attempts = [second for second, rate in enumerate(found) if rate > LEAST_EARLY_PER_S]
    assert 0 < len(attempts) <= 1000.0 / LONGEST_HOLD + 8
    pauses = [later - earlier for earlier, later in pairwise(attempts) if later - earlier > 1]
    assert all(later <= 2 * earlier + 2 for earlier, later in pairwise(pauses))
    assert max(found) <= RAISE * LEAST_EARLY_PER_S


@given(st.floats(0.0, 1.0), st.just(0.0) | st.floats(1.0, 50.0))
def test_copies_leave_little_lost(loss: float, burst: float) -> None:
    copies, again = copies_needed(loss, burst), lost_again(loss, burst)
    assert 0 <= copies <= MOST_COPIES
    assert lost_again(loss, 0.0) == lost_again(loss, 1.0) == loss <= again <= 1.0
    assert copies == MOST_COPIES or loss * again**copies <= RESIDUAL * (1.0 + 1e-6)
    assert copies == 0 or loss * again ** (copies - 1) > RESIDUAL * (1.0 - 1e-6)
