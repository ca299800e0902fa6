"""Emulated devices of the kernel (HID, input) for real libraries, by umockdev: without a kernel module or privileges.

umockdev redirects what a process sees of /sys and /dev by a preloaded library. `umockdev_service` runs in the system's
Python, which has the bindings, and keeps /sys; the nodes in /dev are pseudo terminals served like serial devices. Only
a process started with `Testbed.environment` sees the devices.
"""

import json
import os
import shutil
import struct
import subprocess
import termios
import tty
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from fcntl import ioctl
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

from weberlink.hardware.emulator import Emulator, PtyDevice, serve
from weberlink.hardware.fault import HardwareFault

LONGEST_DESCRIPTOR = 4096
WRAPPER = "umockdev-wrapper"
SYSTEM_PYTHON = "/usr/bin/python3"
"""Not the one of a virtual environment: the bindings come with the distribution."""
PRELOAD = "libumockdev-preload.so.0"
ADVICE = "to emulate devices of the kernel, install umockdev: apt-get install umockdev gir1.2-umockdev-1.0 python3-gi"
END_S = 5.0

QUEUE = 64
"""Reports that the kernel keeps for a reader; later ones are lost."""
TORN_S = 0.05
"""After this time the rest of a report is not expected any more [s]."""
LITERAL, END = b"\x16", b"\x04"


class Identity(Protocol):
    """What an emulated device says of itself, and where it appears."""

    def node(self, number: int) -> str:
        """Path of its node for processes that see the testbed; `number` counts the nodes that are plugged in."""
        ...

    def paths(self, number: int, instance: int) -> tuple[str, ...]:
        """Its paths in /sys from the outside in; `instance` counts pluggings."""
        ...

    def description(self, number: int, instance: int) -> str:
        """The device in the text format of umockdev, without a node in /dev, which umockdev could not remove again."""
        ...

    def ioctls(self, number: int) -> str:
        """Answers of the node to requests, in the text format of umockdev."""
        ...


@dataclass(frozen=True, slots=True)
class HidIdentity:
    """A USB device with one HID interface.

    Args:
        vendor: 16 bits.
        product: 16 bits.
        name: of the product.
        report_descriptor: its bytes.
        report_size: of a report to the device, without its number [bytes].
        serial_number: empty for none.
        manufacturer: empty for none.
    """

    vendor: int
    product: int
    name: str
    report_descriptor: bytes
    report_size: int
    serial_number: str = ""
    manufacturer: str = ""

    def node(self, number: int) -> str:
        return f"/dev/hidraw{number}"

    def paths(self, number: int, instance: int) -> tuple[str, ...]:
        usb = f"/devices/pci0000:00/0000:00:14.0/usb1/1-{instance}"
        interface = f"{usb}/1-{instance}:1.0"
        hid = f"{interface}/0003:{self.vendor:04X}:{self.product:04X}.{instance:04X}"
        return usb, interface, hid, f"{hid}/hidraw/hidraw{number}"

    def description(self, number: int, instance: int) -> str:
        usb, interface, hid, node = self.paths(number, instance)
        product = f"E: PRODUCT={self.vendor:x}/{self.product:x}/100"
        name = " ".join(filter(None, (self.manufacturer, self.name)))
        lines = [
            *(f"P: {usb}", "E: DEVTYPE=usb_device", "E: SUBSYSTEM=usb", product),
            *(f"A: idVendor={self.vendor:04x}", f"A: idProduct={self.product:04x}", "A: bcdDevice=0100"),
            f"A: product={self.name}",
            *([f"A: manufacturer={self.manufacturer}"] if self.manufacturer else []),
            *([f"A: serial={self.serial_number}"] if self.serial_number else []),
            *("", f"P: {interface}", "E: DEVTYPE=usb_interface", "E: SUBSYSTEM=usb", product, "A: bInterfaceNumber=00"),
            *("", f"P: {hid}", "E: SUBSYSTEM=hid", f"E: HID_ID=0003:{self.vendor:08X}:{self.product:08X}"),
            *(f"E: HID_NAME={name}", f"E: HID_PHYS=usb-{instance}/input0", f"E: HID_UNIQ={self.serial_number}"),
            *("", f"P: {node}", f"E: DEVNAME={self.node(number)}", "E: SUBSYSTEM=hidraw", "E: MAJOR=240"),
            f"E: MINOR={number}",
        ]
        return "\n".join(lines) + "\n"

    def ioctls(self, number: int) -> str:
        size = len(self.report_descriptor).to_bytes(4, "little").hex().upper()
        padded = self.report_descriptor.ljust(LONGEST_DESCRIPTOR, b"\0").hex().upper()
        return f"@DEV {self.node(number)}\nHIDIOCGRDESCSIZE 0 {size}\nHIDIOCGRDESC 0 {size}{padded}\n"


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
        self._process: subprocess.Popen[str] | None = None
        self._instances = 0
        self._plugged: dict[int, tuple[Identity, int]] = {}
        self._described: dict[int, Identity] = {}
        self.root = Path()
        """Replaces / for the processes that see the testbed."""

    @property
    def environment(self) -> dict[str, str]:
        """All variables for a process that is to see the devices."""
        preload = ":".join(filter(None, (PRELOAD, os.environ.get("LD_PRELOAD", ""))))
        return {**os.environ, "LD_PRELOAD": preload, "UMOCKDEV_DIR": str(self.root)}

    def __enter__(self) -> Self:
        if shutil.which(WRAPPER) is None or not Path(SYSTEM_PYTHON).exists():
            raise HardwareFault(ADVICE)
        service = str(Path(__file__).with_name("umockdev_service.py"))
        self._process = subprocess.Popen(  # noqa: S603
            [WRAPPER, SYSTEM_PYTHON, "-I", service, str(self._priority)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for us; it ends with its input
            text=True,
        )
        try:
            answer = self._answer()
        except BaseException:
            self._end()
            raise
        if "root" not in answer:
            self._end()
            raise HardwareFault(ADVICE)
        self.root = Path(answer["root"])
        (self.root / "dev").mkdir(exist_ok=True)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._end()

    def free_number(self) -> int:
        """Number of the next node, as the kernel would count."""
        return next(number for number in range(len(self._plugged) + 1) if number not in self._plugged)

    def path(self, node: str) -> Path:
        """Path of a node for processes that do not see the testbed."""
        return self.root / node.removeprefix("/")

    def plug(self, identity: Identity, number: int) -> None:
        """Let the device appear; the caller makes its node in /dev."""
        self._instances += 1
        is_new = self._described.get(number) != identity
        added = identity.description(number, self._instances)
        self._ask({"add": added, "ioctls": identity.ioctls(number) if is_new else ""})
        self._described[number] = identity
        self._plugged[number] = (identity, self._instances)

    def unplug(self, number: int) -> None:
        """Let the device disappear; may be called again."""
        if number in self._plugged:
            identity, instance = self._plugged.pop(number)
            # From the inside out: umockdev forgets some links within the device that it removes.
            self._ask({"remove": [f"/sys{path}" for path in reversed(identity.paths(number, instance))]})

    def _ask(self, request: dict[str, Any]) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # the answer will be missing then
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
        answer = self._answer()
        if answer:
            raise HardwareFault(f"umockdev: {answer.get('error', answer)}")

    def _answer(self) -> dict[str, Any]:
        assert self._process is not None
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        line = self._process.stdout.readline()
        if not line.startswith("{"):
            complaint = (line + self._process.stderr.read()).strip().splitlines()
            raise HardwareFault(f"umockdev: {complaint[-1] if complaint else 'ended without a message'}")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        for stream in (process.stdin, process.stdout, process.stderr):
            assert stream is not None
            with suppress(BrokenPipeError):
                stream.close()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if self.root != Path() and self.root.name.startswith("umockdev."):
            shutil.rmtree(self.root, ignore_errors=True)  # a killed process leaves it
        self._plugged.clear()
        self._described.clear()


class TestbedNode(PtyDevice):
    """While in the `with`, the device is plugged into a testbed: a pseudo terminal in place of its node.

    Args:
        testbed: to plug it into.
        emulator: the device.
        identity: what it says of itself.
        begin: see `PtyDevice`.
    """

    __test__ = False

    def __init__(
        self,
        testbed: Testbed,
        emulator: Emulator,
        identity: Identity,
        *,
        begin: Callable[[], object] = lambda: None,
    ) -> None:
        self._number = testbed.free_number()
        self.node = identity.node(self._number)
        """Its path for processes that see the testbed."""
        super().__init__(emulator, testbed.path(self.node), begin=begin)
        self._testbed = testbed
        self._identity = identity

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


class HidNode(TestbedNode):
    """A HID device: keeps reports apart as the kernel does; they come to the emulator without their number.

    A reader gets one report per read. Unlike with the kernel, whoever opens the node first reads what was sent while
    nobody had it open.
    """

    _identity: HidIdentity

    def _prepare(self, far: int) -> None:
        """Reports as lines: each ended by an end-of-file character, its bytes made literal by one in front."""
        tty.setraw(far)
        settings = termios.tcgetattr(far)
        settings[3] |= termios.ICANON | termios.IEXTEN
        special = [b"\0"] * len(settings[6])  # none of them
        special[termios.VLNEXT], special[termios.VEOF] = LITERAL, END
        settings[6] = special
        termios.tcsetattr(far, termios.TCSANOW, settings)

    def _serve(self) -> None:
        device = _Reports(self.emulator, self._identity.report_size)
        serve(device, self._near, self._stopping.is_set, encode=self._encode)

    def _encode(self, message: bytes) -> bytes:
        (waiting,) = struct.unpack("i", ioctl(self._far, termios.FIONREAD, bytes(4)))
        if waiting >= QUEUE * len(message):
            return b""
        return b"".join(LITERAL + message[i : i + 1] for i in range(len(message))) + END


class _Reports:
    """Splits bytes as hidapi writes them into reports, and passes these on without the number in front."""

    def __init__(self, emulator: Emulator, report_size: int) -> None:
        self._device = emulator
        self.faults = emulator.faults
        self.advance = emulator.advance
        self.replies = emulator.replies
        self.next_timer = emulator.next_timer
        self._size = 1 + report_size
        self._rest = b""
        self._came_at = 0.0

    def receive(self, data: bytes, now: float) -> None:
        self._rest = data if now - self._came_at > TORN_S else self._rest + data
        self._came_at = now
        while len(self._rest) >= self._size:
            report, self._rest = self._rest[1 : self._size], self._rest[self._size :]
            self._device.receive(report, now)


def plugged_into(testbed: Testbed, emulator: Any, begin: Callable[[], object] = lambda: None) -> TestbedNode:
    """The node of an emulator whose class names its transport, `hid` or `evdev`."""
    kind = HidNode if emulator.transport == "hid" else TestbedNode
    return kind(testbed, emulator, emulator.identity, begin=begin)
