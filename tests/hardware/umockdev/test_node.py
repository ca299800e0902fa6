"""A HID node keeps reports apart, as the kernel does; on a pseudo terminal, without umockdev."""

import os
import random
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from fcntl import ioctl
from pathlib import Path
from select import select
from time import monotonic, sleep
from typing import cast

from weberlink.hardware.emulator import WireFaults
from weberlink.hardware.umockdev import HidIdentity, HidNode, Testbed
from weberlink.hardware.umockdev.node import QUEUE, TORN_S, _Numbered

SIZE = 14
IDENTITY = HidIdentity(0x1234, 6, "HID DEVICE", b"", SIZE)
PATIENCE = 20.0


class Recorder:
    """Sends what it is told to, and remembers what came."""

    def __init__(self) -> None:
        self.faults = WireFaults()
        self.received: list[bytes] = []
        self.to_send: list[bytes] = []

    def receive(self, data: bytes, now: float) -> None:
        self.received.append(data)

    def advance(self, now: float) -> None:
        pass

    def replies(self, now: float) -> list[bytes]:
        sending, self.to_send = self.to_send, []
        return sending

    def next_timer(self) -> float | None:
        return None


class Folder:
    """Takes the place of a testbed: its nodes are in a folder, and nobody is told."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.log: list[str] = []

    def free_number(self) -> int:
        return 5

    def path(self, number: int) -> Path:
        return self.root / f"hidraw{number}"

    def plug(self, identity: HidIdentity, number: int) -> None:
        assert self.path(number).exists()
        self.log.append("plug")

    def unplug(self, number: int) -> None:
        self.log.append("unplug")


@contextmanager
def node_in(folder: Path) -> Iterator[tuple[Recorder, HidNode, int]]:
    recorder, bed = Recorder(), Folder(folder)
    with HidNode(cast(Testbed, bed), recorder, IDENTITY) as node:
        descriptor = os.open(node.path, os.O_RDWR | os.O_NOCTTY)
        try:
            yield recorder, node, descriptor
        finally:
            os.close(descriptor)
    assert bed.log == ["plug", "unplug"]


def read(descriptor: int) -> bytes:
    assert select((descriptor,), (), (), PATIENCE)[0]
    return os.read(descriptor, 64)


def waiting(descriptor: int) -> int:
    return int.from_bytes(ioctl(descriptor, termios.FIONREAD, bytes(4)), "little")


def test_one_read_gives_one_report_whatever_bytes_it_has(tmp_path: Path) -> None:
    chance = random.Random(5)
    reports = [bytes(range(start, start + SIZE)) for start in range(0, 256 - SIZE, SIZE)]
    reports += [bytes([value]) * SIZE for value in (0, 3, 4, 10, 13, 17, 19, 22, 26, 28, 127, 255)]
    reports += [chance.randbytes(SIZE) for _ in range(30)]
    with node_in(tmp_path) as (recorder, node, descriptor):
        assert node.node == "/dev/hidraw5"
        recorder.to_send = list(reports)
        assert [read(descriptor) for _ in reports] == reports


def test_what_nobody_reads_is_lost_from_some_number_on_and_the_rest_stays_whole(tmp_path: Path) -> None:
    reports = [number.to_bytes(2, "little") + bytes(SIZE - 2) for number in range(4 * QUEUE)]
    with node_in(tmp_path) as (recorder, _, descriptor):
        for report in reports:  # one by one: the queue is counted before each
            before = waiting(descriptor)
            recorder.to_send = [report]
            os.write(descriptor, bytes(1 + SIZE))  # so that it looks at once
            deadline = monotonic() + PATIENCE
            while recorder.to_send or (before < QUEUE * SIZE and waiting(descriptor) == before):
                assert monotonic() < deadline
                sleep(0.0002)
        kept = [read(descriptor) for _ in range(QUEUE)]
        assert kept == reports[:QUEUE]
        assert waiting(descriptor) == 0


def test_reports_from_the_host_lose_their_number_and_are_told_apart(tmp_path: Path) -> None:
    reports = [bytes([number]) * SIZE for number in range(1, 9)]
    with node_in(tmp_path) as (recorder, _, descriptor):
        os.write(descriptor, b"".join(b"\0" + report for report in reports))
        deadline = monotonic() + PATIENCE
        while len(recorder.received) < len(reports):
            assert monotonic() < deadline
            sleep(0.001)
        assert recorder.received == reports


def test_pieces_of_a_report_are_put_together_unless_the_rest_does_not_come() -> None:
    recorder = Recorder()
    numbered = _Numbered(recorder, 4)
    numbered.receive(b"\0ab", 1.0)
    numbered.receive(b"cd\0wx", 1.01)
    assert recorder.received == [b"abcd"]
    numbered.receive(b"\0efgh", 1.02 + TORN_S)
    assert recorder.received == [b"abcd", b"efgh"]
