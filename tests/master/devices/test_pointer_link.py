"""Targets on the socket of a pointer device: what is taken, and what is ignored."""

import os
import socket
from collections.abc import Iterator
from math import nan

import pytest

from tests.strangers import as_stranger, ask_socket, needs_root
from weberlink.geometry.vector import ZERO
from weberlink.master.devices.pointer_link import (
    LAYOUT,
    MARK,
    PointerSender,
    PointerTarget,
    TargetSocket,
    pack,
    socket_path,
)

HERE = (0.01, -0.02, 0.03)


@pytest.fixture
def listening() -> Iterator[TargetSocket]:
    source = TargetSocket()
    source.open()
    yield source
    source.close()


@pytest.fixture
def wire(listening: TargetSocket) -> Iterator[socket.socket]:
    """Sends any bytes to it."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as raw:
        raw.connect(str(socket_path(os.getpid())))
        yield raw


def test_sender_reaches_the_socket(listening: TargetSocket) -> None:
    assert listening.newest() is None
    sender = PointerSender(os.getpid())
    assert sender.send(HERE, True)
    assert sender.send((0.0, 0.0, 0.0), False)
    newest = listening.newest()
    assert newest is not None
    assert (newest.target, newest.held) == ((0.0, 0.0, 0.0), False)
    assert listening.newest() is None
    successor = PointerSender(os.getpid())
    assert successor.send(HERE, True)
    assert listening.newest() is not None, "its numbers are higher"
    sender.close()
    successor.close()


def test_only_the_user_can_send(listening: TargetSocket) -> None:
    path = socket_path(os.getpid())
    assert path.lstat().st_mode & 0o777 == 0o600
    assert path.parent.lstat().st_mode & 0o777 == 0o700


@needs_root
def test_another_user_cannot_send(listening: TargetSocket) -> None:
    assert as_stranger(ask_socket, socket_path(os.getpid()), pack(HERE, True, 1)) == "refused"
    assert listening.newest() is None


def test_highest_number_wins(listening: TargetSocket, wire: socket.socket) -> None:
    for number in (5, 9, 7):
        wire.send(pack((number / 1000, 0.0, 0.0), True, number))
    assert listening.newest() == PointerTarget((9e-3, 0.0, 0.0), True, 9)
    wire.send(pack(HERE, True, 9))
    assert listening.newest() is None


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"x",
        pack(HERE, True, 3) + b"x",
        pack(HERE, True, 3)[:-1],
        b"WLP1" + pack(HERE, True, 3)[4:],
        LAYOUT.pack(MARK, 3, True, nan, 0.0, 0.0, *ZERO),
        LAYOUT.pack(MARK, 3, True, 0.0, 0.0, float("inf"), *ZERO),
        LAYOUT.pack(MARK, 3, True, *HERE, 0.0, nan, 0.0),
        LAYOUT.pack(MARK, 3, True, *HERE, 1e300, 0.0, 0.0),
        b"\xff" * 5000,
    ],
    ids=["empty", "short", "long", "cut", "foreign", "nan", "infinite", "turned by nan", "turned too far", "huge"],
)
def test_foreign_datagram_is_ignored(listening: TargetSocket, wire: socket.socket, data: bytes) -> None:
    wire.send(pack(HERE, True, 1))
    wire.send(data)
    assert listening.newest() == PointerTarget(HERE, True, 1)
    wire.send(pack(HERE, True, 2))
    assert listening.newest() == PointerTarget(HERE, True, 2)


def test_full_queue_is_said_and_blocks_nobody(listening: TargetSocket) -> None:
    sender = PointerSender(os.getpid())
    sent = 0
    while sender.send((sent * 1e-6, 0.0, 0.0), True):
        sent += 1
        assert sent < 10_000
    newest = None
    while (more := listening.newest()) is not None:
        newest = more
    assert newest is not None
    assert newest.target[0] == pytest.approx((sent - 1) * 1e-6)
    assert sender.send(HERE, True)
    sender.close()


def test_sender_waits_for_a_socket_that_comes_later() -> None:
    sender, source = PointerSender(os.getpid()), TargetSocket()
    assert not sender.send(HERE, True)
    for _ in range(2):
        source.open()
        assert sender.send(HERE, True) or sender.send(HERE, True), "the first one may find the last socket closed"
        assert source.newest() is not None
        source.close()
        assert not socket_path(os.getpid()).exists()
        source.close()
        assert source.newest() is None
        assert not sender.send(HERE, True)
    sender.close()


def test_socket_left_by_a_killed_process_is_replaced(listening: TargetSocket) -> None:
    later = TargetSocket()
    later.open()
    sender = PointerSender(os.getpid())
    assert sender.send(HERE, True)
    assert later.newest() is not None
    later.close()
    sender.close()
