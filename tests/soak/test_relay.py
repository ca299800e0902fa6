"""The relay: what it does to datagrams, and what it counts."""

import socket
from collections.abc import Iterator
from random import Random

import pytest

from tests.soak.relay import Direction
from tests.soak.wire import Wire
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.wire import Kind

HELLO = bytes([Kind.HELLO]) + bytes(40)
UPDATE = bytes([Kind.UPDATE]) + bytes(20)
PROBE = bytes([Kind.PATH]) + bytes(11)


class Receiver:
    """Takes what is passed on, unless told to refuse it."""

    def __init__(self) -> None:
        self.took: list[bytes] = []
        self.accepts = True

    def __call__(self, data: bytes) -> bool:
        if self.accepts:
            self.took.append(data)
        return self.accepts


@pytest.fixture
def receiver() -> Receiver:
    return Receiver()


@pytest.fixture
def way(receiver: Receiver) -> Direction:
    return Direction(receiver, Random(1).random)


def numbered(number: int) -> bytes:
    return UPDATE + bytes((number,))


def test_harm_is_counted_as_what_it_is(way: Direction, receiver: Receiver) -> None:
    way.emulate(Emulation(corrupt=1.0, duplicate=1.0))
    way.take(UPDATE, 0.0)
    way.deliver(0.0)
    assert receiver.took[0] == receiver.took[1] != UPDATE
    way.emulate(Emulation(loss=1.0))
    way.take(UPDATE, 0.1)
    way.deliver(0.1)
    counts = way.reading()
    assert (counts["corrupted"], counts["duplicated"], counts["passed"], counts["lost"]) == (1, 1, 2, 1)


def test_a_datagram_under_way_survives_a_change(way: Direction, receiver: Receiver) -> None:
    way.emulate(Emulation(delay_s=0.5))
    way.take(UPDATE, 0.0)
    way.emulate(Emulation())
    way.take(HELLO, 0.1)
    way.deliver(0.1)
    assert (receiver.took, way.next_due()) == ([HELLO], 0.5)
    way.deliver(0.5)
    assert receiver.took == [HELLO, UPDATE]
    assert way.counts["handshakes"] == 1


def test_old_datagrams_are_delivered_and_the_rest_held(way: Direction, receiver: Receiver) -> None:
    way.hold()
    for number in range(6):
        way.take(numbered(number), float(number))
    way.deliver(9.0)
    assert receiver.took == []
    assert way.release_old(2.0) == 3
    assert receiver.took == [numbered(number) for number in range(3)]
    assert way.release(deliver=False) == 3
    assert (way.counts["released"], way.counts["discarded"]) == (3, 3)
    way.take(UPDATE, 8.0)
    way.deliver(8.0)
    assert len(receiver.took) == 4


def test_only_whole_datagrams_of_the_session_are_repeated(way: Direction, receiver: Receiver) -> None:
    way.take(HELLO, 0.0)
    way.take(numbered(1), 0.0)
    way.deliver(0.0)
    for at, harm in ((1.0, Emulation(corrupt=1.0)), (2.0, Emulation(loss=1.0))):
        way.emulate(harm)
        way.take(numbered(2), at)
        way.deliver(at)
    receiver.took.clear()
    assert way.replay(10, 0.0, 3.0) == 1
    assert receiver.took == [numbered(1)]
    assert way.replay(10, 0.5, 3.0) == 0
    receiver.accepts = False
    way.replay(10, 0.0, 3.0)
    assert way.counts["replayed"] == 2


def bound() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(("127.0.0.1", 0))
    made.settimeout(5.0)
    return made


@pytest.fixture
def ends() -> Iterator[tuple[socket.socket, socket.socket]]:
    with bound() as master, bound() as slave:
        yield master, slave


def test_a_thief_overtakes_the_master_and_passes_on_answers(ends: tuple[socket.socket, socket.socket]) -> None:
    master, slave = ends
    with Wire(slave.getsockname(), 1) as wire:
        master.sendto(HELLO, wire.front)
        _, relay = slave.recvfrom(100)
        wire.steal("127.0.0.4")
        master.sendto(UPDATE, wire.front)
        (first, thief), (second, again) = slave.recvfrom(100), slave.recvfrom(100)
        assert first == second == UPDATE
        assert (thief[0], again) == ("127.0.0.4", relay)
        for data in (PROBE, UPDATE):
            slave.sendto(data, thief)
            assert master.recv(100) == data
        assert wire.steal("") == (1, 1)
        books = wire.books()
        assert (books.calls, books.forward["passed"], books.backward["passed"]) == (1, 2, 2)
        assert wire.recorded_calls() == [HELLO]
