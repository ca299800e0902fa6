"""Targets from another process of the same user: datagrams for a pointer, shared memory for a remote leader.

The messages of the first are in `devices/test_wires`, torn values of the second in `hardware/test_slot`.
"""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from math import inf, nan

import pytest

from tests.master.devices.test_wires import MESSAGES
from tests.strangers import as_stranger, ask_socket, needs_root, read_file
from weberlink.master.devices.target_link import (
    LEADER,
    POINTER,
    SIZE,
    LeaderTarget,
    PointerSender,
    PointerTarget,
    TargetInUseError,
    TargetMemory,
    TargetSocket,
    TargetWriter,
    link_path,
    pack,
)
from weberlink.telemetry.runtime_directory import ForeignFileError

HERE = (0.1, -0.2, 0.3)


# --- datagrams


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
        raw.connect(str(link_path(os.getpid(), POINTER)))
        yield raw


def test_newest_target_of_the_newest_sender_is_read_once(listening: TargetSocket, wire: socket.socket) -> None:
    assert listening.newest() is None
    sender, successor = PointerSender(os.getpid()), PointerSender(os.getpid())
    assert sender.send(HERE, True)
    assert sender.send((0.0, 0.0, 0.0), False)
    newest = listening.newest()
    assert newest is not None
    assert (newest.target, newest.held) == ((0.0, 0.0, 0.0), False)
    assert listening.newest() is None
    assert successor.send(HERE, True)
    assert listening.newest() is not None, "its numbers are higher"
    sender.close()
    successor.close()
    for number in (2**63, 2**63 + 2, 2**63 + 1):
        wire.send(pack(HERE, True, number))
    assert listening.newest() == PointerTarget(HERE, True, 2**63 + 2)
    wire.send(pack(HERE, True, 2**63 + 2))
    assert listening.newest() is None


@pytest.mark.parametrize("data", [b"", pack(HERE, True, 3) + b"x", *MESSAGES["pointer"].refused, b"\xff" * 5000])
def test_foreign_datagram_is_ignored(listening: TargetSocket, wire: socket.socket, data: bytes) -> None:
    wire.send(pack(HERE, True, 1))
    wire.send(data)
    assert listening.newest() == PointerTarget(HERE, True, 1)
    wire.send(pack(HERE, True, 2))
    assert listening.newest() == PointerTarget(HERE, True, 2)


def test_full_queue_is_said_and_blocks_nobody(listening: TargetSocket) -> None:
    sender, sent, newest = PointerSender(os.getpid()), 0, None
    while sender.send((sent * 1e-6, 0.0, 0.0), True):
        sent += 1
        assert sent < 10_000
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
        assert not link_path(os.getpid(), POINTER).exists()
        source.close()
        assert source.newest() is None
        assert not sender.send(HERE, True)
    sender.close()


# --- shared memory


@pytest.fixture
def memory() -> Iterator[TargetMemory]:
    made = TargetMemory(len(HERE))
    made.open()
    yield made
    made.close()


def test_target_is_read_once_and_who_leaves_lets_go(memory: TargetMemory) -> None:
    assert memory.newest() is None
    with TargetWriter(os.getpid()) as writer:
        writer.write((9.0, 9.0, 9.0))
        writer.write(HERE)
        assert memory.newest() == LeaderTarget(HERE, True)
        assert memory.newest() is None
        for angles in ((0.0, nan, 0.0), (inf, 0.0, 0.0), HERE[:2], (*HERE, 0.0)):
            with pytest.raises(ValueError, match="expected 3 finite angles"):
                writer.write(angles)
        assert memory.newest() is None
    assert memory.newest() == LeaderTarget(HERE, False)


PROGRAM = """
import sys, time
from weberlink.master.devices.target_link import TargetWriter
writer = TargetWriter(int(sys.argv[1]))
print("x", flush=True)
time.sleep(60)
"""


def test_one_program_leads_at_a_time_until_it_ends_or_is_killed(memory: TargetMemory) -> None:
    first = TargetWriter(os.getpid())
    with pytest.raises(TargetInUseError, match="another process leads this arm already"):
        TargetWriter(os.getpid())
    first.close()
    first.close()
    child = subprocess.Popen([sys.executable, "-c", PROGRAM, str(os.getpid())], stdout=subprocess.PIPE)
    assert child.stdout is not None
    assert child.stdout.read(1) == b"x"
    with pytest.raises(TargetInUseError):
        TargetWriter(os.getpid())
    child.kill()
    child.communicate()
    with TargetWriter(os.getpid()) as writer:
        writer.write((1.0, 1.0, 1.0))
        assert memory.newest() == LeaderTarget((1.0, 1.0, 1.0), True)


def test_file_goes_with_the_daemon_and_another_in_its_place_is_refused(memory: TargetMemory) -> None:
    path = link_path(os.getpid(), LEADER)
    path.write_bytes(bytes(SIZE))
    with pytest.raises(ForeignFileError, match="not the target of a remote leader"):
        TargetWriter(os.getpid())
    memory.close()
    assert not path.exists()
    with pytest.raises(FileNotFoundError):
        TargetWriter(os.getpid())
    assert memory.newest() is None


# --- who may


@needs_root
def test_another_user_can_neither_send_nor_read(listening: TargetSocket, memory: TargetMemory) -> None:
    for path in (link_path(os.getpid(), POINTER), link_path(os.getpid(), LEADER)):
        assert path.lstat().st_mode & 0o777 == 0o600
        assert path.parent.lstat().st_mode & 0o777 == 0o700
    assert as_stranger(ask_socket, link_path(os.getpid(), POINTER), pack(HERE, True, 1)) == "refused"
    assert listening.newest() is None
    assert as_stranger(read_file, str(link_path(os.getpid(), LEADER))) == "refused"
