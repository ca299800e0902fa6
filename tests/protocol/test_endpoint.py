"""Two endpoints: single edges that `test_endpoint_machine` does not reach, and bounds on what is sent."""

from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.protocol.harness import (
    AGREEMENT,
    GAP,
    MASTER,
    MENDED_WITHIN,
    SILENCE,
    SLAVE,
    Pair,
    Side,
    forms,
    make_endpoint,
    sample_update,
    suites,
)
from weberlink.protocol import (
    Address,
    ChangeProposed,
    Connected,
    DropReason,
    Endpoint,
    PeerClosed,
    PeerSilent,
    Refused,
    Role,
    State,
    StateError,
    TakenOver,
    UpdateLost,
)
from weberlink.protocol.checksum import Checksum
from weberlink.protocol.dialer import FIRST_INTERVAL, LONGEST_INTERVAL, Answer, Dialer
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.handshake import (
    HELLO_HEADER,
    INSTANCE_BYTES,
    PROTOCOL_VERSION,
    Hello,
    HelloHeader,
    LocalEnd,
    Welcome,
    identity_of,
    pack_hello,
    pack_map,
    read_answered,
    read_hello_header,
)
from weberlink.protocol.heartbeat import ASK_PACE, DENSEST, HeartbeatSchedule
from weberlink.protocol.liveness import FADE_SHARE
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.retransmission import LEAST_EARLY_PER_S, SHORTEST_PACE
from weberlink.protocol.security import Security
from weberlink.protocol.session import LONGEST_SILENCE
from weberlink.protocol.wire import MARK, Kind, kind_of
from weberlink.update import ModelParameters, PreviousSample, Update

OTHER: Address = ("192.0.2.9", 40_009)
STRANGER: Address = ("203.0.113.9", 9)
OTHER_KEY = PresharedKey(bytes(32))
DARK = Emulation(loss=1.0)
by_suite = pytest.mark.parametrize("security", suites())


def both(**changes: object) -> dict[str, dict[str, object]]:
    """Arguments of a pair whose ends have the same changes."""
    return {"master": changes, "slave": changes}


def named(**changes: object) -> Pair:
    return Pair(master={"name": "ann@operator", **changes}, slave={"name": "robot:47000", **changes}).engage()


def join(pair: Pair, address: Address = OTHER, **changes: object) -> Side:
    """A second master, which calls the same slave."""
    other = make_endpoint(Role.INITIATOR, **{"seed": 77, "name": "bob@desk", **changes})  # type: ignore[arg-type]
    other.connect(pair.now)
    pair.guests.append(Side(other, address))
    return pair.guests[-1]


def states(pair: Pair) -> list[State]:
    return [side.endpoint.state for side in pair.sides]


ENGAGED = [State.ENGAGED] * 2


def sent(pair: Pair, kind: Kind, side: Side | None = None) -> list[bytes]:
    return [data for _, sender, data in pair.tap if kind_of(data) == kind and side in (None, sender)]


# --- how two ends find each other, or refuse to


@by_suite
@pytest.mark.parametrize("streams", [1, 2])
def test_both_ends_connect_with_what_they_agreed(security: Security, streams: int) -> None:
    layouts = {"outgoing": (forms(3),) * streams, "incoming": (forms(3),) * streams}
    pair = Pair(**both(security=security, **layouts)).engage()
    assert pair.master.of(Connected) == [Connected(SLAVE, AGREEMENT)]
    assert pair.slave.of(Connected) == [Connected(MASTER, AGREEMENT)]
    assert states(pair) == ENGAGED and not pair.master.faults() and not pair.slave.faults()
    for step in range(100):
        pair.master.send(pair.now, pair.ticks, step % streams)
        pair.flush(pair.master)
        pair.run(0.007)
    counts = [100 // streams if stream < streams else 0 for stream in range(2)]
    assert pair.master.endpoint.statistics.updates_sent == pair.slave.endpoint.statistics.updates_received == counts
    assert pair.master.endpoint.statistics.repeats == 0
    assert all(event.age == pytest.approx(0.001, abs=2e-5) for event in pair.slave.updates())
    assert pair.slave.endpoint.statistics.lost == 0


def test_hello_is_repeated_with_growing_pauses_until_someone_answers() -> None:
    pair = Pair()
    pair.master.endpoint.connect(0.0)
    pair.run(3.0)
    pauses = [round(later - earlier, 9) for earlier, later in pairwise(at for at, _, _ in pair.tap)]
    assert FIRST_INTERVAL <= pauses[0] <= 1.5 * FIRST_INTERVAL and pauses == sorted(pauses)
    assert pauses[-1] == pytest.approx(LONGEST_INTERVAL)
    pair.slave.endpoint.connect(pair.now)
    pair.run(0.6)
    assert states(pair) == ENGAGED


@pytest.mark.parametrize(
    ("one_way", "longest", "loss"), [(0.045, 0.1, 0.0), (0.9, 2.0, 0.0), (1.8, 4.0, 0.0), (0.02, 0.4, 0.3)]
)
def test_a_call_is_answered_however_long_or_lossy_the_path(one_way: float, longest: float, loss: float) -> None:
    """HELLOs are repeated before the first answer is back; the slave keeps the session of each that long."""
    for seed in range(8 if loss else 1):
        link = Emulation(delay_s=one_way, jitter_s=0.03 * loss, loss=loss, duplicate=0.5 * loss, reorder=0.5 * loss)
        pair = Pair(forward=link, backward=link, seed=seed, **both(longest_round_trip=longest))
        pair.connect().run(3.0 if loss else 3.2 * one_way)
        assert states(pair) == ENGAGED, f"seed {seed}"
        assert loss or len(pair.slave.of(Connected)) == 1


@by_suite
@pytest.mark.parametrize(
    ("master", "slave", "said"),
    [
        ({}, {"agreement": {**AGREEMENT, "codec.force.weber": 0.05}}, ("codec.force.weber", "0.1", "0.05")),
        ({}, {"version": PROTOCOL_VERSION - 1}, (str(PROTOCOL_VERSION), str(PROTOCOL_VERSION - 1))),
        ({"expects": "robot:47000"}, {"name": "toy:47000"}, ("'robot:47000'", "'toy:47000'")),
        ({"name": "bob@desk"}, {"expects": "ann@operator"}, ("'slave'", "'ann@operator'", "'bob@desk'")),
        ({"name": "bob@desk", "take_over": True}, {"expects": "ann@operator"}, ("'bob@desk'",)),
    ],
)
def test_ends_that_do_not_agree_are_both_told_why(
    security: Security, master: dict[str, object], slave: dict[str, object], said: tuple[str, ...]
) -> None:
    """Also if the first refusals are lost. The slave listens on."""
    pair = Pair(
        backward=Emulation(delay_s=0.001, blackouts=((0.0, 0.3),)),
        master={"security": security, **master},
        slave={"security": security, **slave},
    )
    pair.connect().run(1.5)
    assert all(part in pair.master.refusal() for part in said)
    assert set(pair.slave.of(Refused)) == set(pair.master.of(Refused))
    assert states(pair) == [State.CLOSED, State.LISTENING]
    pair.guests.append(Side(make_endpoint(Role.INITIATOR, security=security, seed=9, name="ann@operator"), OTHER))
    if "agreement" not in slave and "version" not in slave:
        pair.guests[0].endpoint.connect(pair.now)
        assert pair.run(0.3).guests[0].endpoint.state is State.ENGAGED


@by_suite
@pytest.mark.parametrize(
    ("is_heard", "changes", "said"),
    [
        (True, {}, ("'ann@operator'", "--take-over")),
        (True, {"name": "ann@operator"}, ("another run of",)),
        (False, {}, ("'ann@operator'",)),
    ],
)
def test_a_slave_serves_one_master(
    security: Security, is_heard: bool, changes: dict[str, object], said: tuple[str, ...]
) -> None:
    """Also in a silence of it. The refused call changes nothing, and no event tells of it."""
    pair = named(security=security)
    pair.swallow = lambda side, data: side is pair.master and not is_heard
    pair.run(0.15)
    other = join(pair, security=security, **changes)
    pair.run(0.3)
    assert all(part in other.refusal() for part in said)
    assert len(pair.slave.of(Connected)) == 1 and not pair.slave.of(Refused)
    assert pair.slave.faults() == [DropReason.REFUSED]
    assert pair.slave.endpoint.peer_name == "ann@operator"


@pytest.mark.parametrize("security", [OTHER_KEY, Checksum()])
def test_another_key_or_suite_gets_no_answer(security: Security) -> None:
    pair = Pair(slave={"security": security}).connect().run(0.5)
    assert set(pair.slave.faults()) == {DropReason.UNPROVEN} and len(pair.slave.faults()) >= 4
    assert not [data for _, side, data in pair.tap if side is pair.slave]


@by_suite
@pytest.mark.parametrize("keys", [0, 1, 25])
def test_no_answer_is_longer_than_its_question(security: Security, keys: int) -> None:
    agreement: dict[str, object] = {f"a.rather.long.path.number.{index}": index for index in range(keys)}
    for other in (agreement, {**agreement, "x": "y" * 500}, {f"{key}!": 1.5 for key in agreement}):
        ends = {"security": security, "agreement": agreement}
        pair = Pair(master=ends, slave={**ends, "agreement": other}).connect().run(0.2)
        hellos, welcomes = sent(pair, Kind.HELLO), sent(pair, Kind.WELCOME)
        assert 0 < len(welcomes) <= len(hellos)
        assert max(map(len, welcomes)) <= min(map(len, hellos))


def test_authentic_random_bytes_are_malformed() -> None:
    """A peer with the key, or any sender where there is no key, may send any body."""
    random = Random(5)
    for security in suites():
        slave = make_endpoint(Role.RESPONDER, security=security)
        slave.connect(0.0)
        for size in range(600, 640):
            header = HelloHeader(PROTOCOL_VERSION, bytes(8), size).pack()
            hello = security.call(header, random.randbytes(security.private_size)).hello(random.randbytes(size))
            slave.receive_datagram(header + hello, MASTER, 0.0)
        assert slave.statistics.dropped == {DropReason.MALFORMED: 40}
        payload = pack_hello(Hello(b"", 0, "ann", bytes(INSTANCE_BYTES), "", False, 400_000, 0), security.overhead)
        for identity in (identity_of("ann"), identity_of("bob")):  # without an agreement; of another name
            header = HelloHeader(PROTOCOL_VERSION, identity, 2000).pack()
            hello = security.call(header, bytes(security.private_size)).hello(payload)
            assert dropped(slave, header + hello, MASTER) == [DropReason.MALFORMED]


def dropped(endpoint: Endpoint, data: bytes, source: Address, now: float = 0.2) -> list[DropReason]:
    """Why an end drops a datagram."""
    before = endpoint.statistics.dropped.copy()
    endpoint.receive_datagram(data, source, now)
    return list((endpoint.statistics.dropped - before).elements())


def test_each_bad_datagram_has_its_reason() -> None:
    pair = Pair().engage()
    (hello, *_), (welcome, *_) = sent(pair, Kind.HELLO), sent(pair, Kind.WELCOME)
    master, slave = (side.endpoint for side in pair.sides)
    heartbeat = sent(pair, Kind.HEARTBEAT, pair.slave)[-1]
    for data, reason in (
        (b"", DropReason.TRUNCATED),
        (b"\x03", DropReason.TRUNCATED),
        (b"\x00" * 40, DropReason.WRONG_LENGTH),
        (b"\x07" * 40, DropReason.UNKNOWN_KIND),
        (b"\x04" * 38, DropReason.BAD_TAG),
        (heartbeat, DropReason.BAD_TAG),  # its own
        (b"\x01" * 4096, DropReason.UNPROVEN),
        (b"\x01" * 4097, DropReason.WRONG_LENGTH),
        (b"\x01" * 40, DropReason.TRUNCATED),
        (welcome, DropReason.UNEXPECTED),
        (hello, DropReason.REPLAYED),
        (HelloHeader(PROTOCOL_VERSION, identity_of("master"), 0).pack() + bytes(500), DropReason.UNPROVEN),
    ):
        assert dropped(slave, data, MASTER) == [reason], data[:1]
    assert dropped(master, heartbeat, STRANGER) == [DropReason.FOREIGN_ADDRESS]
    assert dropped(master, hello, SLAVE) == dropped(master, welcome, SLAVE) == [DropReason.UNEXPECTED]
    caller = make_endpoint(Role.INITIATOR, seed=99)
    caller.connect(0.0)
    own = read_hello_header(caller.datagrams_to_send()[0][0])
    assert own is not None and own.stamp == read_answered(welcome), "for the same stamp"
    assert dropped(caller, welcome, SLAVE) == [DropReason.UNPROVEN]
    assert caller.state is State.CONNECTING
    idle = make_endpoint(Role.RESPONDER)
    assert dropped(idle, hello, MASTER) == [DropReason.UNEXPECTED]
    idle.connect(0.0)
    assert dropped(idle, heartbeat, MASTER) == [DropReason.NO_SESSION]
    slave.close(0.2, "done")
    assert dropped(slave, hello, MASTER) == [DropReason.UNEXPECTED]
    assert slave.state is State.CLOSED and slave.next_timer() is None


def test_calls_in_the_wrong_state_raise_or_do_nothing() -> None:
    endpoint = make_endpoint(Role.INITIATOR)
    assert not endpoint.send_update(0.0, sample_update(1)) and endpoint.statistics.updates_sent == [0, 0]
    assert not endpoint.propose_change(0.0, 10, b"x")
    endpoint.answer_change(ChangeProposed(10, b"x"), None)
    assert not endpoint.datagrams_to_send()
    endpoint.connect(0.0)
    with pytest.raises(StateError, match="DIAL"):
        endpoint.connect(0.0)
    endpoint.close(0.0, "done")
    with pytest.raises(StateError, match="CLOSE"):
        endpoint.close(0.0, "done")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"peer": None}, "peer"),
        ({"tick_period": 0.0}, "tick_period"),
        ({"silence": 0.0}, "silence"),
        ({"silence": LONGEST_SILENCE + 0.1}, "at most 10"),
        ({"silence": 3.3, "tick_period": 1e-4}, "at most 3.2768"),
        ({"longest_round_trip": -0.1}, "longest_round_trip"),
        ({"longest_round_trip": 10.1}, "longest_round_trip"),
        ({"outgoing": (forms(0),)}, "levels"),
        ({"outgoing": ()}, "1 to"),
        ({"outgoing": (forms(3),) * 3}, "1 to"),
        ({"agreement": {"a.b": object()}}, "'a.b'"),
        ({"agreement": {"a.b": "x" * 5000}}, "bytes"),
    ],
)
def test_a_bad_configuration_names_the_argument(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_endpoint(Role.INITIATOR, **changes)


def test_invalid_updates_raise_and_send_nothing() -> None:
    endpoint = Pair().engage().master.endpoint
    before = endpoint.statistics.sent
    for update, message in (
        (Update(-1, 0, (1, 2, 3)), "tick"),
        (Update(1, 8, (1, 2, 3)), "selector"),
        (Update(1, 0, (1, 2)), "3 levels"),
        (Update(1, 0, (1, 2, 32_768)), "int16"),
        (Update(1, 0, (1, 2, 3), PreviousSample(0, (1, 2, 3))), "gap"),
        (Update(1, 0, (1, 2, 3), PreviousSample(65_536, (1, 2, 3))), "gap"),
        (Update(1, 0, (1, 2, 3), PreviousSample(5, (1, 2, 3, 4))), "3 levels"),
        (Update(1, 0, (1, 2, 3), ModelParameters(b"1")), "previous sample"),
    ):
        with pytest.raises(ValueError, match=message):
            endpoint.send_update(0.3, update)
    assert endpoint.statistics.sent == before


def test_streams_may_differ_in_size_and_neither_supersedes_the_other() -> None:
    pair = Pair(
        master={"outgoing": (forms(3), forms(1)), "incoming": (forms(2), forms(6))},
        slave={"outgoing": (forms(2), forms(6)), "incoming": (forms(3), forms(1))},
    ).engage()
    six = Update(200, 2, (1, 2, 3, 4, 5, 6), PreviousSample(1, (6, 5, 4, 3, 2, 1)))
    ours = [(0, sample_update(200)), (1, Update(201, 3, (-7,))), (0, sample_update(202))]
    pair.slave.endpoint.send_update(pair.now, six, stream=1)
    for stream, update in ours:
        pair.master.endpoint.send_update(pair.now, update, stream)
    for data, _ in reversed(pair.master.endpoint.datagrams_to_send()):
        pair.slave.endpoint.receive_datagram(data, MASTER, pair.now + 0.001)
    pair.run(0.01)
    assert [(event.stream, event.update) for event in pair.master.updates()] == [(1, six)]
    assert [(event.stream, event.update) for event in pair.slave.updates()] == [ours[2], ours[1]]
    assert pair.slave.faults() == [DropReason.SUPERSEDED]


# --- who is served


def test_take_over_is_repeated_until_the_slave_serves_the_new_master() -> None:
    """The slave's answer arrives, but for a time nothing that the new master sends under the keys of the session."""
    pair = named()
    other = join(pair, take_over=True)
    pair.swallow = lambda side, data: side is other and kind_of(data) != Kind.HELLO
    pair.run(0.3)
    pair.swallow = lambda side, data: False
    pair.run(0.3)
    assert not other.of(Refused) and pair.slave.endpoint.peer == OTHER
    assert other.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    assert pair.master.of(TakenOver) == [TakenOver("bob@desk")] and not pair.master.of(PeerClosed)
    assert pair.master.endpoint.state is State.CLOSED and pair.master.endpoint.next_timer() is None


@pytest.mark.parametrize("is_deaf", [True, False])
def test_of_two_masters_that_may_take_over_the_last_one_stays(is_deaf: bool) -> None:
    """The first is never told that it was replaced; when it calls again, it does not take the slave back.

    Deaf: of all that the slave sends under the keys of a session, nothing reaches it.
    """
    pair = named()
    first = join(pair, take_over=True)
    deaf = lambda data: is_deaf and pair.slave.endpoint.peer == OTHER and kind_of(data) != Kind.WELCOME  # noqa: E731
    pair.swallow = lambda side, data: side is pair.slave and (kind_of(data) == Kind.BYE or deaf(data))
    pair.run(0.3)
    second = join(pair, ("192.0.2.10", 40_010), take_over=True, seed=78, name="eve@desk")
    pair.run(1.5)
    assert len(first.of(Refused)) == 1 and first.endpoint.state is State.CLOSED
    assert not first.of(TakenOver) and not second.of(TakenOver)
    assert second.endpoint.state is pair.slave.endpoint.state is State.ENGAGED


@by_suite
def test_a_master_keeps_to_the_first_slave_that_answered(security: Security) -> None:
    """A relay swaps to another slave with the same key."""
    pair = named(security=security)
    for name, engages in (("robot:47000", True), ("toy:47000", False)):
        pair.slave.endpoint = make_endpoint(Role.RESPONDER, seed=9, name=name, epoch=pair.now, security=security)
        pair.slave.endpoint.connect(pair.now)
        pair.run(2.0)
        assert states(pair) == (ENGAGED if engages else [State.CLOSED, State.LISTENING])
    assert "'robot:47000'" in pair.master.refusal() and "'toy:47000'" in pair.master.refusal()


@by_suite
def test_each_answer_to_a_call_has_its_outcome(security: Security) -> None:
    """The peer has the key, and may say anything; it may ignore the name that the master expects."""
    end = LocalEnd(security, Random(1).randbytes, b"", 2, 0.0, "ann@operator", "robot:47000", 0.4)
    dialer = Dialer(end, bytes(INSTANCE_BYTES), stamp=lambda now: 1)
    welcome = Welcome(0, 0, "robot:47000", 400_000)._asdict()
    for payload, outcome in (
        (b"\xc1", DropReason.MALFORMED),
        (pack_map({}), DropReason.MALFORMED),
        (pack_map({**welcome, "clock_us": "now"}), DropReason.MALFORMED),
        (pack_map({"newest": "now"}), DropReason.MALFORMED),
        (pack_map({"newest": 0}), DropReason.SUPERSEDED),
        (pack_map({"newest": 10**15}), None),
        (pack_map({"refusal": "not today"}), "not today"),
        (
            pack_map({**welcome, "name": "toy:47000"}),
            "the master expects slave 'robot:47000', and 'toy:47000' answered",
        ),
        (pack_map(welcome), Answer),
    ):
        dialer.start(0.0)
        hello = dialer.hello(0.0)
        heard, header = security.hear(hello[:HELLO_HEADER], hello[HELLO_HEADER:]), read_hello_header(hello)
        assert heard is not None and header is not None
        answered = heard.answer(payload, bytes(security.private_size))
        assert answered is not None
        found = dialer.receive(header.pack_answer() + answered[0])
        assert isinstance(found, Answer) if outcome is Answer else found == outcome
        assert (dialer.due < 0.0) is (outcome is None), "the next one is due at once if the clock went back"


@pytest.mark.parametrize("delay", [0.001, 0.02])
def test_one_of_two_simultaneous_masters_is_served(delay: float) -> None:
    """Both have a pending session; the first datagram under its keys decides."""
    pair = Pair(forward=Emulation(delay_s=delay), master={"name": "ann@operator"}, slave={"name": "robot:47000"})
    pair.connect()
    other = join(pair)
    pair.run(1.0)
    assert {other.endpoint.state, pair.master.endpoint.state} == {State.ENGAGED, State.CLOSED}
    assert len(other.of(Refused) + pair.master.of(Refused)) == len(pair.slave.of(Connected)) == 1


def test_pending_session_expires() -> None:
    """A relay holds the first datagrams of a call that a slave has answered."""
    held: list[bytes] = []
    pair = Pair()
    pair.swallow = lambda side, data: side is pair.master and kind_of(data) != Kind.HELLO and not held.append(data)
    pair.connect().run(0.1)
    pair.swallow = lambda side, data: True
    pair.run(SILENCE + 0.4)
    received = pair.slave.endpoint.statistics.received
    for data in held:
        assert dropped(pair.slave.endpoint, data, MASTER, pair.now) == [DropReason.STALE]
    assert held and pair.slave.endpoint.state is State.LISTENING
    assert pair.slave.endpoint.statistics.received == received


@pytest.mark.parametrize(("loss", "copies"), [(0.0, 1), (0.2, 3)])
def test_a_farewell_is_cut_and_on_a_lossy_link_sent_more_than_once(loss: float, copies: int) -> None:
    """Nothing is repeated after it."""
    pair = Pair(backward=Emulation(delay_s=0.001, loss=loss), seed=4).connect().run(10.0)
    pair.slave.endpoint.close(pair.now, "robot: emergency stop" + "!" * 100)
    pair.run(0.05)
    assert len(sent(pair, Kind.BYE)) == pytest.approx(copies, abs=1 if loss else 0)
    assert pair.master.of(PeerClosed) == [PeerClosed(("robot: emergency stop" + "!" * 100)[:64])]
    assert pair.master.endpoint.state is State.CONNECTING


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
    assert not pair.slave.endpoint.is_peer_encoding(pair.now)


@pytest.mark.parametrize("own", [0, 1])
def test_asymmetric_path_does_not_halve_the_age(own: int) -> None:
    """152 ms one way and nothing back is 76 ms by the mapped clocks, which believe in halves."""
    pair = Pair(**both(longest_round_trip=0.05, outgoing=(forms(3),), incoming=(forms(3),))).engage()
    setattr(pair, ("forward", "backward")[own], pair.link(Emulation(delay_s=0.152)))
    sender, receiver = pair.sides[own], pair.sides[1 - own]
    pair.run(0.1)
    for _ in range(200):
        pair.run(0.02)
        sender.endpoint.send_update(pair.now, sample_update(pair.ticks))
    assert not receiver.updates()
    assert State.ENGAGED not in states(pair)


@pytest.mark.parametrize("delay", [0.001, 0.05, 0.15])
@pytest.mark.parametrize("deaf", [0, 1])
def test_one_way_cut_silences_both_and_tells_who_is_heard(deaf: int, delay: float) -> None:
    """The end that hears nothing falls silent after one limit, the other after both; then the other way is cut too."""
    slow = Emulation(delay_s=delay)
    pair = Pair(forward=slow, backward=slow).connect().run(3.0)
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


def test_overtaken_datagram_does_not_move_the_peer_back() -> None:
    pair = Pair().engage()
    assert dropped(pair.slave.endpoint, bytes(40), STRANGER) and pair.slave.endpoint.peer == MASTER
    pair.master.send(pair.now, pair.ticks)
    ((held, _),) = pair.master.endpoint.datagrams_to_send()
    pair.master.address = STRANGER
    for step in range(10):
        pair.master.send(pair.now, pair.ticks + step)
        pair.run(0.01)
    assert pair.slave.endpoint.peer == STRANGER
    pair.slave.endpoint.receive_datagram(held, MASTER, pair.now)
    assert pair.slave.endpoint.peer == STRANGER and len(pair.slave.of(Connected)) == 1


def test_a_peer_that_forgets_asks_for_a_complete_update() -> None:
    """One end alone forgets the updates, as after a stall that the other did not notice; only acks tell the other."""
    pair = Pair().engage()
    pair.master.send(pair.now, pair.ticks)
    pair.run(0.1)
    assert not pair.master.of(UpdateLost) and pair.slave.endpoint.is_peer_encoding(pair.now)
    pair.slave.endpoint.request_full_state()
    pair.run(SILENCE + 0.05)
    assert UpdateLost(0) in pair.master.of(UpdateLost) and not pair.slave.endpoint.is_peer_encoding(pair.now)
    pair.master.send(pair.now, pair.ticks)
    pair.run(0.05)
    assert pair.slave.endpoint.is_peer_encoding(pair.now)


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
    pair = Pair(seed=seed, forward=link, backward=link, on_tick=on_tick, **ends).engage()
    left = {side.endpoint: iter(fate) for side, fate in zip(pair.sides, fates, strict=True)}
    pair.swallow = lambda side, data: pair.now < ends_at and next(left[side.endpoint], False)
    pair.run(ends_at - pair.now)
    pair.run(MENDED_WITHIN + 2.0 * (delay + 0.002))
    if not pair.master.silences + pair.slave.silences:  # else their owners are told, and begin anew
        arrived = [[event.update.tick for event in pair.slave.updates() if event.stream == each] for each in (0, 1)]
        assert [ticks[-1:] for ticks in arrived] == newest


@pytest.mark.parametrize("missing", [0, 1])
def test_evidence_of_one_stream_brings_its_repeat_forward(missing: int) -> None:
    """The update of one stream is lost, that of the other is not: the acknowledgement of the one tells of both."""
    pair = Pair(**both(outgoing=(forms(3),) * 2, incoming=(forms(3),) * 2)).engage().run(1.0)
    pair.swallow = lambda side, data: side is pair.master
    lost = pair.master.send(pair.now, pair.ticks, missing)
    pair.run(0.004)
    pair.swallow = lambda side, data: False
    pair.master.send(pair.now, pair.ticks, 1 - missing)
    pair.run(0.002)
    pair.slave.send(pair.now, pair.ticks, 0)
    pair.run(0.01)
    assert [event.update.tick for event in pair.slave.updates() if event.stream == missing] == [lost]
    assert pair.master.endpoint.statistics.repeats == 1


def test_heartbeats_keep_their_gap() -> None:
    """Two ends at rest send three datagrams per reach together."""
    pair = Pair().engage().run(1.0)
    before = len(pair.tap)
    pair.run(10.0)
    schedule = HeartbeatSchedule(0.0, silence=SILENCE, tick_period=0.001)
    schedule.adapt(0.0, 0.0, 0.002, 0.0, pair.master.endpoint.liveness.round_trip)  # 1 ms each way
    assert len(pair.tap) - before == pytest.approx(10.0 * 3.0 / schedule.reach, rel=0.05)
    for side in pair.sides:
        times = [at for at, sender, _ in pair.tap[before:] if sender is side]
        assert len(times) <= 25.0 * 10.0
        assert max(later - earlier for earlier, later in pairwise(times)) <= GAP + 1e-6


@pytest.mark.parametrize(("loss", "delay"), [(0.02, 0.15), (0.3, 0.0005)])
def test_losses_are_measured_and_cause_no_silence(loss: float, delay: float) -> None:
    lossy = Emulation(delay_s=delay, loss=loss)
    pair = Pair(forward=lossy, backward=lossy, seed=21).connect().run(10.0)
    before = [side.silences for side in pair.sides]
    pair.run(15.0)
    assert [side.silences for side in pair.sides] == before, "seed 21"
    assert pair.slave.endpoint.statistics.incoming_loss == pytest.approx(loss, abs=0.15)
    assert pair.master.endpoint.statistics.outgoing_loss == pytest.approx(loss, abs=0.15)
    assert pair.slave.endpoint.statistics.lost == pytest.approx(pair.forward.counters.lost, abs=20)


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
    pair = Pair(forward=lossy, backward=lossy, seed=1, **sending(300, 3.0)).connect().run(33.0)  # type: ignore[arg-type]
    waits = {event.update.tick: at - 1e-3 * event.update.tick - delay for at, event in reversed(pair.slave.received_at)}
    prompt = [wait for wait in waits.values() if wait <= 3.5 * SHORTEST_PACE]
    assert len(prompt) > 0.95 * pair.master.endpoint.statistics.updates_sent[0]


def test_repeats_end_where_they_fill_the_link() -> None:
    """A narrow link: the updates fit, their repeats do not. They fill its queue, and cease; what is needed goes on."""
    links = Emulation(delay_s=0.02, loss=0.1, rate_bit_s=42_000.0), Emulation(delay_s=0.02)
    pair = Pair(forward=links[0], backward=links[1], seed=5, **both(silence=1.0), **sending(20, 0.0))  # type: ignore[arg-type]
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
    lossy = Emulation(delay_s=0.001, loss=0.1)
    pair = Pair(forward=lossy, backward=lossy).engage().run(5.0)
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


@pytest.mark.parametrize(("offset", "drift"), [(0.0, 0.0), (5000.0, 100e-6), (-77.7, -100e-6)])
def test_the_clocks_are_mapped_with_offset_drift_and_jitter(offset: float, drift: float) -> None:
    jittery = Emulation(delay_s=0.01, jitter_s=0.005)
    errors: list[float] = []

    def on_tick(pair: Pair, now: float, tick: int) -> None:
        mapped = pair.slave.endpoint.peer_time(pair.slave.local(now))
        if now > 2.0:
            assert mapped is not None
            errors.append(abs(mapped - now))

    clocks = {"offsets": (0.0, 1e6 + offset), "drifts": (0.0, drift), "slave": {"epoch": 1e6}}
    pair = Pair(forward=jittery, backward=jittery, on_tick=on_tick, every=10, **clocks)  # type: ignore[arg-type]
    pair.connect().run(15.0)
    # Half the window times the drift, and what is left of the jitter in the minima of the two directions.
    assert max(errors) < 4.0 * abs(drift) + 0.0015
    statistics = pair.slave.endpoint.statistics
    assert statistics.rtt == pytest.approx(0.025, abs=0.006)
    assert statistics.one_way == pytest.approx(0.0125, abs=0.004)


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


@pytest.mark.parametrize("jump", [-60.0, -0.3, 0.3, 5.0, 60.0, 1e7])
def test_one_wrong_stamp_does_not_move_the_mapping(jump: float) -> None:
    pair = Pair().engage()
    before = pair.slave.endpoint.peer_time(pair.now)
    pair.master.endpoint.send_update(pair.now + jump, sample_update(pair.ticks))
    ((data, _),) = pair.master.endpoint.datagrams_to_send()
    assert dropped(pair.slave.endpoint, data, MASTER, pair.now)[0] in (DropReason.IMPLAUSIBLE, DropReason.STALE)
    assert pair.slave.endpoint.peer_time(pair.now) == pytest.approx(before, abs=1e-4)
