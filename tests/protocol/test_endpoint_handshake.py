"""How two endpoints find each other, or refuse to."""

from itertools import pairwise
from random import Random

import pytest

from tests.protocol.harness import AGREEMENT, MASTER, SLAVE, Pair, forms, make_endpoint, suites
from weberlink.protocol import Connected, DropReason, PeerClosed, Refused, Role, State, StateError
from weberlink.protocol.checksum import Checksum
from weberlink.protocol.dialer import FIRST_INTERVAL, LONGEST_INTERVAL
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.handshake import PROTOCOL_VERSION, HelloHeader, read_answered, read_hello_header
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Security
from weberlink.protocol.wire import Kind, kind_of

OTHER_KEY = bytes(32)


@pytest.mark.parametrize("security", suites())
def test_both_ends_connect_with_what_they_agreed(security: Security) -> None:
    pair = Pair(master={"security": security}, slave={"security": security}).engage()
    assert pair.master.of(Connected) == [Connected(SLAVE, AGREEMENT)]
    assert pair.slave.of(Connected) == [Connected(MASTER, AGREEMENT)]
    assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    assert not pair.master.faults()
    assert not pair.slave.faults()


def test_hello_is_repeated_with_growing_pauses_until_someone_answers() -> None:
    pair = Pair()
    pair.master.endpoint.connect(0.0)
    pair.run(3.0)
    times = [at for at, side, _ in pair.tap if side is pair.master]
    pauses = [round(later - earlier, 9) for earlier, later in pairwise(times)]
    assert FIRST_INTERVAL <= pauses[0] <= 1.5 * FIRST_INTERVAL
    assert pauses == sorted(pauses)
    assert pauses[-1] == pytest.approx(LONGEST_INTERVAL)
    assert pair.master.endpoint.state is State.CONNECTING
    pair.slave.endpoint.connect(pair.now)
    pair.run(0.6)
    assert pair.master.endpoint.state is State.ENGAGED


def test_connects_through_heavy_loss() -> None:
    for seed in range(8):
        lossy = Emulation(delay_s=0.02, jitter_s=0.01, loss=0.3, duplicate=0.2, reorder=0.2)
        pair = Pair(forward=lossy, backward=lossy, seed=seed)
        pair.connect().run(3.0)
        assert pair.master.endpoint.state is State.ENGAGED, f"seed {seed}"
        assert pair.slave.endpoint.state is State.ENGAGED, f"seed {seed}"


@pytest.mark.parametrize("security", suites())
@pytest.mark.parametrize(
    ("slave", "expected"),
    [
        ({**AGREEMENT, "codec.force.weber": 0.05}, "codec.force.weber: master has 0.1, slave has 0.05"),
        ({"rate_hz": 1000, "codec.force.weber": 0.1}, "codec.force.predictor: master has 'hybrid', slave has nothing"),
        ({**AGREEMENT, "axes": "xyz"}, "axes: master has nothing, slave has 'xyz'"),
        (
            {**AGREEMENT, "rate_hz": 500, "codec.force.weber": 0.2},
            "codec.force.weber: master has 0.1, slave has 0.2; rate_hz: master has 1000, slave has 500",
        ),
    ],
)
def test_ends_that_differ_refuse_with_both_values(security: Security, slave: dict[str, object], expected: str) -> None:
    pair = Pair(master={"security": security}, slave={"security": security, "agreement": slave}).connect().run(1.0)
    assert pair.master.of(Refused) == [Refused(expected)]
    assert pair.slave.of(Refused) == [Refused(expected)]
    assert pair.master.endpoint.state is State.CLOSED
    assert pair.slave.endpoint.state is State.LISTENING


def test_a_refusal_that_is_lost_is_given_again() -> None:
    pair = Pair(backward=Emulation(blackouts=((0.0, 0.3),)), slave={"agreement": {"rate_hz": 500}})
    pair.connect().run(1.5)
    assert len(pair.master.of(Refused)) == 1


def test_versions_that_differ_are_both_named() -> None:
    own, other = PROTOCOL_VERSION, PROTOCOL_VERSION - 1
    pair = Pair(slave={"version": other}).connect().run(0.5)
    expected = [Refused(f"protocol version: master has {own}, slave has {other}")]
    assert pair.master.of(Refused) == expected
    assert pair.slave.of(Refused) == expected


@pytest.mark.parametrize("security", [PresharedKey(OTHER_KEY), Checksum()])
def test_another_key_or_suite_gets_no_answer(security: Security) -> None:
    pair = Pair(slave={"security": security}).connect().run(0.5)
    assert set(pair.slave.faults()) == {DropReason.UNPROVEN}
    assert pair.slave.endpoint.statistics.dropped[DropReason.UNPROVEN] >= 4
    assert not [data for _, side, data in pair.tap if side is pair.slave]


def test_a_welcome_under_another_key_is_dropped() -> None:
    pair = Pair()
    pair.master.endpoint.connect(0.0)
    impostor = make_endpoint(Role.RESPONDER, security=PresharedKey(OTHER_KEY), agreement=AGREEMENT)
    impostor.connect(0.0)
    forger = make_endpoint(Role.INITIATOR, security=PresharedKey(OTHER_KEY), peer=SLAVE)
    forger.connect(0.0)
    impostor.receive_datagram(forger.datagrams_to_send()[0][0], SLAVE, 0.0)
    (welcome, _) = impostor.datagrams_to_send()[0]
    pair.master.endpoint.receive_datagram(welcome, SLAVE, 0.001)
    pair.run(0.01)
    assert pair.master.faults() == [DropReason.UNPROVEN]
    assert pair.master.endpoint.state is State.CONNECTING


@pytest.mark.parametrize("security", suites())
@pytest.mark.parametrize("keys", [0, 1, 25])
def test_no_answer_is_longer_than_its_question(security: Security, keys: int) -> None:
    agreement = {f"a.rather.long.path.number.{index}": index for index in range(keys)}
    for other in (agreement, {**agreement, "x": "y" * 500}, {f"{key}!": 1.5 for key in agreement}):
        pair = Pair(
            master={"security": security, "agreement": agreement}, slave={"security": security, "agreement": other}
        )
        pair.connect().run(0.2)
        hellos = [data for _, _, data in pair.tap if kind_of(data) == Kind.HELLO]
        welcomes = [data for _, _, data in pair.tap if kind_of(data) == Kind.WELCOME]
        assert welcomes
        assert max(map(len, welcomes)) <= min(map(len, hellos))
        assert len(welcomes) <= len(hellos)


def test_a_replayed_hello_does_not_hurt_a_live_session() -> None:
    pair = Pair().engage()
    hello = next(data for _, _, data in pair.tap if kind_of(data) == Kind.HELLO)
    for _ in range(50):
        pair.slave.endpoint.receive_datagram(hello, ("203.0.113.9", 9), pair.now)
        pair.run(0.01)
    assert set(pair.slave.faults()) == {DropReason.REPLAYED}
    assert len(pair.slave.of(Connected)) == 1
    assert pair.slave.endpoint.peer == MASTER


def test_a_call_is_answered_however_long_the_path() -> None:
    """HELLOs are repeated before the first answer is back; the slave keeps the session of each that long."""
    for one_way, longest in ((0.045, 0.1), (0.2, 0.4), (0.9, 2.0), (1.8, 4.0)):
        slow = Emulation(delay_s=one_way)
        ends = {"longest_round_trip": longest}
        pair = Pair(forward=slow, backward=slow, master=ends, slave=ends)
        pair.connect().run(3.2 * one_way)
        assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED, longest
        assert len(pair.slave.of(Connected)) == 1


def test_handshake_datagrams_for_the_other_role_are_dropped() -> None:
    pair = Pair().engage()
    hello = next(data for _, _, data in pair.tap if kind_of(data) == Kind.HELLO)
    welcome = next(data for _, _, data in pair.tap if kind_of(data) == Kind.WELCOME)
    pair.master.endpoint.receive_datagram(hello, SLAVE, pair.now)
    pair.master.endpoint.receive_datagram(welcome, SLAVE, pair.now)  # a late copy, or played back
    pair.slave.endpoint.receive_datagram(welcome, MASTER, pair.now)
    pair.run(0.01)
    assert pair.master.faults() == [DropReason.UNEXPECTED] * 2
    assert pair.slave.faults() == [DropReason.UNEXPECTED]


def test_a_welcome_of_another_call_is_not_proven() -> None:
    first = Pair().engage()
    welcome = next(data for _, _, data in first.tap if kind_of(data) == Kind.WELCOME)
    other = make_endpoint(Role.INITIATOR, seed=99)
    other.connect(0.0)
    assert read_hello_header(other.datagrams_to_send()[0][0])[2] == read_answered(welcome), "for the same stamp"
    other.receive_datagram(welcome, SLAVE, 0.001)
    assert other.statistics.dropped == {DropReason.UNPROVEN: 1}
    assert other.state is State.CONNECTING


def test_a_closed_or_idle_endpoint_takes_nothing() -> None:
    pair = Pair().engage()
    hello = next(data for _, _, data in pair.tap if kind_of(data) == Kind.HELLO)
    idle = make_endpoint(Role.RESPONDER)
    idle.receive_datagram(hello, MASTER, 0.0)
    assert idle.statistics.dropped == {DropReason.UNEXPECTED: 1}
    heartbeat = pair.tap[-1][2]
    for side in pair.sides:
        side.endpoint.close(pair.now, "done")
        side.endpoint.receive_datagram(hello, SLAVE, pair.now)
        side.endpoint.receive_datagram(heartbeat, SLAVE, pair.now)
        assert side.endpoint.state is State.CLOSED
        assert side.endpoint.next_timer() is None


def test_closing_discards_pending_sessions() -> None:
    master, slave = make_endpoint(Role.INITIATOR), make_endpoint(Role.RESPONDER)
    master.connect(0.0)
    slave.connect(0.0)
    slave.receive_datagram(master.datagrams_to_send()[0][0], MASTER, 0.0)
    master.receive_datagram(slave.datagrams_to_send()[0][0], SLAVE, 0.0)
    slave.close(0.0, "done")
    slave.receive_datagram(master.datagrams_to_send()[0][0], MASTER, 0.0)
    assert slave.state is State.CLOSED
    assert slave.next_event() is not None
    assert slave.statistics.dropped == {DropReason.NO_SESSION: 1}


def test_calls_in_the_wrong_state_raise() -> None:
    endpoint = make_endpoint(Role.INITIATOR)
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
        ({"outgoing": (forms(0),)}, "levels"),
        ({"agreement": {"a.b": object()}}, "'a.b'"),
        ({"agreement": {"a.b": "x" * 5000}}, "bytes"),
    ],
)
def test_a_bad_configuration_names_the_argument(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_endpoint(Role.INITIATOR, **changes)


def test_master_calls_again_after_a_farewell() -> None:
    pair = Pair().engage()
    pair.slave.endpoint.close(pair.now, "robot: emergency stop" + "!" * 100)
    pair.run(0.1)
    (farewell,) = pair.master.of(PeerClosed)
    assert isinstance(farewell, PeerClosed)
    assert farewell.reason.startswith("robot: emergency stop!")
    assert len(farewell.reason) == 64
    assert pair.master.endpoint.state is State.CONNECTING
    pair.slave.endpoint = make_endpoint(Role.RESPONDER, seed=7)
    pair.slave.endpoint.connect(pair.now)
    pair.run(1.0)
    assert len(pair.master.of(Connected)) == 2


def test_a_responder_listens_again_when_the_master_leaves() -> None:
    pair = Pair().engage()
    pair.master.endpoint.close(pair.now, "completed")
    pair.run(0.1)
    assert pair.slave.of(PeerClosed) == [PeerClosed("completed")]
    assert pair.slave.endpoint.state is State.LISTENING
    assert pair.master.endpoint.state is State.CLOSED
    pair.master.endpoint = make_endpoint(Role.INITIATOR, seed=8)
    pair.master.endpoint.connect(pair.now)
    pair.run(0.3)
    assert pair.slave.endpoint.state is State.ENGAGED


def test_authentic_random_bytes_are_malformed() -> None:
    """A peer with the key, or any sender where there is no key, may send any body."""
    random = Random(5)
    for security in suites():
        slave = make_endpoint(Role.RESPONDER, security=security)
        slave.connect(0.0)
        for size in range(600, 800):
            header = HelloHeader(PROTOCOL_VERSION, bytes(8), size).pack()
            hello = security.call(header, random.randbytes(security.private_size)).hello(random.randbytes(size))
            slave.receive_datagram(header + hello, MASTER, 0.0)
        assert slave.statistics.dropped == {DropReason.MALFORMED: 200}
