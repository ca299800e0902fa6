"""A session over good and bad links: updates, silence, return, restarts, roaming, time."""

from itertools import pairwise

import pytest

from tests.protocol.harness import (
    GAP,
    MASTER,
    SILENCE,
    Pair,
    Side,
    forms,
    make_endpoint,
    sample_update,
    suites,
)
from weberlink.protocol import (
    Connected,
    DropReason,
    PeerReturned,
    PeerSilent,
    Role,
    SessionExpired,
    State,
    UpdateLost,
    UpdateReceived,
)
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.heartbeat import HeartbeatSchedule
from weberlink.protocol.security import Security
from weberlink.protocol.session import EXPIRY
from weberlink.protocol.wire import Kind, kind_of
from weberlink.update import ModelParameters, PreviousSample, Update

DARK = Emulation(loss=1.0)
STORM = Emulation(
    delay_s=0.01, jitter_s=0.01, loss=0.3, burst=20.0, reorder=0.1, duplicate=0.1, corrupt=0.05, rate_bit_s=2e6
)


def matches(event: UpdateReceived, tick: int) -> bool:
    return event.update == sample_update(tick)


@pytest.mark.parametrize("security", suites())
def test_updates_arrive_once_and_unchanged(security: Security) -> None:
    sent: list[int] = []

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        if tick > 200 and tick % 7 == 0 and tick < 2000:
            sent.append(pair.master.send(pair.now, pair.ticks))

    pair = Pair(master={"security": security}, slave={"security": security}, on_tick=on_tick).engage().run(2.0)
    received = pair.slave.updates()
    assert [event.update.tick for event in received] == sent
    assert all(matches(event, event.update.tick) for event in received)
    assert all(event.age == pytest.approx(0.001, abs=2e-5) for event in received)
    assert pair.master.endpoint.statistics.repeats == 0
    assert (
        pair.slave.endpoint.statistics.updates_received[0]
        == pair.master.endpoint.statistics.updates_sent[0]
        == len(sent)
    )


def test_updates_are_dated_although_first_reports_are_lost() -> None:
    """The master floods updates from the first moment; its first three heartbeats never arrive."""
    heartbeats = 0

    def swallow(side: Side, data: bytes) -> bool:
        nonlocal heartbeats
        heartbeats += side is pair.master and kind_of(data) == Kind.HEARTBEAT
        return side is pair.master and kind_of(data) == Kind.HEARTBEAT and heartbeats <= 3

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        pair.master.endpoint.send_update(now, sample_update(tick))

    pair = Pair(on_tick=on_tick)
    pair.swallow = swallow
    pair.connect().run(0.2)
    assert set(pair.slave.faults()) == {DropReason.UNTIMED}
    assert pair.slave.received_at[0][0] < 0.1


def test_no_update_without_a_session() -> None:
    pair = Pair().connect()
    assert not pair.master.endpoint.send_update(0.0, sample_update(1))
    assert pair.master.endpoint.statistics.updates_sent[0] == 0


def test_invalid_updates_raise_and_send_nothing() -> None:
    endpoint = Pair().engage().master.endpoint
    sent = endpoint.statistics.sent
    for update, message in (
        (Update(-1, 0, (1, 2, 3)), "tick"),
        (Update(1, 8, (1, 2, 3)), "selector"),
        (Update(1, 0, (1, 2)), "3 levels"),
        (Update(1, 0, (1, 2, 40_000)), "int16"),
        (Update(1, 0, (1, 2, 3), PreviousSample(0, (1, 2, 3))), "gap"),
        (Update(1, 0, (1, 2, 3), PreviousSample(70_000, (1, 2, 3))), "gap"),
        (Update(1, 0, (1, 2, 3), PreviousSample(5, (1, 2, 3, 4))), "3 levels"),
        (Update(1, 0, (1, 2, 3), ModelParameters(b"1")), "previous sample"),
    ):
        with pytest.raises(ValueError, match=message):
            endpoint.send_update(0.3, update)
    assert endpoint.statistics.sent == sent


@pytest.mark.parametrize(("security", "seed"), [(suites()[0], 0), (suites()[1], 1)])
def test_nothing_false_or_old_is_delivered_over_a_bad_link(security: Security, seed: int) -> None:
    """30 % loss in bursts of 20, reordering, duplicates and bit errors, both ways, for 5 s of updates at 100 Hz."""
    sent: dict[Role, list[int]] = {Role.INITIATOR: [], Role.RESPONDER: []}
    renewals = {Role.INITIATOR: 0, Role.RESPONDER: 0}

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        for side in pair.sides:
            role = side.endpoint.role
            is_new = side.renewals > renewals[role]  # what the peer held is void or old: the owner sends anew
            renewals[role] = side.renewals
            if is_new or (tick % 10 == 0 and 200 < tick < 5_000 and side.sessions):
                sent[role].append(side.send(pair.now, pair.ticks))

    changes = {"security": security, "incoming": (forms(3),), "outgoing": (forms(3),)}
    pair = Pair(forward=STORM, backward=STORM, seed=seed, master=changes, slave=changes, on_tick=on_tick)
    pair.connect().run(6.0)
    pair.forward, pair.backward = pair.link(None), pair.link(None)
    pair.run(1.0)
    for sender, receiver in (pair.sides, pair.sides[::-1]):
        ticks = [event.update.tick for event in receiver.updates()]
        assert ticks == sorted(ticks), f"seed {seed}"
        assert set(ticks) <= set(sent[sender.endpoint.role])
        assert all(matches(event, event.update.tick) for event in receiver.updates())
        assert all(event.age <= 0.1 for event in receiver.updates())
        departures = [at for at, side, data in pair.tap if side is sender and kind_of(data) == Kind.UPDATE]
        for at, event in receiver.received_at:  # the age that was told is that by the clock of the world
            left_at = at - event.age
            assert min(abs(left_at - departure) for departure in departures) < 0.01, f"seed {seed}"
        assert ticks[-1] == sent[sender.endpoint.role][-1], "the newest state is there in the end"
        statistics = sender.endpoint.statistics
        assert statistics.repeats <= 200 * 6.0
        assert receiver.endpoint.statistics.dropped[DropReason.BAD_TAG] > 0


def test_repeats_end_in_a_blackout() -> None:
    pair = Pair().engage()
    pair.forward, pair.backward = pair.link(DARK), pair.link(DARK)
    pair.master.send(pair.now, pair.ticks)
    pair.run(0.3)
    repeats = pair.master.endpoint.statistics.repeats
    assert pair.master.endpoint.state is State.SILENT
    pair.run(30.0)
    assert pair.master.endpoint.statistics.repeats == repeats <= 20


def test_short_blackout_keeps_session_and_restores_newest_state() -> None:
    last = renewals = 0

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        nonlocal last, renewals
        is_new, renewals = pair.master.renewals > renewals, pair.master.renewals
        if is_new or (300 < tick < 700 and tick % 5 == 0):
            last = pair.master.send(pair.now, pair.ticks)

    dark = Emulation(delay_s=0.001, blackouts=((0.4, 0.4),))
    pair = Pair(forward=dark, backward=dark, on_tick=on_tick).engage().run(1.3)
    # A call made in the silence may win against the old session; then the owners begin anew, as they are told.
    assert pair.master.of(PeerSilent)
    assert pair.slave.of(PeerSilent)
    assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    assert pair.slave.of(PeerReturned) or len(pair.slave.of(Connected)) == 2
    assert matches(pair.slave.updates()[-1], last)


@pytest.mark.parametrize("delay", [0.001, 0.05, 0.15])
@pytest.mark.parametrize("toward", ["slave", "master"])
def test_one_way_cut_silences_both_within_the_limits(toward: str, delay: float) -> None:
    """Each end that hears nothing falls silent after one limit, the other after both; they return together."""
    slow = Emulation(delay_s=delay)
    pair = Pair(forward=slow, backward=slow).connect().run(3.0)
    for side in pair.sides:
        side.events.clear()
    deaf, heard = pair.sides[::-1] if toward == "slave" else pair.sides
    clear = pair.forward, pair.backward
    if toward == "slave":
        pair.forward = pair.link(DARK)
    else:
        pair.backward = pair.link(DARK)
    cut = pair.now
    pair.run(delay + SILENCE + 0.002)
    assert deaf.endpoint.state is State.SILENT
    while pair.now < cut + SILENCE + heard.endpoint.liveness.round_trip + 0.002:
        pair.run(0.001)
    assert [side.endpoint.state for side in pair.sides] == [State.SILENT] * 2
    assert deaf.of(PeerSilent) == [PeerSilent(is_heard=False)]
    assert heard.of(PeerSilent) == [PeerSilent(is_heard=True)]
    pair.forward, pair.backward = clear
    pair.run(0.6 + 4.0 * delay)
    assert [side.endpoint.state for side in pair.sides] == [State.ENGAGED] * 2
    for side in pair.sides:
        assert side.of(PeerReturned) or side.of(Connected)


def test_a_peer_that_falls_silent_after_it_was_only_unheard_is_reported_as_silent() -> None:
    pair = Pair().engage().run(0.5)
    pair.forward = pair.link(DARK)
    pair.run(SILENCE + 0.02)
    assert pair.master.of(PeerSilent) == [PeerSilent(is_heard=True)]
    pair.backward = pair.link(DARK)
    pair.run(0.5 * SILENCE)
    assert pair.master.of(PeerSilent) == [PeerSilent(is_heard=True)]
    pair.run(0.6 * SILENCE)
    assert pair.master.of(PeerSilent) == [PeerSilent(is_heard=True), PeerSilent(is_heard=False)]
    assert pair.slave.of(PeerSilent) == [PeerSilent(is_heard=False)]


def test_session_expires_after_silence_and_another_follows() -> None:
    pair = Pair().engage()
    clear = pair.forward, pair.backward
    pair.forward = pair.link(DARK)
    pair.run(SILENCE + EXPIRY + 0.15)
    assert len(pair.master.of(SessionExpired)) == len(pair.slave.of(SessionExpired)) == 1
    assert pair.master.endpoint.state is State.CONNECTING
    assert pair.slave.endpoint.state is State.LISTENING
    pair.forward, pair.backward = clear
    pair.run(1.0)
    assert [side.endpoint.state for side in pair.sides] == [State.ENGAGED] * 2
    assert [len(side.of(Connected)) for side in pair.sides] == [2, 2]


def test_a_stale_update_is_never_delivered() -> None:
    pair = Pair().engage()
    pair.master.send(pair.now, pair.ticks)
    held = pair.master.endpoint.datagrams_to_send()
    pair.run(SILENCE + 0.5 * pair.slave.endpoint.liveness.round_trip + 0.005)
    for data, _ in held:
        pair.slave.endpoint.receive_datagram(data, MASTER, pair.now)
    pair.run(0.003)
    assert not [event for event in pair.slave.updates() if event.age > 0.1]
    assert pair.slave.faults().count(DropReason.STALE) == 1
    pair.run(0.3)
    assert len(pair.slave.updates()) == 1, "what was held back is repeated, with a new time stamp"


def test_an_update_that_is_refused_for_its_loop_age_is_no_sign_of_the_encoder() -> None:
    """Somebody lets heartbeats pass, and holds every update for a while: fresh, but not executed."""
    ends = {"longest_round_trip": 0.01}
    pair = Pair(master=ends, slave=ends).engage()
    pair.master.send(pair.now, pair.ticks)
    pair.run(0.05)
    held: list[tuple[float, bytes]] = []

    def hold(side: Side, data: bytes) -> bool:
        if side is pair.master and kind_of(data) == Kind.UPDATE:
            if pair.now - side.endpoint.liveness.heard_at > 0.015:  # what it echoes makes its loop age too large
                held.append((pair.now, data))
            return True
        return False

    pair.swallow = hold
    taken, delivered = len(pair.slave.updates()), 0
    for _ in range(60):
        pair.master.send(pair.now, pair.ticks)
        pair.run(0.005)
        while held and held[0][0] < pair.now - 0.0985:
            pair.slave.endpoint.receive_datagram(held.pop(0)[1], MASTER, pair.now)
            delivered += 1
    assert delivered > 10
    assert len(pair.slave.updates()) == taken
    assert not pair.slave.endpoint.is_peer_encoding(pair.now)


def test_a_stale_datagram_does_not_count_as_being_heard() -> None:
    pair = Pair().engage()
    pair.master.send(pair.now, pair.ticks)
    held = pair.master.endpoint.datagrams_to_send()
    pair.forward = pair.link(DARK)
    pair.run(0.5)
    heard = pair.slave.endpoint.liveness.heard_at
    for data, _ in held:
        pair.slave.endpoint.receive_datagram(data, ("203.0.113.9", 9), pair.now)
    pair.run(0.001)
    assert pair.slave.endpoint.state is State.SILENT
    assert pair.slave.endpoint.liveness.heard_at == heard
    assert pair.slave.endpoint.peer == MASTER


@pytest.mark.parametrize("toward", ["slave", "master"])
def test_asymmetric_path_does_not_halve_the_age(toward: str) -> None:
    """152 ms one way and nothing back is 76 ms by the mapped clocks, which believe in halves."""
    ends = {"longest_round_trip": 0.05}
    pair = Pair(master=ends, slave=ends).engage()
    slow = pair.link(Emulation(delay_s=0.152))
    if toward == "slave":
        pair.forward = slow
    else:
        pair.backward = slow
    sender, receiver = pair.sides if toward == "slave" else pair.sides[::-1]
    pair.run(0.1)
    before = len(receiver.updates())
    for _ in range(500):
        pair.run(0.02)
        if sender.sessions:
            sender.endpoint.send_update(pair.now, Update(pair.ticks, 0, (1,) * (3 if toward == "slave" else 6)))
    assert len(receiver.updates()) == before
    assert not any(side.endpoint.state is State.ENGAGED for side in pair.sides)


def test_a_replayed_datagram_is_dropped() -> None:
    pair = Pair().engage()
    pair.master.send(pair.now, pair.ticks)
    pair.run(0.01)
    for _, side, data in pair.tap:
        if side is pair.master and kind_of(data) != Kind.HELLO:
            pair.slave.endpoint.receive_datagram(data, ("203.0.113.9", 9), pair.now)
    pair.run(0.001)
    assert set(pair.slave.faults()) == {DropReason.REPLAYED}
    assert pair.slave.endpoint.peer == MASTER
    assert len(pair.slave.updates()) == 1


def test_a_reflected_datagram_is_dropped() -> None:
    for security in suites():
        pair = Pair(master={"security": security}, slave={"security": security}).engage()
        for _, side, data in pair.tap:
            if side is pair.slave and kind_of(data) == Kind.HEARTBEAT:
                pair.slave.endpoint.receive_datagram(data, MASTER, pair.now)
        pair.run(0.001)
        assert set(pair.slave.faults()) == {DropReason.BAD_TAG}


def test_only_the_peer_is_heard_by_the_master() -> None:
    pair = Pair().engage()
    data = next(data for _, side, data in pair.tap if side is pair.slave)
    pair.master.endpoint.receive_datagram(data, ("203.0.113.9", 9), pair.now)
    pair.run(0.001)
    assert pair.master.faults() == [DropReason.FOREIGN_ADDRESS]


def test_the_master_may_roam() -> None:
    pair = Pair().engage()
    elsewhere = ("198.51.100.7", 1234)
    pair.slave.endpoint.receive_datagram(bytes(40), elsewhere, pair.now)
    assert pair.slave.endpoint.peer == MASTER, "anyone can send from anywhere"
    pair.master.address = elsewhere
    tick = pair.master.send(pair.now, pair.ticks)
    pair.run(0.3)
    assert pair.slave.endpoint.peer == elsewhere
    assert matches(pair.slave.updates()[-1], tick)
    assert pair.master.endpoint.state is State.ENGAGED
    assert len(pair.slave.of(Connected)) == 1


def test_overtaken_datagram_does_not_move_the_peer_back() -> None:
    pair = Pair().engage()
    pair.master.send(pair.now, pair.ticks)
    (held, _) = pair.master.endpoint.datagrams_to_send()[0]
    pair.master.address = ("198.51.100.7", 1234)
    for step in range(10):
        pair.master.send(pair.now, pair.ticks + step)
        pair.run(0.01)
    assert pair.slave.endpoint.peer == pair.master.address
    pair.slave.endpoint.receive_datagram(held, MASTER, pair.now)
    assert pair.slave.endpoint.peer == pair.master.address


def test_a_restarted_slave_drops_data_until_it_is_called() -> None:
    pair = Pair().engage()
    pair.slave.endpoint = make_endpoint(Role.RESPONDER, seed=50)
    pair.slave.endpoint.connect(pair.now)
    for _ in range(20):
        pair.master.send(pair.now, pair.ticks)
        pair.run(0.005)
    assert set(pair.slave.faults()) == {DropReason.NO_SESSION}
    pair.run(0.5)
    assert len(pair.master.of(Connected)) == 2
    assert pair.slave.endpoint.state is State.ENGAGED
    tick = pair.master.send(pair.now, pair.ticks)
    pair.run(0.1)
    assert matches(pair.slave.updates()[-1], tick)


def test_a_restarted_master_takes_the_session_over() -> None:
    pair = Pair().engage()
    old = pair.master.endpoint
    pair.master.endpoint = make_endpoint(Role.INITIATOR, seed=51, epoch=pair.now, take_over=True)
    pair.master.endpoint.connect(pair.now)
    pair.run(0.05)
    assert len(pair.slave.of(Connected)) == 2
    old.send_update(pair.now, sample_update(1))
    for data, _ in old.datagrams_to_send():
        pair.slave.endpoint.receive_datagram(data, MASTER, pair.now)
    pair.run(0.05)
    assert pair.slave.faults() == [DropReason.WRONG_SESSION]
    assert pair.slave.endpoint.state is State.ENGAGED


def test_heartbeats_keep_their_gap_and_their_absence_is_silence() -> None:
    """Two ends at rest send three datagrams per reach together."""
    pair = Pair().engage().run(1.0)
    heard = pair.slave.endpoint.liveness.heard_at
    before = len(pair.tap)
    pair.run(10.0)
    assert pair.slave.endpoint.liveness.heard_at > heard
    schedule = HeartbeatSchedule(0.0, silence=SILENCE, tick_period=0.001)
    schedule.adapt(0.0, 0.0, 0.002, 0.0, pair.master.endpoint.liveness.round_trip)  # 1 ms each way
    assert len(pair.tap) - before == pytest.approx(10.0 * 3.0 / schedule.reach, rel=0.05)
    for side in pair.sides:
        times = [at for at, sender, _ in pair.tap[before:] if sender is side]
        assert len(times) <= 25.0 * 10.0
        assert max(later - earlier for earlier, later in pairwise(times)) <= GAP + 1e-6
        assert not side.of(PeerSilent)
    pair.forward = pair.link(DARK)
    pair.run(0.3)
    assert pair.slave.of(PeerSilent) == [PeerSilent(is_heard=False)]


@pytest.mark.parametrize(("loss", "delay"), [(0.02, 0.15), (0.01, 0.045), (0.1, 0.005), (0.3, 0.0005)])
def test_losses_on_a_long_path_cause_no_silence(loss: float, delay: float) -> None:
    lossy = Emulation(delay_s=delay, loss=loss)
    pair = Pair(forward=lossy, backward=lossy, seed=21).connect().run(10.0)
    for side in pair.sides:
        side.events.clear()
    pair.run(15.0)
    assert not pair.master.of(PeerSilent), "seed 21"
    assert not pair.slave.of(PeerSilent), "seed 21"
    assert pair.slave.endpoint.statistics.incoming_loss == pytest.approx(loss, abs=0.15)
    assert pair.master.endpoint.statistics.outgoing_loss == pytest.approx(loss, abs=0.15)
    assert pair.slave.endpoint.statistics.lost == pytest.approx(pair.forward.counters.lost, abs=20)


@pytest.mark.parametrize(("offset", "drift"), [(0.0, 0.0), (5000.0, 100e-6), (-77.7, -100e-6)])
def test_the_clocks_are_mapped_with_offset_drift_and_jitter(offset: float, drift: float) -> None:
    jittery = Emulation(delay_s=0.01, jitter_s=0.005)
    errors: list[float] = []

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        if now > 2.0:
            local = pair.slave.local(now)
            mapped = pair.slave.endpoint.peer_time(local)
            assert mapped is not None
            errors.append(abs(mapped - now))
        if now > 0.5 and tick % 20 == 0:
            pair.master.send(pair.now, pair.ticks)

    pair = Pair(
        forward=jittery,
        backward=jittery,
        offsets=(0.0, 1e6 + offset),
        drifts=(0.0, drift),
        slave={"epoch": 1e6},
        on_tick=on_tick,
        every=10,  # the map changes with datagrams only
    )
    pair.connect().run(15.0)
    # Half the window times the drift, and what is left of the jitter in the minima of the two directions.
    assert max(errors) < 4.0 * abs(drift) + 0.0015
    statistics = pair.slave.endpoint.statistics
    assert statistics.rtt == pytest.approx(0.025, abs=0.006)
    assert statistics.one_way == pytest.approx(0.0125, abs=0.004)
    assert [event.update.tick for event in pair.slave.updates()][-1] > 14_000


@pytest.mark.parametrize("asleep", [0.3, 20.0])
@pytest.mark.parametrize("sleeper", [0, 1])
def test_a_machine_that_slept_is_found_again(sleeper: int, asleep: float) -> None:
    """Its monotonic clock stands still meanwhile: seen from it, the other one has jumped ahead."""
    pair = Pair().engage()
    pair.sides[1 - sleeper].offset += asleep
    pair.run(10.0)
    assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    for side, other in (pair.sides, pair.sides[::-1]):
        assert side.endpoint.peer_time(side.local(pair.now)) == pytest.approx(other.local(pair.now), abs=1e-3)
    tick = pair.master.send(pair.now, int(pair.master.local(pair.now) * 1000))
    pair.run(0.1)
    assert matches(pair.slave.updates()[-1], tick)


def test_time_stamps_and_ticks_go_on_past_their_wrap() -> None:
    """The stamp wraps after 168 s, the tick after 16777 s at 1 kHz."""
    age = 2**24 * 0.001 - 1.0
    sent: list[int] = []

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        if tick > 200 and tick % 10 == 0 and tick < 2900:
            sent.append(pair.master.send(pair.now, round((now + age) * 1000)))

    pair = Pair(master={"epoch": -age}, slave={"epoch": 1000 - 2**24 * 1e-5}, on_tick=on_tick).engage().run(3.0)
    assert sent[0] < 2**24 < sent[-1]
    assert [event.update.tick for event in pair.slave.updates()] == sent
    assert all(event.age == pytest.approx(0.001, abs=1e-4) for event in pair.slave.updates())
    assert not pair.slave.faults()
    assert not pair.master.faults()


def test_one_wrong_stamp_does_not_move_the_mapping() -> None:
    for jump in (-60.0, -0.3, 0.3, 5.0, 60.0, 1e7):
        pair = Pair().engage()
        before = pair.slave.endpoint.peer_time(pair.now)
        pair.master.endpoint.send_update(pair.now + jump, sample_update(pair.ticks))
        for data, _ in pair.master.endpoint.datagrams_to_send():
            pair.slave.endpoint.receive_datagram(data, MASTER, pair.now)
        pair.slave.collect(pair.now)
        assert pair.slave.endpoint.peer_time(pair.now) == pytest.approx(before, abs=1e-4)
        assert not pair.slave.updates()
        assert set(pair.slave.faults()) <= {DropReason.IMPLAUSIBLE, DropReason.STALE}
        assert pair.slave.faults()


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", DropReason.TRUNCATED),
        (b"\x03", DropReason.TRUNCATED),
        (b"\x00" * 40, DropReason.WRONG_LENGTH),
        (b"\x07" * 40, DropReason.UNKNOWN_KIND),
        (b"\x03" * 200, DropReason.WRONG_LENGTH),
        (b"\x04" * 38, DropReason.BAD_TAG),
        (b"\x01" * 5000, DropReason.WRONG_LENGTH),
        (b"\x01" * 600, DropReason.UNPROVEN),
        (b"\x01" * 40, DropReason.TRUNCATED),
        (b"\x01", DropReason.TRUNCATED),
    ],
)
def test_each_bad_datagram_has_its_reason(data: bytes, reason: DropReason) -> None:
    pair = Pair().engage()
    pair.slave.endpoint.receive_datagram(data, MASTER, pair.now)
    pair.slave.collect(pair.now)
    assert pair.slave.faults() == [reason]


def test_a_peer_that_forgets_asks_for_a_complete_update() -> None:
    """One end alone forgets the updates, as after a stall that the other did not notice; only acks tell the other."""
    pair = Pair().engage()
    pair.master.send(pair.now, pair.ticks)
    pair.run(0.1)
    pair.slave.endpoint.report_encoding(pair.now, is_encoding=True)
    assert not pair.master.of(UpdateLost)
    assert pair.slave.endpoint.is_peer_encoding(pair.now)
    pair.slave.endpoint.request_full_state()
    pair.run(SILENCE + 0.05)
    assert UpdateLost(0) in pair.master.of(UpdateLost)
    assert not pair.slave.endpoint.is_peer_encoding(pair.now)
    pair.master.send(pair.now, pair.ticks)
    pair.run(0.05)
    assert pair.slave.endpoint.is_peer_encoding(pair.now)
