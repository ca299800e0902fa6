"""Truncated counters: expansion, replay window, loss meter, and credit, of which no end believes too much."""

from itertools import pairwise
from random import Random

import pytest
from hypothesis import example, given, strategies as st

from tests.protocol.harness import MASTER, Pair, both, dropped, forms, sample_update
from weberlink.protocol import DropReason
from weberlink.protocol.counters import (
    LOSS_PATIENCE,
    REPLAY_WINDOW,
    Credit,
    LossMeter,
    ReplayWindow,
    expand,
)
from weberlink.protocol.wire import HEARTBEAT_CREDIT_BITS, UPDATE_CREDIT_BITS


@given(st.integers(0, 2**24 - 1), st.integers(-(2**40), 2**40))
@example(2**24 - 5, 0)
@example(2, 2**24 - 4)
def test_expansion_is_congruent_and_near_and_of_a_counter_never_negative(truncated: int, near: int) -> None:
    full = expand(truncated, 24, near)
    assert full % 2**24 == truncated
    assert abs(full - near) <= 2**23
    counted = expand(truncated, 24, max(near, 2**23))
    assert counted == (full if near >= 2**23 else truncated)


@given(st.lists(st.integers(0, 3 * REPLAY_WINDOW), max_size=200))
@example([REPLAY_WINDOW, 0, 1])
@example([REPLAY_WINDOW - 1, 0])
@example([1, REPLAY_WINDOW + 1, 1, 2])
@example([5, 2**60, 5, 2**60, 2**60 - 1])
def test_each_number_is_new_once_and_old_ones_never(numbers: list[int]) -> None:
    window = ReplayWindow()
    seen: set[int] = set()
    for number in numbers:
        newest = max(seen, default=-1)
        assert window.newest == newest
        assert window.accept(number) == (number not in seen and newest - number < REPLAY_WINDOW)
        seen.add(number)
        assert not window.accept(number)


def meter(numbers: list[int]) -> LossMeter:
    made = LossMeter()
    assert sum(made.record(number) for number in numbers) == made.lost
    return made


@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.3]), st.sampled_from([1, 2, 40]))
def test_losses_and_their_runs_are_those_of_the_gaps_in_any_order(seed: int, loss: float, reach: int) -> None:
    """The averages are linear, so what comes late is taken back exactly; a mean of runs needs three of them."""
    random = Random(seed)
    received = [0, 1, *(number for number in range(2, 151) if random.random() >= loss), 151]
    order = sorted(received[1:], key=lambda number: number + random.random() * reach)
    made = meter([0, *order, *range(152, 153 + reach + LOSS_PATIENCE)])
    runs = [after - before - 1 for before, after in pairwise(received) if after - before > 1]
    assert made.lost == sum(runs)
    if loss:
        assert made.burst == pytest.approx(sum(runs) / len(runs), rel=0.08)
    else:
        assert made.fraction == pytest.approx(0.0, abs=1e-9) and made.burst == 0.0


@pytest.mark.parametrize("loss", [0.01, 0.1, 0.5])
def test_the_estimate_follows_the_loss(loss: float) -> None:
    random = Random(3)
    made = LossMeter()
    estimates = []
    for number in range(20_000):
        if random.random() >= loss:
            made.record(number)
            estimates.append(made.fraction)
    late = estimates[5000:]
    assert loss * 0.9 < sum(late) / len(late) < 1.2 * loss + 0.005, "the larger of two averages is a little too high"
    for number in range(20_000, 35_000):
        made.record(number)
    assert made.fraction < 1e-4


def test_rare_blackouts_are_no_bursts_and_one_is_noticed_however_long() -> None:
    assert meter([*range(100), *range(140, 400), *range(440, 900)]).burst == 0.0
    assert meter([*range(100), *range(120, 124)]).fraction > 0.4
    assert 1e-4 < meter([*range(100), *range(101, 600)]).fraction < 2e-3, "one loss is remembered"
    made = meter([0, 2**40, 2**40 + 1, 2**40 + 2, 2**40 + 3])
    assert made.lost == 2**40 - 1 and 0.9 < made.fraction <= 1.0


def sendings(largest: int) -> st.SearchStrategy[list[tuple[int, int, float, int]]]:
    """Of each datagram: credit granted since the one before, bits of its field, places that it is late, and copies."""
    bits = st.sampled_from([UPDATE_CREDIT_BITS, HEARTBEAT_CREDIT_BITS])
    return st.lists(st.tuples(st.integers(0, largest), bits, st.floats(0.0, 50.0), st.integers(0, 2)), max_size=40)


def arrivals(sent: list[tuple[int, int, float, int]]) -> list[tuple[int, int, int]]:
    """Sequence, full count and bits, in the order of arrival; the last of those sent arrives last."""
    total, flights = 0, []
    for sequence, (step, bits, transit, copies) in enumerate(sent):
        total += step
        flights += [(sequence + transit, sequence, total, bits)] * copies
    return [flight[1:] for flight in sorted(flights)]


@given(sendings(2**18))
def test_known_credit_never_exceeds_granted(sent: list[tuple[int, int, float, int]]) -> None:
    """Whatever is lost, doubled or overtaken, and however large the steps. It never falls either."""
    credit = Credit()
    largest, known, newest = 0, 0, -1
    for sequence, count, bits in arrivals(sent):
        credit.learn(sequence, count % 2**bits, bits)
        largest = max(largest, count)
        assert known <= credit.known <= largest
        known = credit.known
        if bits == HEARTBEAT_CREDIT_BITS and sequence > newest:
            assert known == count, "the long field restores what the short one lost"
        newest = max(newest, sequence)


@given(sendings(2**UPDATE_CREDIT_BITS // 40 - 1), st.integers(0, 2**36))
def test_whole_credit_is_known_from_the_next_datagram_on(sent: list[tuple[int, int, float, int]], start: int) -> None:
    """If less than the range of its field was granted unheard; near any wrap of either field."""
    credit = Credit()
    counts = [*range(0, start, 2**31), start]
    for sequence, count in enumerate(counts):
        credit.learn(sequence, count % 2**HEARTBEAT_CREDIT_BITS, HEARTBEAT_CREDIT_BITS)
    newest = 0
    for sequence, count, bits in arrivals(sent):
        credit.learn(len(counts) + sequence, (start + count) % 2**bits, bits)
        newest = max(newest, count)
        assert credit.known == start + newest


def test_credit_cannot_fall_and_that_of_a_stale_datagram_counts_but_not_of_an_implausible_one() -> None:
    pair = Pair(**both(carries_credit=True, incoming=(forms(3),), outgoing=(forms(3),))).engage()
    master, slave = pair.master.endpoint, pair.slave.endpoint

    def arrive(at: float, tick: int) -> list[DropReason]:
        master.send_update(at, sample_update(tick))
        ((data, _),) = master.datagrams_to_send()
        return dropped(slave, data, MASTER, pair.now)

    master.grant(5)
    with pytest.raises(ValueError, match="fall from 5 to 4"):
        master.grant(4)
    assert arrive(pair.now + 30.0, 0) == arrive(pair.now, 10**6) == [DropReason.IMPLAUSIBLE]
    assert slave.credit.known == 0
    assert arrive(pair.now - 0.15, pair.ticks - 150) == [DropReason.STALE]
    assert slave.credit.known == 5


def test_more_credit_is_told_within_its_interval_whenever_it_is_granted() -> None:
    pair = Pair(**both(carries_credit=True, incoming=(forms(3),), outgoing=(forms(3),))).engage().run(1.0)
    session = pair.master.endpoint._session
    assert session is not None
    heartbeats = session.heartbeats
    assert heartbeats.credit_interval + 0.01 < heartbeats.max_gap
    for count in range(1, 50):
        pair.run(0.007 * (count % 9))
        assert pair.master.endpoint.next_timer() is not None
        pair.master.endpoint.grant(count)
        due = pair.master.endpoint.next_timer()
        assert due is not None and due <= max(pair.now, heartbeats._sent_at + heartbeats.credit_interval)
        pair.run(heartbeats.credit_interval + 0.003)
        assert pair.slave.endpoint.credit.known == count
