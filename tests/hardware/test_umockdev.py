"""Emulated HID devices: the nodes of a testbed, and the real hidapi in a process that sees them."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.hardware.test_emulator import Echo
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.umockdev import (
    ADVICE,
    WRAPPER,
    HidIdentity,
    HidNode,
    Testbed,
    missing,
)

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
def test_two_equal_devices_are_found_and_replugged() -> None:
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


def test_missing_umockdev_gives_installation_advice(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
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
def test_umockdev_error_is_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, script: str, complaint: str
) -> None:
    wrapper = tmp_path / WRAPPER
    wrapper.write_text(f"#!/bin/sh\n{script}\n")
    wrapper.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    assert complaint in str(missing())
