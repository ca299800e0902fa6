"""Names and instances: a slave serves one master at a time, and a refused call changes nothing."""

from random import Random

import pytest

from tests.protocol.harness import AGREEMENT, MASTER, Pair, Side, make_endpoint, sample_update, suites
from weberlink.protocol import Address, Connected, DropReason, PeerClosed, Refused, Role, State, TakenOver
from weberlink.protocol.dialer import Answer, Dialer
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.handshake import HELLO_HEADER, INSTANCE_BYTES, LocalEnd, Welcome, pack_map, read_hello_header
from weberlink.protocol.security import Security
from weberlink.protocol.wire import Kind, kind_of

OTHER: Address = ("192.0.2.9", 40_009)


def join(pair: Pair, **changes: object) -> Side:
    """A second master, which calls the same slave from `OTHER`."""
    other = make_endpoint(Role.INITIATOR, **{"seed": 77, "name": "bob@desk", **changes})  # type: ignore[arg-type]
    other.connect(pair.now)
    pair.guests.append(Side(other, OTHER))
    return pair.guests[-1]


def named(**changes: object) -> Pair:
    return Pair(master={"name": "ann@operator", **changes}, slave={"name": "robot:47000", **changes}).engage()


@pytest.mark.parametrize("security", suites())
def test_an_engaged_slave_refuses_a_second_master_by_name(security: Security) -> None:
    pair = named(security=security)
    other = join(pair, security=security)
    pair.run(0.3)
    refusal = other.refusal()
    assert "'ann@operator'" in refusal and "--take-over" in refusal
    assert other.endpoint.state is State.CLOSED
    assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    assert len(pair.slave.of(Connected)) == 1
    assert not pair.slave.of(Refused), "the call changes nothing at the slave"
    assert pair.slave.faults() == [DropReason.REFUSED]


def test_second_run_of_the_same_master_is_refused() -> None:
    pair = named()
    other = join(pair, name="ann@operator")
    pair.run(0.3)
    refusal = other.refusal()
    assert "another run of" in refusal


def test_silent_session_still_belongs_to_its_master() -> None:
    pair = named()
    pair.swallow = lambda side, data: side is pair.master
    pair.run(0.15)
    assert pair.slave.endpoint.state is State.SILENT
    other = join(pair)
    pair.run(0.3)
    assert len(other.of(Refused)) == 1


def test_slave_takes_next_master_after_a_farewell() -> None:
    pair = named()
    pair.master.endpoint.close(pair.now, "completed")
    pair.run(0.05)
    assert pair.slave.of(PeerClosed) == [PeerClosed("completed")]
    other = join(pair)
    pair.run(0.1)
    assert other.endpoint.state is pair.slave.endpoint.state is State.ENGAGED


def test_master_may_call_again_after_a_broken_link() -> None:
    pair = named()
    for _ in range(3):
        pair.swallow = lambda side, data: True
        pair.run(0.2)
        pair.swallow = lambda side, data: False
        pair.run(0.8)
        assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    assert not pair.master.of(Refused)


@pytest.mark.parametrize("security", suites())
def test_take_over_replaces_the_master_once(security: Security) -> None:
    pair = named(security=security)
    other = join(pair, security=security, take_over=True)
    pair.run(0.3)
    assert other.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    assert pair.slave.endpoint.peer == OTHER
    assert pair.master.of(TakenOver) == [TakenOver("bob@desk")]
    assert pair.master.endpoint.state is State.CLOSED
    assert pair.master.endpoint.next_timer() is None, "it does not call again"
    assert not pair.master.of(PeerClosed)


def test_take_over_is_repeated_until_the_slave_serves_the_new_master() -> None:
    """The slave's answer arrives, but for a time nothing that the new master sends under the keys of the session."""
    pair = named()
    other = join(pair, take_over=True)
    pair.swallow = lambda side, data: side is other and kind_of(data) != Kind.HELLO
    pair.run(0.3)
    pair.swallow = lambda side, data: False
    pair.run(0.3)
    assert not other.of(Refused)
    assert other.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    assert pair.master.of(TakenOver) == [TakenOver("bob@desk")]


def test_deaf_master_does_not_take_the_slave_back() -> None:
    """Of all that the slave sends under the keys of a session, nothing reaches the master that took over first."""
    pair = named()
    deaf = join(pair, take_over=True)
    pair.swallow = lambda side, data: (
        side is pair.slave
        and (pair.slave.endpoint.peer == deaf.address or kind_of(data) == Kind.BYE)
        and kind_of(data) != Kind.WELCOME
    )
    pair.run(0.3)
    other = join(pair, take_over=True, seed=78, name="eve@desk")
    other.address = ("192.0.2.10", 40_010)
    pair.run(1.5)
    assert len(deaf.of(Refused)) == 1
    assert not other.of(TakenOver)
    assert other.endpoint.state is pair.slave.endpoint.state is State.ENGAGED


def test_of_two_masters_that_may_take_over_one_stays() -> None:
    """The farewell to the first is lost; when it calls again, it does not take over again."""
    pair = named()
    pair.master.endpoint.close(pair.now, "completed")
    first = join(pair, take_over=True)
    pair.run(0.2)
    pair.swallow = lambda side, data: kind_of(data) == Kind.BYE
    second = join(pair, take_over=True, seed=78, name="eve@desk")
    second.address = ("192.0.2.10", 40_010)
    pair.run(1.5)
    assert not first.of(TakenOver)
    assert first.endpoint.state is State.CLOSED
    assert len(first.of(Refused)) == 1
    assert second.endpoint.state is State.ENGAGED
    assert len(pair.slave.of(Connected)) == 3


def test_a_recorded_take_over_takes_nothing() -> None:
    recorder = make_endpoint(Role.INITIATOR, seed=5, name="eve@desk", take_over=True)
    recorder.connect(0.0)
    recorded = recorder.datagrams_to_send()[0][0]
    pair = named()
    for _ in range(100):
        pair.slave.endpoint.receive_datagram(recorded, OTHER, pair.now)
        pair.run(0.01)
    assert len(pair.slave.of(Connected)) == 1
    assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    assert pair.slave.endpoint.peer == MASTER


def test_a_slave_serves_the_master_of_its_name_alone() -> None:
    pair = Pair(master={"name": "bob@desk"}, slave={"name": "robot:47000", "expects": "ann@operator"})
    pair.connect().run(0.3)
    refusal = pair.master.refusal()
    assert all(name in refusal for name in ("'robot:47000'", "'ann@operator'", "'bob@desk'"))
    assert pair.slave.endpoint.state is State.LISTENING
    taker = join(pair, take_over=True)
    pair.run(0.3)
    assert len(taker.of(Refused)) == 1, "not even by taking over"
    pair.guests.clear()
    ann = join(pair, seed=79, name="ann@operator")
    pair.run(0.3)
    assert ann.endpoint.state is State.ENGAGED


def test_unexpected_slave_refuses_the_master() -> None:
    pair = Pair(master={"expects": "robot:47000"}, slave={"name": "toy:47000"}).connect().run(0.3)
    refusal = pair.master.refusal()
    assert "'robot:47000'" in refusal and "'toy:47000'" in refusal
    assert not pair.slave.of(Connected)


def test_a_master_keeps_to_the_first_slave_that_answered() -> None:
    """A relay swaps to another slave with the same key."""
    pair = named()
    pair.slave.endpoint = make_endpoint(Role.RESPONDER, seed=9, name="toy:47000", epoch=pair.now)
    pair.slave.endpoint.connect(pair.now)
    pair.run(2.0)
    refusal = pair.master.refusal()
    assert "'robot:47000'" in refusal and "'toy:47000'" in refusal
    assert pair.master.endpoint.state is State.CLOSED
    assert pair.slave.endpoint.state is State.LISTENING


@pytest.mark.parametrize("security", suites())
def test_a_master_refuses_a_welcome_under_another_name(security: Security) -> None:
    """The peer has the key, and ignores the name that the master expects."""
    end = LocalEnd(security, Random(1).randbytes, b"", 2, 0.0, "ann@operator", "robot:47000", 0.4)
    dialer = Dialer(end, bytes(INSTANCE_BYTES), stamp=lambda now: 1)
    for name in ("toy:47000", "robot:47000"):
        dialer.start(0.0)
        hello = dialer.hello(0.0)
        heard = security.hear(hello[:HELLO_HEADER], hello[HELLO_HEADER:])
        assert heard is not None
        answered = heard.answer(pack_map(Welcome(0, 0, name, 400_000)._asdict()), bytes(security.private_size))
        header = read_hello_header(hello)
        assert answered is not None and header is not None
        outcome = dialer.receive(header.pack_answer() + answered[0])
        if name == "toy:47000":
            assert isinstance(outcome, str) and "'toy:47000'" in outcome and "'robot:47000'" in outcome
        else:
            assert isinstance(outcome, Answer)


def test_a_slave_of_the_same_name_may_be_restarted() -> None:
    pair = named()
    pair.slave.endpoint = make_endpoint(Role.RESPONDER, seed=9, name="robot:47000", epoch=pair.now)
    pair.slave.endpoint.connect(pair.now)
    pair.run(1.0)
    assert pair.master.endpoint.state is pair.slave.endpoint.state is State.ENGAGED
    assert len(pair.master.of(Connected)) == 2


def test_refused_call_is_reported_while_no_master_is_served() -> None:
    pair = Pair(slave={"agreement": {**AGREEMENT, "rate_hz": 500}}).connect().run(0.3)
    assert pair.slave.of(Refused) == pair.master.of(Refused) != []


def test_recorded_calls_of_another_configuration_change_nothing() -> None:
    before = make_endpoint(Role.INITIATOR, seed=3, name="bob@desk", agreement={"rate_hz": 500})
    before.connect(0.0)
    recorded = [data for data, _ in before.datagrams_to_send()]
    for step in range(1, 20):
        before.handle_timer(step * 0.5)
        recorded += [data for data, _ in before.datagrams_to_send()]
    pair = named()
    for data in recorded:
        pair.slave.endpoint.receive_datagram(data, OTHER, pair.now)
        pair.run(0.11)
    assert not pair.slave.of(Refused)
    assert set(pair.slave.faults()) == {DropReason.REFUSED}
    assert pair.slave.endpoint.state is pair.master.endpoint.state is State.ENGAGED
    update = sample_update(pair.ticks)
    assert pair.master.endpoint.send_update(pair.now, update)
    pair.run(0.05)
    assert pair.slave.updates()[-1].update == update


@pytest.mark.parametrize("delay", [0.001, 0.02])
def test_one_of_two_simultaneous_masters_is_served(delay: float) -> None:
    """Both have a pending session; the first datagram under its keys decides."""
    pair = Pair(forward=Emulation(delay_s=delay), master={"name": "ann@operator"}, slave={"name": "robot:47000"})
    pair.connect()
    other = join(pair)
    pair.run(1.0)
    assert {other.endpoint.state, pair.master.endpoint.state} == {State.ENGAGED, State.CLOSED}
    assert len(other.of(Refused) + pair.master.of(Refused)) == 1
    assert len(pair.slave.of(Connected)) == 1


def test_pending_session_expires() -> None:
    """A relay holds the first datagrams of a call that a slave has answered."""
    held: list[bytes] = []
    pair = Pair()
    pair.swallow = lambda side, data: side is pair.master and kind_of(data) != Kind.HELLO and not held.append(data)
    pair.connect().run(0.1)
    pair.swallow = lambda side, data: True
    pair.run(5.0)
    assert held
    for data in held:
        pair.slave.endpoint.receive_datagram(data, MASTER, pair.now)
    pair.run(0.01)
    assert pair.slave.endpoint.state is State.LISTENING
    assert set(pair.slave.faults()) == {DropReason.STALE}
