"""Targets from another process of the same user, for a pointer."""

import os
import socket
from collections.abc import Iterator
from math import inf, nan, tau
from typing import Any, ClassVar

import pytest
from hypothesis import strategies as st

from tests.strangers import as_stranger, ask_socket, needs_root
from weberlink.testing.messages import Message, MessageContract
from weberlink_pointer.target_link import (
    LAYOUT,
    MARK,
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
VECTORS = st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3)
ROTATIONS = st.tuples(*[st.floats(-3.6, 3.6)] * 3)


class TestTargets(MessageContract):
    MESSAGES: ClassVar = {
        "pointer": Message(
            st.builds(PointerTarget, VECTORS, st.booleans(), st.integers(0, 2**64 - 1), ROTATIONS),
            lambda target: pack(*target),
            unpack,
            refused=(
                b"WLP1" + LAYOUT.pack(MARK, 3, True, *HERE, *HERE)[4:],
                LAYOUT.pack(MARK, 3, True, nan, 0.0, 0.0, *HERE),
                LAYOUT.pack(MARK, 3, True, 0.0, 0.0, inf, *HERE),
                LAYOUT.pack(MARK, 3, True, *HERE, 0.0, nan, 0.0),
                LAYOUT.pack(MARK, 3, True, *HERE, 0.0, tau * 1.0001, 0.0),
            ),
            unsendable=(
                ((nan, 0.0, 0.0), True, 1),
                (HERE, True, -1),
                (HERE, True, 2**64),
                (HERE, True, 1, (nan, 0.0, 0.0)),
                (HERE, True, 1, (0.0, tau * 1.0001, 0.0)),
            ),
        )
    }


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


@pytest.mark.parametrize(
    "data", [b"", pack(HERE, True, 3) + b"x", *TestTargets.MESSAGES["pointer"].refused, b"\xff" * 5000]
)
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
