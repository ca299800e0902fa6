"""Credit, by itself and over two real endpoints: the known credit must never exceed what was granted."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.protocol.harness import MASTER, Pair, forms, sample_update
from weberlink.protocol import DropReason
from weberlink.protocol.counters import Credit
from weberlink.protocol.wire import HEARTBEAT_CREDIT_BITS, UPDATE_CREDIT_BITS, Kind, kind_of

CARRIED = {"carries_credit": True, "incoming": (forms(3),), "outgoing": (forms(3),)}


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


def test_granted_credit_cannot_fall() -> None:
    credit = Credit()
    credit.grant(5)
    with pytest.raises(ValueError, match="fall from 5 to 4"):
        credit.grant(4)
    assert credit.granted == 5
    with pytest.raises(ValueError, match="-1"):
        Credit().grant(-1)


def test_updates_repeats_and_heartbeats_carry_present_credit() -> None:
    pair = Pair(master=CARRIED, slave=CARRIED).engage()
    pair.master.endpoint.grant(70_000)
    pair.master.endpoint.send_update(pair.now, sample_update(pair.ticks))
    pair.swallow = lambda side, data: kind_of(data) == Kind.UPDATE
    pair.run(0.003)
    assert pair.slave.endpoint.credit.known == 0
    pair.master.endpoint.grant(70_001)
    while not pair.master.endpoint.statistics.repeats:
        pair.run(0.001)
    repeat = pair.tap[-1][2]
    pair.slave.endpoint.receive_datagram(repeat, MASTER, pair.now)
    assert pair.slave.endpoint.credit.known == 70_001 % 2**16, "over 16 bits were granted unheard: too low"
    pair.run(0.1)
    assert pair.slave.endpoint.credit.known == 70_001, "a heartbeat has arrived"


@pytest.mark.parametrize("reason", [DropReason.STALE, DropReason.SUPERSEDED])
def test_late_datagram_still_tells_its_credit(reason: DropReason) -> None:
    """A stale update carries the newest count; a superseded one carries an older count, which is ignored."""
    pair = Pair(master=CARRIED, slave=CARRIED).engage()
    pair.master.endpoint.grant(5)
    pair.master.endpoint.send_update(pair.now, sample_update(pair.ticks))
    (held, _) = pair.master.endpoint.datagrams_to_send()[0]
    if reason is DropReason.SUPERSEDED:
        pair.master.endpoint.grant(6)
        pair.master.endpoint.send_update(pair.now, sample_update(pair.ticks + 1))
        pair.run(0.01)
    else:
        pair.swallow = lambda side, data: side is pair.master
        pair.run(0.15)
    pair.slave.endpoint.receive_datagram(held, MASTER, pair.now)
    pair.slave.collect(pair.now)
    assert reason in pair.slave.faults()
    assert pair.slave.endpoint.credit.known == (6 if reason is DropReason.SUPERSEDED else 5)


def test_credit_of_an_implausible_datagram_is_ignored() -> None:
    pair = Pair(master=CARRIED, slave=CARRIED).engage()
    pair.master.endpoint.grant(5)
    for at, tick in ((pair.now + 30.0, 0), (pair.now, 10**6)):
        pair.master.endpoint.send_update(at, sample_update(tick))
        (data, _) = pair.master.endpoint.datagrams_to_send()[0]
        pair.slave.endpoint.receive_datagram(data, MASTER, pair.now)
    pair.slave.collect(pair.now)
    assert pair.slave.faults() == [DropReason.IMPLAUSIBLE] * 2
    assert pair.slave.endpoint.credit.known == 0
