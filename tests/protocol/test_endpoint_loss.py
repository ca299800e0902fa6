"""Bounds on repeats and questions, and on the time until a lost update arrives, over any pattern of losses."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.protocol.harness import GAP, MENDED_WITHIN, SILENCE, Pair, Side, forms
from weberlink.protocol import PeerSilent, State
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.heartbeat import ASK_PACE, DENSEST
from weberlink.protocol.liveness import FADE_SHARE
from weberlink.protocol.retransmission import LEAST_EARLY_PER_S, MOST_EARLY_PER_S, SHORTEST_PACE
from weberlink.protocol.wire import MARK, Kind, kind_of


@examples(15)
@given(
    st.integers(0, 2**32),
    st.lists(st.booleans(), max_size=40),
    st.lists(st.booleans(), max_size=40),
    st.integers(1, 30),
    st.sampled_from([0.0, 0.001, 0.02, 0.045]),
)
def test_newest_update_arrives_after_any_pattern_of_losses(
    seed: int, forward: list[bool], backward: list[bool], gap: int, delay: float
) -> None:
    """For 80 ms, any of the first datagrams of each direction are lost; updates go out at any pace meanwhile."""
    link = Emulation(delay_s=delay)
    pair = Pair(seed=seed, forward=link, backward=link).engage()
    ends_at = pair.now + 0.08
    fates = {id(pair.master): iter(forward), id(pair.slave): iter(backward)}
    pair.swallow = lambda side, data: pair.now < ends_at and next(fates[id(side)], False)
    newest = pair.master.send(pair.now, pair.ticks)
    while pair.now < ends_at - 0.001 * gap:
        pair.run(0.001 * gap)
        newest = pair.master.send(pair.now, pair.ticks)
    pair.run(ends_at - pair.now)
    pair.run(MENDED_WITHIN + 2.0 * delay)
    if pair.master.of(PeerSilent) or pair.slave.of(PeerSilent):  # their owners are told, and begin anew
        pair.run(1.0)
        assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    else:
        assert pair.slave.updates()[-1].update.tick == newest


@pytest.mark.parametrize("delay", [0.0005, 0.045])
def test_rare_updates_are_mended_before_there_is_evidence(delay: float) -> None:
    """One update in 300 ms: nearly all are there within a few repeats 5 ms apart, although the round trip is longer."""
    lossy = Emulation(delay_s=delay, loss=0.2)
    sent: dict[int, float] = {}

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        if now > 3.0:
            sent[pair.slave.send(pair.now, pair.ticks)] = now

    changes = {"incoming": (forms(3),), "outgoing": (forms(3),)}
    pair = Pair(forward=lossy, backward=lossy, master=changes, slave=changes, on_tick=on_tick, every=300, seed=1)
    pair.connect().run(33.0)
    arrived = [(at, event.update.tick) for at, event in pair.master.received_at]
    waits = [at - sent[tick] - delay for at, tick in arrived if tick in sent]
    prompt = [wait for wait in waits if wait <= 3.5 * SHORTEST_PACE]
    assert len(prompt) > 0.95 * len(sent)


@pytest.mark.parametrize("burst", [1.0, 20.0])
def test_early_repeats_keep_to_their_allowance(burst: float) -> None:
    lossy = Emulation(delay_s=0.045, loss=0.2, burst=burst)

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        if now > 0.2 and pair.master.endpoint.state is State.ENGAGED:
            pair.master.send(pair.now, pair.ticks)

    backward = Emulation(delay_s=0.045)
    pair = Pair(forward=lossy, backward=backward, on_tick=on_tick, every=20, seed=2)
    pair.connect().run(10.0)
    # Newer updates come sooner than evidence can, so every repeat is an early one.
    assert 0 < pair.master.endpoint.statistics.repeats <= MOST_EARLY_PER_S * 11.0


def test_repeats_end_where_they_fill_the_link() -> None:
    """A narrow link: the updates fit, their repeats do not. They fill its queue, and cease; what is needed goes on."""
    narrow = Emulation(delay_s=0.02, loss=0.1, rate_bit_s=42_000.0)

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        if pair.master.endpoint.state is State.ENGAGED:
            pair.master.send(pair.now, pair.ticks)

    ends = {"silence": 1.0}
    pair = Pair(
        forward=narrow, backward=Emulation(delay_s=0.02), master=ends, slave=ends, on_tick=on_tick, every=20, seed=5
    )
    pair.connect().run(16.0)
    before, start = pair.master.endpoint.statistics.repeats, pair.now
    pair.run(10.0)
    spent = pair.master.endpoint.statistics.repeats - before
    ages = [event.age for at, event in pair.slave.received_at if at > start]
    on_evidence = 0.1 * 50.0
    assert spent <= 2.0 * (LEAST_EARLY_PER_S + on_evidence) * 10.0
    assert sorted(ages)[len(ages) // 2] < 0.04
    assert not pair.slave.of(PeerSilent)


@pytest.mark.parametrize("darkness", [0.03, 0.09, 0.5])
@pytest.mark.parametrize("seed", range(2))
def test_no_storm_follows_a_blackout(seed: int, darkness: float) -> None:
    """What is sent in the 200 ms after it is no more than two directions of heartbeats and one update can explain."""
    lossy = Emulation(delay_s=0.001, loss=0.1)
    pair = Pair(seed=seed, forward=lossy, backward=lossy).engage().run(5.0)
    pair.swallow = lambda side, data: True
    pair.master.send(pair.now, pair.ticks)
    start = len(pair.tap)
    pair.run(darkness)
    in_the_dark = len(pair.tap) - start
    pair.swallow = lambda side, data: False
    before = len(pair.tap)
    pair.run(0.2)
    assert in_the_dark <= 2 * (0.1 / ASK_PACE) + 12 + 2 * darkness / GAP + 10 * darkness
    assert len(pair.tap) - before <= 2 * 0.2 / DENSEST + 40, f"seed {seed}"
    assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED


def test_overdue_peer_is_asked_and_answers() -> None:
    """Without the question, the one lost heartbeat would take the loop age beyond the limit."""
    random = Random(3)
    pair = Pair().engage().run(1.0)
    ages = []
    for _ in range(50):
        pair.run(0.1 * random.random())
        lost = False

        def swallow(side: Side, data: bytes) -> bool:
            nonlocal lost
            was_lost, lost = lost, lost or side is pair.slave
            return side is pair.slave and not was_lost

        pair.swallow = swallow
        for _ in range(300):
            pair.run(0.001)
            ages.append(pair.now - pair.master.endpoint.liveness.confirmed_at)
    assert FADE_SHARE * SILENCE < max(ages) < SILENCE
    assert not pair.master.of(PeerSilent)
    asks = [data for _, _, data in pair.tap if kind_of(data) == Kind.HEARTBEAT and data[0] & MARK]
    assert len(asks) >= 10


def test_a_farewell_on_a_lossy_link_is_sent_more_than_once() -> None:
    """Nothing is repeated after it; on a link without loss it is one datagram."""
    counts = {}
    for loss in (0.0, 0.2):
        pair = Pair(backward=Emulation(delay_s=0.001, loss=loss), seed=4).connect().run(10.0)
        before = len(pair.tap)
        pair.slave.endpoint.close(pair.now, "completed")
        pair.run(0.01)
        farewells = [data for _, side, data in pair.tap[before:] if side is pair.slave and kind_of(data) == Kind.BYE]
        counts[loss] = len(farewells)
    assert counts[0.0] == 1
    assert counts[0.2] > 1
