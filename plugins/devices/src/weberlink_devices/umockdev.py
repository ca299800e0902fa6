"""Emulated devices of the kernel (HID, input) for real libraries, by umockdev: without a kernel module or privileges.

umockdev redirects what a process sees of /sys and /dev by a preloaded library. `umockdev_service` runs in the system's
Python, which has the bindings, and keeps /sys; the nodes in /dev are pseudo terminals served like serial devices. Only
a process started with `Testbed.environment` sees the devices.
"""

import json
import os
import shutil
import struct
import termios
import tty
from collections.abc import Callable
from dataclasses import dataclass
from fcntl import ioctl
from pathlib import Path
from subprocess import PIPE, STDOUT
from types import TracebackType
from typing import Any, Self

from weberlink.child_process import Child
from weberlink.hardware.fault import HardwareFault
from weberlink.testing.serving import PtyDevice, serve

LONGEST_DESCRIPTOR = 4096
WRAPPER = "umockdev-wrapper"
SYSTEM_PYTHON = "/usr/bin/python3"  # not the one of a virtual environment: the bindings come with the distribution
PRELOAD = "libumockdev-preload.so.0"
ADVICE = "to emulate devices of the kernel, install umockdev: apt-get install umockdev gir1.2-umockdev-1.0 python3-gi"
END_S, PAUSE_S = 5.0, 0.1

QUEUE = 64  # reports that the kernel keeps for a reader; later ones are lost
TORN_S = 0.05  # after this time the rest of a report is not expected any more [s]
LITERAL, END = b"\x16", b"\x04"

BUS = "/devices/pci0000:00/0000:00:14.0/usb1"


@dataclass(frozen=True, slots=True)
class TestbedEntry:
    """A device as umockdev is told of it, while it is plugged in."""

    __test__ = False  # not a test class of pytest

    node: str  # its path for processes that see the testbed
    paths: tuple[str, ...]  # in /sys, from the outside in
    description: str  # in umockdev's format, without a node in /dev, which umockdev could not remove again
    ioctls: str  # answers of the node to requests, likewise


def usb_interface(instance: int) -> tuple[str, str]:
    """Paths in /sys of a USB device and of its first interface; `instance` counts pluggings."""
    return f"{BUS}/1-{instance}", f"{BUS}/1-{instance}/1-{instance}:1.0"


@dataclass(frozen=True, slots=True)
class HidIdentity:
    """What a USB device with one HID interface says of itself."""

    vendor: int  # 16 bits
    product: int  # 16 bits
    name: str
    report_descriptor: bytes
    report_size: int  # of a report to the device, without its number [bytes]
    serial_number: str = ""
    manufacturer: str = ""

    def entry(self, number: int, instance: int) -> TestbedEntry:
        """A HID device with the node of this number."""
        vendor, product, path = self.vendor, self.product, f"/dev/hidraw{number}"
        usb, interface = usb_interface(instance)
        hid = f"{interface}/0003:{vendor:04X}:{product:04X}.{instance:04X}"
        node = f"{hid}/hidraw/hidraw{number}"
        usb_id = f"E: PRODUCT={vendor:x}/{product:x}/100"
        name = " ".join(filter(None, (self.manufacturer, self.name)))
        lines = [
            *(f"P: {usb}", "E: DEVTYPE=usb_device", "E: SUBSYSTEM=usb", usb_id),
            *(f"A: idVendor={vendor:04x}", f"A: idProduct={product:04x}", "A: bcdDevice=0100"),
            f"A: product={self.name}",
            *([f"A: manufacturer={self.manufacturer}"] if self.manufacturer else []),
            *([f"A: serial={self.serial_number}"] if self.serial_number else []),
            *("", f"P: {interface}", "E: DEVTYPE=usb_interface", "E: SUBSYSTEM=usb", usb_id, "A: bInterfaceNumber=00"),
            *("", f"P: {hid}", "E: SUBSYSTEM=hid", f"E: HID_ID=0003:{vendor:08X}:{product:08X}"),
            *(f"E: HID_NAME={name}", f"E: HID_PHYS=usb-{instance}/input0", f"E: HID_UNIQ={self.serial_number}"),
            *("", f"P: {node}", f"E: DEVNAME={path}", "E: SUBSYSTEM=hidraw", "E: MAJOR=240", f"E: MINOR={number}", ""),
        ]
        descriptor = self.report_descriptor
        size = len(descriptor).to_bytes(4, "little").hex().upper()
        padded = descriptor.ljust(LONGEST_DESCRIPTOR, b"\0").hex().upper()
        ioctls = f"@DEV {path}\nHIDIOCGRDESCSIZE 0 {size}\nHIDIOCGRDESC 0 {size}{padded}\n"
        return TestbedEntry(path, (usb, interface, hid, node), "\n".join(lines), ioctls)


def missing() -> str | None:
    """Why there can be no testbed here, with what to do about it; None if there can."""
    try:
        with Testbed():
            return None
    except HardwareFault as fault:
        return str(fault)


class Testbed:
    """While in the `with`, processes started with `environment` see these devices, and no other USB devices.

    Args:
        priority: SCHED_FIFO priority of the process that keeps /sys, where permitted; 0 for none.

    Raises:
        HardwareFault: umockdev is not installed, or fails.
    """

    __test__ = False  # not a test class of pytest

    def __init__(self, priority: int = 0) -> None:
        self._priority = priority
        self._child: Child | None = None
        self._instances = 0
        self._plugged: dict[int, TestbedEntry] = {}
        self._described: dict[int, Any] = {}
        self.root = Path()  # replaces / for the processes that see the testbed

    @property
    def environment(self) -> dict[str, str]:
        """All variables for a process that is to see the devices."""
        preload = ":".join(filter(None, (PRELOAD, os.environ.get("LD_PRELOAD", ""))))
        return {**os.environ, "LD_PRELOAD": preload, "UMOCKDEV_DIR": str(self.root)}

    def __enter__(self) -> Self:
        if shutil.which(WRAPPER) is None or not Path(SYSTEM_PYTHON).exists():
            raise HardwareFault(ADVICE)
        service = str(Path(__file__).with_name("umockdev_service.py"))
        command = [WRAPPER, SYSTEM_PYTHON, "-I", service, str(self._priority)]
        self._child = Child(command, stdin=PIPE, stdout=PIPE, stderr=STDOUT)  # it ends with its input
        try:
            answer = self._answer()
            if "root" not in answer:
                raise HardwareFault(ADVICE)  # noqa: TRY301
        except BaseException:
            self._end()
            raise
        self.root = Path(answer["root"])
        (self.root / "dev").mkdir(exist_ok=True)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._end()

    def free_number(self) -> int:
        """Number of the next node, as the kernel would count."""
        return next(number for number in range(len(self._plugged) + 1) if number not in self._plugged)

    def plug(self, identity: Any, number: int) -> None:
        """Let the device appear; the caller makes its node in /dev."""
        self._instances += 1
        device: TestbedEntry = identity.entry(number, self._instances)
        is_new = self._described.get(number) != identity
        self._ask({"add": device.description, "ioctls": device.ioctls if is_new else ""})
        self._described[number] = identity
        self._plugged[number] = device

    def unplug(self, number: int) -> None:
        """Let the device disappear; may be called again."""
        if number in self._plugged:
            # From the inside out: umockdev forgets some links within the device that it removes.
            self._ask({"remove": [f"/sys{path}" for path in reversed(self._plugged.pop(number).paths)]})

    def _ask(self, request: dict[str, Any]) -> None:
        assert self._child is not None
        self._child.write_line(json.dumps(request))  # of one that has ended, the answer will be missing
        answer = self._answer()
        if answer:
            raise HardwareFault(f"umockdev: {answer.get('error', answer)}")

    def _answer(self) -> dict[str, Any]:
        """The next line of JSON; others are complaints, of which the last one before the end counts."""
        assert self._child is not None
        said = "ended without a message"
        while True:
            is_over = not self._child.running
            for line in self._child.lines(0.0 if is_over else PAUSE_S):
                if line.startswith(b"{"):
                    answer: dict[str, Any] = json.loads(line)
                    return answer
                said = line.decode(errors="replace").strip() or said
            if is_over:
                raise HardwareFault(f"umockdev: {said}")

    def _end(self) -> None:
        child, self._child = self._child, None
        if child is not None:
            child.end(END_S)
            if self.root != Path() and self.root.name.startswith("umockdev."):
                shutil.rmtree(self.root, ignore_errors=True)  # a killed process leaves it
            self._plugged.clear()
            self._described.clear()


class TestbedNode(PtyDevice):
    """While in the `with`, the device is plugged into a testbed: a pseudo terminal in place of its node.

    Reports of a HID device are kept apart as the kernel does, and come to the emulator without their number; a reader
    gets one report per read. Unlike with the kernel, whoever opens the node first reads what was sent while nobody had
    it open.
    """

    __test__ = False

    def __init__(self, testbed: Testbed, emulator: Any, *, begin: Callable[[], object] = lambda: None) -> None:
        self._number = testbed.free_number()
        self._identity = emulator.identity
        self.node: str = self._identity.entry(self._number, 0).node  # its path for processes that see the testbed
        super().__init__(emulator, testbed.root / self.node.removeprefix("/"), begin=begin)
        self._testbed = testbed
        self._rest, self._came_at = b"", 0.0

    def plug(self) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        super().plug()
        try:
            self._testbed.plug(self._identity, self._number)
        except BaseException:
            super().unplug()
            raise

    def unplug(self) -> None:
        self._testbed.unplug(self._number)
        super().unplug()

    def _prepare(self, far: int) -> None:
        """Reports as lines: each ended by an end-of-file character, its bytes made literal by one in front."""
        tty.setraw(far)
        if isinstance(self._identity, HidIdentity):
            settings = termios.tcgetattr(far)
            settings[3] |= termios.ICANON | termios.IEXTEN
            special = [b"\0"] * len(settings[6])  # none of them
            special[termios.VLNEXT], special[termios.VEOF] = LITERAL, END
            settings[6] = special
            termios.tcsetattr(far, termios.TCSANOW, settings)

    def _serve(self) -> None:
        if isinstance(self._identity, HidIdentity):
            serve(self.emulator, self._near, self._stopping.is_set, self._encode_report, self._receive)
        else:
            super()._serve()

    def _encode_report(self, message: bytes) -> bytes:
        (waiting,) = struct.unpack("i", ioctl(self._far, termios.FIONREAD, bytes(4)))
        if waiting >= QUEUE * len(message):
            return b""
        return b"".join(LITERAL + message[i : i + 1] for i in range(len(message))) + END

    def _receive(self, data: bytes, now: float) -> None:
        """Split bytes as hidapi writes them into reports, and pass these on without the number in front."""
        self._rest = data if now - self._came_at > TORN_S else self._rest + data
        self._came_at = now
        size = 1 + self._identity.report_size
        while len(self._rest) >= size:
            report, self._rest = self._rest[1:size], self._rest[size:]
            self.emulator.receive(report, now)
