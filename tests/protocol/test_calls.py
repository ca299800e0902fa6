"""How two ends find each other or refuse to, and who is served."""

from itertools import pairwise
from random import Random

import pytest

from tests.protocol.harness import (
    AGREEMENT,
    ENGAGED,
    MASTER,
    OTHER,
    SILENCE,
    SLAVE,
    STRANGER,
    Pair,
    both,
    by_suite,
    dropped,
    forms,
    kind_of,
    local_end,
    make_endpoint,
    sample_update,
    sent,
    states,
    suites,
)
from weberlink.protocol import (
    ChangeProposed,
    Connected,
    DropReason,
    PeerClosed,
    Refused,
    Role,
    State,
    StateError,
    TakenOver,
)
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.handshake import (
    FIRST_INTERVAL,
    HELLO_HEADER,
    INSTANCE_BYTES,
    LONGEST_INTERVAL,
    WELCOME_HEADER,
    Dialer,
    Hello,
    identity_of,
    pack_hello,
    pack_map,
)
from weberlink.protocol.local_end import LONGEST_SILENCE, PROTOCOL_VERSION
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Checksum, Security
from weberlink.protocol.session import Session
from weberlink.protocol.states import moved
from weberlink.protocol.wire import Kind
from weberlink.update import ModelParameters, PreviousSample, Update

OTHER_KEY = PresharedKey(bytes(32))


def named(**changes: object) -> Pair:
    return Pair(master={"name": "ann@operator", **changes}, slave={"name": "robot:47000", **changes}).engage()


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
        pair = Pair(link=link, seed=seed, **both(longest_round_trip=longest))
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
        ({"agreement": {**AGREEMENT, "\x1b[2J\nx": 1}}, {}, ("[2J x: master has 1",)),
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
    assert all(part in pair.master.refusal() for part in said) and pair.master.refusal().isprintable()
    assert set(pair.slave.of(Refused)) == set(pair.master.of(Refused))
    assert states(pair) == [State.CLOSED, State.LISTENING]
    if "agreement" not in slave and "version" not in slave:
        other = pair.join(security=security, name="ann@operator")
        pair.run(0.3)
        assert other.endpoint.state is State.ENGAGED


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
    other = pair.join(security=security, **{"name": "bob@desk", **changes})
    pair.run(0.3)
    assert all(part in other.refusal() for part in said)
    assert len(pair.slave.of(Connected)) == 1 and not pair.slave.of(Refused)
    assert pair.slave.faults() == [DropReason.REFUSED]
    assert pair.slave.endpoint.peer_name == "ann@operator"


@pytest.mark.parametrize("security", [OTHER_KEY, Checksum()])
def test_another_key_or_suite_gets_no_answer(security: Security) -> None:
    pair = Pair(master={"security": PresharedKey(bytes(range(32)))}, slave={"security": security}).connect().run(0.5)
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
            header = HELLO_HEADER.pack(Kind.HELLO, PROTOCOL_VERSION, bytes(8), size)
            message, _ = security.call(header, random.randbytes(security.private_size), random.randbytes(size))
            slave.receive_datagram(header + message, MASTER, 0.0)
        assert slave.statistics.dropped == {DropReason.MALFORMED: 40}
        too_deep = b"\x81\xa1a" + b"\x91" * 1000 + b"\x01"  # to be shown
        for agreement, name in ((b"", "ann"), (local_end().packed, "bob"), (too_deep, "ann")):
            hello = Hello(agreement, 0, "ann", bytes(INSTANCE_BYTES), "", False, 400_000, 0)
            header = HELLO_HEADER.pack(Kind.HELLO, PROTOCOL_VERSION, identity_of(name), 2000 + len(agreement))
            message, _ = security.call(header, bytes(security.private_size), pack_hello(hello, security.overhead))
            assert dropped(slave, header + message, MASTER) == [DropReason.MALFORMED]


def test_each_bad_datagram_has_its_reason() -> None:
    pair = Pair().engage()
    (hello, *_), (welcome, *_) = sent(pair, Kind.HELLO), sent(pair, Kind.WELCOME)
    master, slave = (side.endpoint for side in pair.sides)
    heartbeat = sent(pair, Kind.HEARTBEAT, pair.slave)[-1]
    for data, reason in (
        (b"", DropReason.TRUNCATED),
        (b"\x03", DropReason.TRUNCATED),
        (b"\x00" * 400, DropReason.WRONG_LENGTH),
        (b"\x07" * 40, DropReason.BAD_TAG),
        (b"\x04" * 38, DropReason.BAD_TAG),
        (heartbeat, DropReason.BAD_TAG),  # its own
        (b"\x01" * 4096, DropReason.UNPROVEN),
        (b"\x01" * 4097, DropReason.WRONG_LENGTH),
        (b"\x01" * 40, DropReason.TRUNCATED),
        (welcome, DropReason.UNEXPECTED),
        (hello, DropReason.REPLAYED),
        (HELLO_HEADER.pack(Kind.HELLO, PROTOCOL_VERSION, identity_of("master"), 0) + bytes(500), DropReason.UNPROVEN),
    ):
        assert dropped(slave, data, MASTER) == [reason], data[:1]
    assert dropped(master, heartbeat, STRANGER) == [DropReason.FOREIGN_ADDRESS]
    assert dropped(master, hello, SLAVE) == dropped(master, welcome, SLAVE) == [DropReason.UNEXPECTED]
    caller = make_endpoint(Role.INITIATOR, seed=99)
    caller.connect(0.0)
    own = caller.datagrams_to_send()[0][0]
    assert HELLO_HEADER.unpack_from(own)[-1] == WELCOME_HEADER.unpack_from(welcome)[-1], "for the same stamp"
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
    with pytest.raises(StateError, match="cannot become CONNECTING"):
        endpoint.connect(0.0)
    with pytest.raises(StateError, match="CONNECTING cannot become SILENT"):
        moved(State.CONNECTING, State.SILENT)
    endpoint.close(0.0, "done")
    with pytest.raises(StateError, match="cannot become CLOSED"):
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
        ({"agreement": {"a.b": 2**70}}, "'a.b'"),
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


# --- who is served


def test_take_over_is_repeated_until_the_slave_serves_the_new_master() -> None:
    """The slave's answer arrives, but for a time nothing that the new master sends under the keys of the session."""
    pair = named()
    other = pair.join(take_over=True, name="bob@desk")
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

    Deaf: of all that the slave sends under the keys of a session, nothing reaches it."""
    pair = named()
    first = pair.join(take_over=True, name="bob@desk")
    deaf = lambda data: is_deaf and pair.slave.endpoint.peer == OTHER and kind_of(data) != Kind.WELCOME  # noqa: E731
    pair.swallow = lambda side, data: side is pair.slave and (kind_of(data) == Kind.BYE or deaf(data))
    pair.run(0.3)
    second = pair.join(("192.0.2.10", 40_010), take_over=True, seed=78, name="eve@desk")
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
    dialer = Dialer(local_end(security=security, name="ann@operator", expects="robot:47000", stamp=lambda now: 1))
    welcome = {"clock_us": 0, "delta_us": 0, "name": "robot:47000", "longest_round_trip_us": 400_000}
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
        (pack_map({**welcome, "clock_us": -500_000}), DropReason.STALE),
        (pack_map(welcome), Session),
    ):
        hello = dialer.call(0.0)
        heard = security.hear(hello[: HELLO_HEADER.size], hello[HELLO_HEADER.size :])
        _, version, _, stamp = HELLO_HEADER.unpack_from(hello)
        assert heard is not None
        answered = security.answer(heard[1], bytes(security.private_size), payload)
        assert answered is not None
        found = dialer.on_welcome(WELCOME_HEADER.pack(Kind.WELCOME, version, stamp) + answered[0], 0.0)
        assert isinstance(found, Session) if outcome is Session else found == outcome
        assert (dialer.due < 0.0) is (outcome is None), "the next one is due at once if the clock went back"


def test_an_answer_that_comes_too_late_counts_as_received_and_a_forged_one_does_not() -> None:
    master, slave = make_endpoint(Role.INITIATOR), make_endpoint(Role.RESPONDER)
    slave.connect(0.0)
    master.connect(0.0)
    ((hello, _),) = master.datagrams_to_send()
    slave.receive_datagram(hello, MASTER, 0.0)
    ((welcome, _),) = slave.datagrams_to_send()
    for data, reason in ((welcome[:-1] + bytes([welcome[-1] ^ 1]), DropReason.UNPROVEN), (welcome, DropReason.STALE)):
        assert dropped(master, data, SLAVE, 5.0) == [reason]
        assert master.statistics.received == (reason is DropReason.STALE)


def test_one_of_two_simultaneous_masters_is_served() -> None:
    """Both have a pending session; the first datagram under its keys decides."""
    pair = Pair(master={"name": "ann@operator"}, slave={"name": "robot:47000"}).connect()
    other = pair.join(name="bob@desk")
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
    pair.slave.endpoint.close(pair.now, "robot:\x1b emergency stop" + "!" * 100)
    pair.run(0.05)
    assert len(sent(pair, Kind.BYE)) == pytest.approx(copies, abs=1 if loss else 0)
    assert pair.master.of(PeerClosed) == [PeerClosed("robot: emergency stop" + "!" * 42)], "in printable characters"
    assert pair.master.endpoint.state is State.CONNECTING
