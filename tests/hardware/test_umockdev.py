"""Emulated HID devices: the nodes of a testbed, and the real hidapi in a process that sees them."""

import json
import os
import random
import re
import subprocess
import sys
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from fcntl import ioctl
from pathlib import Path
from select import select
from time import monotonic, sleep
from typing import Any, cast

import pytest

from tests.hardware.test_emulator import Echo
from weberlink.hardware.emulator import WireFaults
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.umockdev import (
    ADVICE,
    QUEUE,
    WRAPPER,
    HidIdentity,
    HidNode,
    Testbed,
    description,
    ioctls,
    missing,
    paths,
)

DESCRIBED = HidIdentity(0x1234, 0x0006, "HID DEVICE", bytes.fromhex("06abffc0"), 14, "42", "mbed.org")


def test_the_description_has_what_hidapi_looks_for() -> None:
    text = description(DESCRIBED, 3, 26)
    assert [line[3:] for line in text.splitlines() if line.startswith("P: ")] == list(paths(DESCRIBED, 3, 26))
    lines = set(text.splitlines())
    assert {"A: idVendor=1234", "A: idProduct=0006", "A: product=HID DEVICE", "A: serial=42"} <= lines
    assert {"E: HID_ID=0003:00001234:00000006", "E: HID_UNIQ=42", "E: HID_NAME=mbed.org HID DEVICE"} <= lines
    assert {"E: DEVNAME=/dev/hidraw3", "E: SUBSYSTEM=hidraw", "E: MINOR=3"} <= lines
    assert not any(line.startswith("N: ") for line in lines), "nodes are ours to make and to take away"


def test_the_report_descriptor_is_given_with_its_size_as_the_kernel_pads_it() -> None:
    node, size, whole = ioctls(DESCRIBED, 3).splitlines()
    assert node == "@DEV /dev/hidraw3"
    assert size == "HIDIOCGRDESCSIZE 0 04000000"
    kind, _, data = whole.split()
    assert kind == "HIDIOCGRDESC"
    assert bytes.fromhex(data) == b"\4\0\0\0\x06\xab\xff\xc0" + bytes(4092)


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


REASON = missing()
needs_umockdev = pytest.mark.skipif(REASON is not None, reason=str(REASON))

ROOT = Path(__file__).parents[2]
DESCRIPTOR = bytes.fromhex("06abff0a0002a1017508150025ff950e09018102950e09029102c0")

HOST = """
import json, sys
from time import monotonic
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.discovery import UsbId, hid_devices
from weberlink.hardware.hid_port import HidPort, hidapi

port = None
for line in sys.stdin:
    order = json.loads(line)
    try:
        match order:
            case ["enumerate"]:
                answer = [each | {"path": each["path"].decode()} for each in hidapi().enumerate()]
            case ["found"]:
                answer = [[each.path, each.serial_number, each.problem] for each in hid_devices([UsbId(0x1234, 6)])]
            case ["open", path]:
                port = HidPort(path)
                answer = None
            case ["close"]:
                port.close()
                answer = None
            case ["descriptor"]:
                answer = bytes(port._device.get_report_descriptor()).hex()
            case ["exchange", count]:
                answer = 0
                for number in range(count):
                    report = bytes([number % 256]) * 14
                    port.write(report)
                    answer += port.read_all(monotonic() + 20.0)[-1:] == [report.upper()]
    except HardwareFault as fault:
        answer = str(fault)
    print(json.dumps(answer), flush=True)
"""


def identity(serial_number: str) -> HidIdentity:
    return HidIdentity(0x1234, 6, "HID DEVICE", DESCRIPTOR, 14, serial_number, "mbed.org")


class Host:
    """A process that uses hidapi."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process

    def __call__(self, *order: Any) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())


@contextmanager
def host_that_sees(bed: Testbed) -> Iterator[Host]:
    process = subprocess.Popen(
        [sys.executable, "-c", HOST], cwd=ROOT, env=bed.environment, stdin=-1, stdout=-1, text=True
    )
    with process:  # which closes its pipes and waits
        yield Host(process)


@needs_umockdev
def test_two_alike_are_found_talk_apart_and_one_comes_back_after_it_was_unplugged() -> None:
    with Testbed() as bed, HidNode(bed, Echo(), identity("one")) as one, HidNode(bed, Echo(), identity("two")) as two:
        root = bed.root
        with host_that_sees(bed) as host:
            first, second = host("enumerate")
            assert (first["vendor_id"], first["product_id"]) == (0x1234, 6)
            assert (first["product_string"], first["manufacturer_string"]) == ("HID DEVICE", "mbed.org")
            assert sorted(host("found")) == [["/dev/hidraw0", "one", None], ["/dev/hidraw1", "two", None]]
            assert sorted([first["path"], second["path"]]) == [one.node, two.node]

            host("open", one.node)
            assert host("descriptor") == DESCRIPTOR.hex()
            assert host("exchange", 200) == 200

            one.unplug()
            assert host("exchange", 1) == "/dev/hidraw0: unplugged"
            assert host("found") == [["/dev/hidraw1", "two", None]]
            host("close")
            assert "there is no such device" in host("open", one.node)

            one.plug()
            assert sorted(each[0] for each in host("found")) == [one.node, two.node]
            host("open", one.node)
            assert host("exchange", 20) == 20
            host("close")
    assert not root.exists()


def test_without_umockdev_there_is_one_line_that_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(HardwareFault, match=re.escape(ADVICE)), Testbed():
        pass
    assert missing() == ADVICE


@pytest.mark.parametrize(
    ("script", "complaint"),
    [
        ('echo \'{"missing": "no gi"}\'', "apt-get install"),
        ("echo cannot bear it >&2; exit 1", "umockdev: cannot bear it"),
    ],
)
def test_what_umockdev_lacks_or_complains_of_is_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, script: str, complaint: str
) -> None:
    wrapper = tmp_path / WRAPPER
    wrapper.write_text(f"#!/bin/sh\n{script}\n")
    wrapper.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    assert complaint in str(missing())
