"""Emulated HID devices: the nodes of a testbed, and the real hidapi in a process that sees them."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.hardware.test_emulator import Echo
from tests.program import ROOT
from weberlink.hardware.fault import HardwareFault
from weberlink_devices.umockdev import ADVICE, WRAPPER, HidIdentity, Testbed, TestbedNode, missing

REASON = missing()
DESCRIPTOR = bytes.fromhex("06abff0a0002a1017508150025ff950e09018102950e09029102c0")

HOST = """
import json, sys
from time import monotonic
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.discovery import UsbId, hid_devices
from weberlink.hardware.hid_port import HidPort

port = None
for line in sys.stdin:
    order = json.loads(line)
    answer = None
    try:
        match order:
            case ["found"]:
                answer = [[each.path, each.serial_number, each.problem] for each in hid_devices([UsbId(0x1234, 6)])]
            case ["open", path]:
                port = HidPort(path)
            case ["close"]:
                port.close()
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


class Device(Echo):
    def __init__(self, serial_number: str) -> None:
        super().__init__()
        self.identity = HidIdentity(0x1234, 6, "HID DEVICE", DESCRIPTOR, 14, serial_number, "mbed.org")


@pytest.mark.skipif(REASON is not None, reason=str(REASON))
def test_two_equal_devices_are_found_and_replugged() -> None:
    with Testbed() as bed, TestbedNode(bed, Device("one")) as one, TestbedNode(bed, Device("two")):
        command = [sys.executable, "-c", HOST]
        with subprocess.Popen(command, cwd=ROOT, env=bed.environment, stdin=-1, stdout=-1, text=True) as process:

            def host(*order: Any) -> Any:
                assert process.stdin is not None
                assert process.stdout is not None
                process.stdin.write(json.dumps(order) + "\n")
                process.stdin.flush()
                return json.loads(process.stdout.readline())

            both = [["/dev/hidraw0", "one", None], ["/dev/hidraw1", "two", None]]
            assert sorted(host("found")) == both
            host("open", one.node)
            assert host("descriptor") == DESCRIPTOR.hex()
            assert host("exchange", 200) == 200
            one.unplug()
            assert host("exchange", 1) == "/dev/hidraw0: unplugged"
            assert host("found") == both[1:]
            host("close")
            assert "there is no such device" in host("open", one.node)
            one.plug()
            assert sorted(host("found")) == both
            host("open", one.node)
            assert host("exchange", 20) == 20
            host("close")
        root = bed.root
    assert not root.exists()


@pytest.mark.parametrize(
    ("script", "complaint"),
    [
        (None, ADVICE),
        ('echo \'{"missing": "no gi"}\'', "apt-get install"),
        ("echo cannot bear it >&2; exit 1", "umockdev: cannot bear it"),
    ],
)
def test_umockdev_error_is_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, script: str | None, complaint: str
) -> None:
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin" if script else str(tmp_path))
    if script is not None:
        wrapper = tmp_path / WRAPPER
        wrapper.write_text(f"#!/bin/sh\n{script}\n")
        wrapper.chmod(0o755)
    assert complaint in str(missing())
    with pytest.raises(HardwareFault, match=re.escape(complaint)), Testbed():
        pass
