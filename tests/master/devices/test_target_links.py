"""Targets from another process of the same user, for a pointer and for a remote leader.

The messages are in `devices/test_wires`.
"""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from math import inf, nan
from typing import Any

import pytest

from tests.master.devices.test_wires import MESSAGES
from tests.strangers import as_stranger, ask_socket, needs_root
from weberlink.master.devices.target_link import (
    LEADER,
    LEADER_LOCK,
    POINTER,
    LeaderSender,
    PointerSender,
    PointerTarget,
    TargetInUseError,
    TargetSocket,
    link_path,
    pack,
    unpack,
    unpack_angles,
)
from weberlink.telemetry.runtime_directory import ForeignFileError

HERE = (0.1, -0.2, 0.3)
ME = os.getpid()


@pytest.fixture
def listening() -> Iterator[Any]:
    source = TargetSocket(POINTER, unpack)
    source.open()
    yield source
    source.close()


@pytest.fixture
def leader() -> Iterator[Any]:
    source = TargetSocket(LEADER, partial(unpack_angles, axes=3))
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


def test_angles_are_read_once_and_who_leaves_lets_go(leader: Any) -> None:
    assert leader.newest() is None
    with LeaderSender(ME) as sender:
        sender.send((9.0, 9.0, 9.0))
        sender.send(HERE)
        assert leader.newest()[:2] == (HERE, True)
        assert leader.newest() is None
        for angles in ((0.0, nan, 0.0), (inf, 0.0, 0.0)):
            with pytest.raises(ValueError, match="expected finite angles"):
                sender.send(angles)
        sender.send(HERE[:2])
        assert leader.newest() is None, "of another number of axes"
        sender.send(HERE)
    assert leader.newest()[:2] == (HERE, False)


PROGRAM = """
import sys, time
from weberlink.master.devices.target_link import LeaderSender
sender = LeaderSender(int(sys.argv[1]))
print("x", flush=True)
time.sleep(60)
"""


def test_one_program_leads_at_a_time_until_it_ends_or_is_killed(leader: Any) -> None:
    first = LeaderSender(ME)
    with pytest.raises(TargetInUseError, match="another process leads this arm already"):
        LeaderSender(ME)
    first.close()
    first.close()
    child = subprocess.Popen([sys.executable, "-c", PROGRAM, str(ME)], stdout=subprocess.PIPE)
    assert child.stdout is not None
    assert child.stdout.read(1) == b"x"
    with pytest.raises(TargetInUseError):
        LeaderSender(ME)
    child.kill()
    child.communicate()
    with LeaderSender(ME) as sender:
        sender.send((1.0, 1.0, 1.0))
        assert leader.newest().leads


def test_who_led_an_arm_that_has_ended_does_not_lead_the_next_and_a_file_in_its_place_is_refused(leader: Any) -> None:
    with LeaderSender(ME) as sender:
        leader.close()
        assert not any(link_path(ME, kind).exists() for kind in (LEADER, LEADER_LOCK))
        sender.send(HERE)
        leader.open()
        sender.send(HERE)
        assert leader.newest() is None
    leader.close()
    with pytest.raises(FileNotFoundError):
        LeaderSender(ME)
    path = link_path(ME, LEADER)
    path.write_bytes(b"")
    with pytest.raises(ForeignFileError):
        LeaderSender(ME)
    path.unlink()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as killed:
        killed.bind(str(path))
    with pytest.raises(FileNotFoundError):
        LeaderSender(ME)
    path.unlink()


@needs_root
def test_another_user_cannot_send(listening: Any, leader: Any) -> None:
    for kind in (POINTER, LEADER):
        path = link_path(ME, kind)
        assert (path.lstat().st_mode & 0o777, path.parent.lstat().st_mode & 0o777) == (0o600, 0o700)
        assert as_stranger(ask_socket, path, pack(HERE, True, 1)) == "refused"
    assert listening.newest() is leader.newest() is None
