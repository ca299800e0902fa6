"""Targets from another process of the same user, for a pointer.

The messages are in `devices/test_wires`.
"""

import os
import socket
from collections.abc import Iterator
from typing import Any

import pytest

from tests.master.devices.test_wires import MESSAGES
from tests.strangers import as_stranger, ask_socket, needs_root
from weberlink.master.devices.target_link import (
    POINTER,
    PointerSender,
    PointerTarget,
    TargetSocket,
    link_path,
    pack,
    unpack,
)

HERE = (0.1, -0.2, 0.3)
ME = os.getpid()


@pytest.fixture
def listening() -> Iterator[Any]:
    source = TargetSocket(POINTER, unpack)
    source.open()
    yield source
    source.close()


@pytest.fixture
def wire(listening: Any) -> Iterator[socket.socket]:
    """Sends any bytes to it."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as raw:
        raw.connect(str(link_path(ME, POINTER)))
        yield raw


def test_newest_target_of_the_newest_sender_is_read_once(listening: Any, wire: socket.socket) -> None:
    assert listening.newest() is None
    sender, successor = PointerSender(ME), PointerSender(ME)
    assert sender.send(HERE, True) and sender.send((0.0, 0.0, 0.0), False)
    assert listening.newest()[:2] == ((0.0, 0.0, 0.0), False)
    assert listening.newest() is None
    assert successor.send(HERE, True) and listening.newest() is not None, "its numbers are higher"
    sender.close()
    successor.close()
    for number in (2**63, 2**63 + 2, 2**63 + 1):
        wire.send(pack(HERE, True, number))
    assert listening.newest() == PointerTarget(HERE, True, 2**63 + 2)
    wire.send(pack(HERE, True, 2**63 + 2))
    assert listening.newest() is None


@pytest.mark.parametrize("data", [b"", pack(HERE, True, 3) + b"x", *MESSAGES["pointer"].refused, b"\xff" * 5000])
def test_foreign_datagram_is_ignored(listening: Any, wire: socket.socket, data: bytes) -> None:
    wire.send(pack(HERE, True, 1))
    wire.send(data)
    assert listening.newest() == PointerTarget(HERE, True, 1)
    wire.send(pack(HERE, True, 2))
    assert listening.newest() == PointerTarget(HERE, True, 2)


def test_full_queue_is_said_and_blocks_nobody(listening: Any) -> None:
    sender, sent, read = PointerSender(ME), 0, list[PointerTarget]()
    while sender.send((sent * 1e-6, 0.0, 0.0), True):
        sent += 1
        assert sent < 10_000
    while (more := listening.newest()) is not None:
        read.append(more)
    assert read[-1].target[0] == pytest.approx((sent - 1) * 1e-6)
    assert sender.send(HERE, True)
    sender.close()


def test_sender_waits_for_a_socket_that_comes_later() -> None:
    sender, source = PointerSender(ME), TargetSocket(POINTER, unpack)
    assert not sender.send(HERE, True)
    for _ in range(2):
        source.open()
        assert sender.send(HERE, True) or sender.send(HERE, True), "the first one may find the last socket closed"
        assert source.newest() is not None
        source.close()
        assert not link_path(ME, POINTER).exists()
        source.close()
        assert source.newest() is None
        assert not sender.send(HERE, True)
    sender.close()


@needs_root
def test_another_user_cannot_send(listening: Any) -> None:
    path = link_path(ME, POINTER)
    assert (path.lstat().st_mode & 0o777, path.parent.lstat().st_mode & 0o777) == (0o600, 0o700)
    assert as_stranger(ask_socket, path, pack(HERE, True, 1)) == "refused"
    assert listening.newest() is None
