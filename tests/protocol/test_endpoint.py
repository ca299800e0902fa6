"""Two endpoints in a session: what counts as heard, how soon and how much is sent, and the clocks."""

from itertools import pairwise
from random import Random

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from tests.protocol.harness import (
    ENGAGED,
    GAP,
    MASTER,
    MENDED_WITHIN,
    SILENCE,
    SLAVE,
    STRANGER,
    TICK,
    Pair,
    Side,
    both,
    dropped,
    forms,
    kind_of,
    make_endpoint,
    sample_update,
    sent,
    states,
)
from weberlink.protocol import Connected, DatagramDropped, DropReason, PeerSilent, Role, State, UpdateReceived
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.endpoint import QUEUED_DATAGRAMS, QUEUED_EVENTS
from weberlink.protocol.liveness import ASK_PACE, DENSEST, FADE_SHARE, HeartbeatSchedule
from weberlink.protocol.retransmission import LEAST_EARLY_PER_S, SHORTEST_PACE
from weberlink.protocol.wire import MARK, Kind

# --- what counts as heard


def test_updates_are_dated_although_first_reports_are_lost() -> None:
    """The master floods updates from the first moment; its first three heartbeats never arrive."""
    pair = Pair(on_tick=lambda pair, now, tick: pair.master.endpoint.send_update(now, sample_update(tick)))
    pair.swallow = lambda side, data: kind_of(data) == Kind.HEARTBEAT and len(sent(pair, Kind.HEARTBEAT)) <= 3
    pair.connect().run(0.2)
    assert set(pair.slave.faults()) == {DropReason.UNTIMED}
    assert pair.slave.received_at[0][0] < 0.1


def test_an_update_that_is_refused_for_its_loop_age_is_no_sign_of_the_encoder() -> None:
    """Somebody lets heartbeats pass, and holds every update for a while: fresh, but not executed."""
    pair = Pair(**both(longest_round_trip=0.01)).engage()
    pair.master.send(pair.now, pair.ticks)
    pair.run(0.05)
    held: list[tuple[float, bytes]] = []

    def hold(side: Side, data: bytes) -> bool:
        is_held = side is pair.master and kind_of(data) == Kind.UPDATE
        if is_held and pair.now - side.endpoint.liveness.heard_at > 0.015:  # its echo makes its loop age too large
            held.append((pair.now, data))
        return is_held

    pair.swallow = hold
    taken, delivered = len(pair.slave.updates()), 0
    for _ in range(60):
        pair.master.send(pair.now, pair.ticks)
        pair.run(0.005)
        while held and held[0][0] < pair.now - 0.0985:
            pair.slave.endpoint.receive_datagram(held.pop(0)[1], MASTER, pair.now)
            delivered += 1
    assert delivered > 10 and len(pair.slave.updates()) == taken
    assert not pair.slave.endpoint.may_follow(pair.now)


@pytest.mark.parametrize("delay", [0.001, 0.05, 0.15])
@pytest.mark.parametrize("deaf", [0, 1])
def test_one_way_cut_silences_both_and_tells_who_is_heard(deaf: int, delay: float) -> None:
    """The end that hears nothing falls silent after one limit, the other after both; then the other way is cut too."""
    pair = Pair(link=Emulation(delay_s=delay)).connect().run(3.0)
    dark = [pair.sides[1 - deaf].endpoint]
    pair.swallow = lambda side, data: side.endpoint in dark
    cut = pair.now
    pair.run(delay + SILENCE + 0.002)
    assert pair.sides[deaf].endpoint.state is State.SILENT
    other = pair.sides[1 - deaf]
    pair.run(cut + SILENCE + other.endpoint.liveness.round_trip + 0.002 - pair.now)
    assert states(pair) == [State.SILENT] * 2
    assert pair.sides[deaf].of(PeerSilent) == [PeerSilent(is_heard=False)]
    assert other.of(PeerSilent) == [PeerSilent(is_heard=True)]
    dark.append(pair.sides[deaf].endpoint)
    pair.run(delay + SILENCE + 0.002)
    assert other.of(PeerSilent) == [PeerSilent(is_heard=True), PeerSilent(is_heard=False)]
    assert len(pair.sides[deaf].of(PeerSilent)) == 1


# --- how soon, and how much is sent


@examples(20)
@given(
    st.integers(0, 2**32),
    st.tuples(*[st.lists(st.booleans(), max_size=40)] * 2),
    st.tuples(*[st.integers(1, 30)] * 2),
    st.sampled_from([0.0, 0.001, 0.02, 0.045]),
    st.booleans(),
)
def test_newest_updates_arrive_in_time_after_any_pattern_of_losses(
    seed: int, fates: tuple[list[bool], list[bool]], paces: tuple[int, int], delay: float, doubled: bool
) -> None:
    """For 80 ms, any of the first datagrams of each direction are lost; the rest are late, reordered or doubled."""
    link = Emulation(delay_s=delay, jitter_s=0.002, reorder=0.1, duplicate=0.2 * doubled)
    newest = [[], []]
    ends_at = 0.28

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        for stream, pace in enumerate(paces):
            if 0.2 <= now < ends_at and tick % pace == 0:
                newest[stream] = [pair.master.send(pair.now, pair.ticks, stream)]

    ends = both(outgoing=(forms(3),) * 2, incoming=(forms(3),) * 2)
    pair = Pair(seed=seed, link=link, on_tick=on_tick, **ends).engage()
    left = {side.endpoint: iter(fate) for side, fate in zip(pair.sides, fates, strict=True)}
    pair.swallow = lambda side, data: pair.now < ends_at and next(left[side.endpoint], False)
    pair.run(ends_at - pair.now)
    pair.run(MENDED_WITHIN + 2.0 * (delay + 0.002))
    if not pair.master.silences + pair.slave.silences:  # else their owners are told, and begin anew
        arrived = [[event.update.tick for event in pair.slave.updates() if event.stream == each] for each in (0, 1)]
        assert [ticks[-1:] for ticks in arrived] == newest


def test_heartbeats_keep_their_gap() -> None:
    """Two ends at rest send three datagrams per reach together."""
    pair = Pair().engage().run(1.0)
    before = len(pair.tap)
    pair.run(10.0)
    schedule = HeartbeatSchedule(pair.master.endpoint.liveness, 0.0, TICK)
    schedule.adapt(0.0, 0.0, 0.002, 0.0)  # 1 ms each way
    assert len(pair.tap) - before == pytest.approx(10.0 * 3.0 / schedule.max_echo_age, rel=0.05)
    for side in pair.sides:
        times = [at for at, sender, _ in pair.tap[before:] if sender is side]
        assert len(times) <= 25.0 * 10.0
        assert max(later - earlier for earlier, later in pairwise(times)) <= GAP + 1e-6


@pytest.mark.parametrize(("loss", "delay"), [(0.02, 0.15), (0.3, 0.0005)])
def test_losses_are_measured_and_cause_no_silence(loss: float, delay: float) -> None:
    pair = Pair(link=Emulation(delay_s=delay, loss=loss), seed=21).connect().run(10.0)
    before = [side.silences for side in pair.sides]
    pair.run(15.0)
    assert [side.silences for side in pair.sides] == before, "seed 21"
    assert pair.slave.endpoint.statistics.incoming_loss == pytest.approx(loss, abs=0.15)
    assert pair.master.endpoint.statistics.outgoing_loss == pytest.approx(loss, abs=0.15)
    lost = pair.master.endpoint.statistics.sent - pair.slave.endpoint.statistics.received
    assert pair.slave.endpoint.statistics.lost == pytest.approx(lost, abs=20)


def sending(every: int, after: float = 0.2) -> dict[str, object]:
    """Arguments of a pair whose master sends an update in every so-manieth tick."""

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        if now > after and pair.master.endpoint.state is State.ENGAGED:
            pair.master.send(pair.now, pair.ticks)

    return {"on_tick": on_tick, "every": every}


@pytest.mark.parametrize("delay", [0.0005, 0.045])
def test_rare_updates_are_mended_before_there_is_evidence(delay: float) -> None:
    """One update in 300 ms: nearly all are there within a few repeats 5 ms apart, although the round trip is longer."""
    lossy = Emulation(delay_s=delay, loss=0.2)
    pair = Pair(link=lossy, seed=1, **sending(300, 3.0)).connect().run(33.0)  # type: ignore[arg-type]
    waits = {event.update.tick: at - 1e-3 * event.update.tick - delay for at, event in reversed(pair.slave.received_at)}
    prompt = [wait for wait in waits.values() if wait <= 3.5 * SHORTEST_PACE]
    assert len(prompt) > 0.95 * pair.master.endpoint.statistics.updates_sent[0]


def test_repeats_end_where_they_fill_the_link() -> None:
    """A narrow link: the updates fit, their repeats do not. They fill its queue, and cease; what is needed goes on."""
    links = Emulation(delay_s=0.02, loss=0.1, rate_bit_s=42_000.0), Emulation(delay_s=0.02)
    pair = Pair(link=links[0], backward=links[1], seed=5, **both(silence=1.0), **sending(20, 0.0))  # type: ignore[arg-type]
    pair.connect().run(16.0)
    before, start = pair.master.endpoint.statistics.repeats, pair.now
    pair.run(10.0)
    ages = sorted(event.age for at, event in pair.slave.received_at if at > start)
    on_evidence = 0.1 * 50.0
    assert pair.master.endpoint.statistics.repeats - before <= 2.0 * (LEAST_EARLY_PER_S + on_evidence) * 10.0
    assert ages[len(ages) // 2] < 0.04 and not pair.slave.of(PeerSilent)


@pytest.mark.parametrize("darkness", [0.09, 30.0])
def test_no_storm_in_a_blackout_and_after_it(darkness: float) -> None:
    """What is sent in the 200 ms after it is no more than two directions of heartbeats and one update can explain."""
    pair = Pair(link=Emulation(delay_s=0.001, loss=0.1)).engage().run(5.0)
    pair.swallow = lambda side, data: True
    pair.master.send(pair.now, pair.ticks)
    start = len(pair.tap)
    pair.run(darkness)
    in_the_dark = len(pair.tap) - start
    pair.swallow = lambda side, data: False
    before = len(pair.tap)
    pair.run(0.2)
    assert in_the_dark <= 2 * (0.1 / ASK_PACE) + 12 + 2 * darkness / GAP + 10 * darkness
    assert len(pair.tap) - before <= 2 * 0.2 / DENSEST + 40
    assert pair.master.endpoint.statistics.repeats <= 20
    assert states(pair) == ENGAGED


def test_overdue_peer_is_asked_and_answers() -> None:
    """Without the question, the one lost heartbeat would take the loop age beyond the limit."""
    random = Random(3)
    pair = Pair().engage().run(1.0)
    ages = []
    for _ in range(50):
        pair.run(0.1 * random.random())
        lost: list[bytes] = []
        pair.swallow = lambda side, data, lost=lost: side is pair.slave and not lost and not lost.append(data)  # type: ignore[misc]
        for _ in range(300):
            pair.run(0.001)
            ages.append(pair.now - pair.master.endpoint.liveness.confirmed_at)
    assert FADE_SHARE * SILENCE < max(ages) < SILENCE and not pair.master.of(PeerSilent)
    assert sum(bool(data[0] & MARK) for data in sent(pair, Kind.HEARTBEAT)) >= 10


# --- clocks


def test_time_stamps_and_ticks_go_on_past_their_wrap() -> None:
    """The stamp wraps after 84 s, the tick of a heartbeat after 65 s at 1 kHz."""
    age = 2**24 * 0.001 - 1.0
    ticks: list[int] = []

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        if 200 < tick < 2900:
            ticks.append(pair.master.send(pair.now, round((now + age) * 1000)))

    pair = Pair(master={"epoch": -age}, slave={"epoch": 1000 - 2**24 * 1e-5}, on_tick=on_tick, every=10)
    pair.engage().run(3.0)
    assert ticks[0] < 2**24 < ticks[-1]
    assert [event.update.tick for event in pair.slave.updates()] == ticks
    assert all(event.age == pytest.approx(0.001, abs=1e-4) for event in pair.slave.updates())
    assert not pair.slave.faults() and not pair.master.faults()


# --- queues


def test_datagrams_leave_in_order_and_once_and_the_oldest_are_dropped() -> None:
    endpoint = (pair := Pair().engage()).master.endpoint
    before = endpoint.statistics.bytes_sent
    for tick in range(QUEUED_DATAGRAMS + 3):
        endpoint.send_update(pair.now, sample_update(pair.ticks + tick))
    left = endpoint.datagrams_to_send()
    assert len(left) == QUEUED_DATAGRAMS and endpoint.statistics.overflowed == 3
    assert before < endpoint.statistics.bytes_sent - sum(len(data) for data, _ in left) < before + 200
    for data, address in left:
        assert address == SLAVE and not dropped(pair.slave.endpoint, data, MASTER, pair.now)
    assert endpoint.datagrams_to_send() == []


def test_a_flood_of_drops_pushes_no_other_event_out() -> None:
    pair = Pair().engage()
    slave, sender = pair.slave.endpoint, pair.master.endpoint

    def update(tick: int) -> None:
        sender.send_update(pair.now, sample_update(pair.ticks + tick))
        for data, _ in sender.datagrams_to_send():
            slave.receive_datagram(data, MASTER, pair.now)

    update(1)
    for _ in range(10_000):
        slave.receive_datagram(bytes([Kind.UPDATE]) * 25, STRANGER, pair.now)
    update(2)
    events = list(iter(slave.next_event, None))
    assert [type(events[index]) for index in (0, 1, -1)] == [UpdateReceived, DatagramDropped, UpdateReceived]
    assert len(events) < QUEUED_EVENTS and slave.statistics.dropped[DropReason.BAD_TAG] == 10_000
    for tick in range(QUEUED_EVENTS + 5):
        update(tick)
    assert len(events := list(iter(slave.next_event, None))) == QUEUED_EVENTS
    assert isinstance(events[0], UpdateReceived) and events[0].update == sample_update(pair.ticks + 5)


def test_a_session_begins_with_an_empty_queue() -> None:
    pair = Pair().engage()
    pair.slave.collect = lambda world: None  # type: ignore[method-assign]
    pair.master.endpoint = make_endpoint(Role.INITIATOR, seed=9)
    pair.run(0.3)  # so that the slave falls silent
    pair.master.endpoint.connect(pair.now)
    pair.run(0.2)
    assert isinstance(pair.slave.endpoint.next_event(), Connected)


# --- what both ends must know before anything is followed


def test_a_change_that_is_repeated_does_not_stand_for_heartbeats() -> None:
    """It says nothing of an encoder: both ends would stop following on a link that loses nothing."""
    is_watched = False

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        for side in pair.sides:
            side.endpoint.report_encoding(now, is_encoding=True)
            side.renew(now, tick)
            assert not is_watched or side.endpoint.may_follow(now)

    pair = Pair(**both(outgoing=(forms(3),), incoming=(forms(3),)), on_tick=on_tick).engage()
    is_watched = True
    pair.swallow = lambda side, data: side is pair.slave and kind_of(data) == Kind.CHANGE
    assert pair.master.endpoint.propose_change(pair.now, pair.ticks + 1000, b"change")
    pair.run(1.0)
    assert len(sent(pair, Kind.CHANGE, pair.master)) > 100


@pytest.mark.parametrize("lasts", [0.12, 0.3])
def test_what_ends_a_silence_counts_so_that_the_robot_is_led_again_within_two_round_trips(lasts: float) -> None:
    def renew(pair: Pair, now: float, _tick: int) -> None:
        for side in pair.sides:
            side.renew(now, round(now / TICK) + 1)

    to_master, by_slave = {"incoming": (forms(3),)}, {"outgoing": (forms(3),)}
    pair = Pair(link=Emulation(delay_s=0.02), on_tick=renew, master=to_master, slave=by_slave).connect().run(0.6)
    pair.swallow = lambda side, data: side is pair.master
    pair.run(lasts)
    assert not pair.slave.endpoint.may_follow(pair.now)
    pair.swallow = lambda side, data: False
    pair.master.send(pair.now, round(pair.now / TICK) + 1)
    pair.run(0.08)
    assert pair.slave.endpoint.may_follow(pair.now)
