"""The relay between two sockets: it leads the master elsewhere, and overtakes it, and its books stay right."""

import socket
from collections.abc import Iterator

import pytest

from tests.soak.wire import Wire
from weberlink.protocol.wire import Kind

HELLO = bytes([Kind.HELLO]) + bytes(40)
UPDATE = bytes([Kind.UPDATE]) + bytes(20)
PROBE = bytes(12)


def bound() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(("127.0.0.1", 0))
    made.settimeout(5.0)
    return made


@pytest.fixture
def ends() -> Iterator[tuple[socket.socket, socket.socket]]:
    with bound() as master, bound() as slave:
        yield master, slave


def test_the_master_is_led_to_another_slave_and_back(ends: tuple[socket.socket, socket.socket]) -> None:
    master, slave = ends
    with bound() as other, Wire(slave.getsockname(), 1) as wire:
        master.sendto(HELLO, wire.front)
        assert slave.recv(100) == HELLO
        wire.swap(other.getsockname())
        master.sendto(UPDATE, wire.front)
        data, relay = other.recvfrom(100)
        other.sendto(b"from the other", relay)
        assert (data, master.recv(100)) == (UPDATE, b"from the other")
        wire.swap(None)
        master.sendto(UPDATE, wire.front)
        assert slave.recv(100) == UPDATE
        book = wire.books().forward
    assert (book.arrived, book.passed, book.orphaned, book.balance) == (3, 2, 1, 0)


def test_a_thief_overtakes_the_master_and_passes_on_what_comes_to_it(ends: tuple[socket.socket, socket.socket]) -> None:
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
        assert wire.recorded_calls() == [HELLO]
    assert (books.forward.duplicated, books.forward.passed, books.forward.balance) == (1, 3, 0)
    assert books.backward.balance == 0
