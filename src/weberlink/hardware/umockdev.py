"""Emulated HID devices for the real hidapi, by umockdev."""

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
from typing import Any, Self

from weberlink.hardware.emulator import Emulator, PtyDevice, serve
from weberlink.hardware.fault import HardwareFault

LONGEST_DESCRIPTOR = 4096


@dataclass(frozen=True, slots=True)
class HidIdentity:
    """What a USB device with one HID interface says of itself.

    Args:
        vendor: 16 bits.
        product: 16 bits.
        name: of the product.
        report_descriptor: its bytes.
        report_size: of a report either way, without a number [bytes].
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


def node_of(number: int) -> str:
    return f"/dev/hidraw{number}"


def paths(identity: HidIdentity, number: int, instance: int) -> tuple[str, str, str, str]:
    """Of the USB device, its interface, the HID device and the node in /sys; the outermost first.

    Args:
        identity: of the device.
        number: of the node.
        instance: another one at each plugging in, as the kernel counts them.
    """
    usb = f"/devices/pci0000:00/0000:00:14.0/usb1/1-{instance}"
    interface = f"{usb}/1-{instance}:1.0"
    hid = f"{interface}/0003:{identity.vendor:04X}:{identity.product:04X}.{instance:04X}"
    return usb, interface, hid, f"{hid}/hidraw/hidraw{number}"


def description(identity: HidIdentity, number: int, instance: int) -> str:
    """The device for umockdev, without a node in /dev, which it could not take away again."""
    usb, interface, hid, node = paths(identity, number, instance)
    product = f"{identity.vendor:x}/{identity.product:x}/100"
    name = " ".join(filter(None, (identity.manufacturer, identity.name)))
    devices = (
        (
            usb,
            ("DEVTYPE=usb_device", "SUBSYSTEM=usb", f"PRODUCT={product}"),
            (
                f"idVendor={identity.vendor:04x}",
                f"idProduct={identity.product:04x}",
                "bcdDevice=0100",
                f"product={identity.name}",
                *([f"manufacturer={identity.manufacturer}"] if identity.manufacturer else []),
                *([f"serial={identity.serial_number}"] if identity.serial_number else []),
            ),
        ),
        (interface, ("DEVTYPE=usb_interface", "SUBSYSTEM=usb", f"PRODUCT={product}"), ("bInterfaceNumber=00",)),
        (
            hid,
            (
                "SUBSYSTEM=hid",
                f"HID_ID=0003:{identity.vendor:08X}:{identity.product:08X}",
                f"HID_NAME={name}",
                f"HID_PHYS=usb-{instance}/input0",
                f"HID_UNIQ={identity.serial_number}",
            ),
            (),
        ),
        (node, (f"DEVNAME={node_of(number)}", "SUBSYSTEM=hidraw", "MAJOR=240", f"MINOR={number}"), ()),
    )
    return "\n".join(
        "".join([f"P: {path}\n", *(f"E: {each}\n" for each in properties), *(f"A: {each}\n" for each in attributes)])
        for path, properties, attributes in devices
    )


def ioctls(identity: HidIdentity, number: int) -> str:
    """What the node answers to those that ask for the report descriptor."""
    size = len(identity.report_descriptor).to_bytes(4, "little").hex().upper()
    padded = identity.report_descriptor.ljust(LONGEST_DESCRIPTOR, b"\0").hex().upper()
    return f"@DEV {node_of(number)}\nHIDIOCGRDESCSIZE 0 {size}\nHIDIOCGRDESC 0 {size}{padded}\n"


WRAPPER = "umockdev-wrapper"
SYSTEM_PYTHON = "/usr/bin/python3"
"""Not the one of a virtual environment: the bindings come with the distribution."""
PRELOAD = "libumockdev-preload.so.0"
ADVICE = "to emulate HID devices, install umockdev: apt-get install umockdev gir1.2-umockdev-1.0 python3-gi"
END_S = 5.0


def missing() -> str | None:
    """Why there can be no testbed here, with what to do about it; None if there can."""
    try:
        with Testbed():
            return None
    except HardwareFault as fault:
        return str(fault)


class Testbed:
    """While in the `with`, processes that are started with `environment` see these HID devices.

    They see no other USB devices, serial ones included. What they read and write there goes through the testbed's
    process.

    Args:
        priority: of SCHED_FIFO for that process, where it is permitted; 0 for none.

    Raises:
        HardwareFault: umockdev is not installed, or fails.
    """

    __test__ = False  # not one of pytest's, in spite of its name

    def __init__(self, priority: int = 0) -> None:
        self._priority = priority
        self._process: subprocess.Popen[str] | None = None
        self._instances = 0
        self._plugged: dict[int, tuple[HidIdentity, int]] = {}
        self._described: dict[int, HidIdentity] = {}
        self.root = Path()
        """What takes the place of / for those that see it."""

    @property
    def environment(self) -> dict[str, str]:
        """All variables for a process that is to see the devices."""
        preload = ":".join(filter(None, (PRELOAD, os.environ.get("LD_PRELOAD", ""))))
        return {**os.environ, "LD_PRELOAD": preload, "UMOCKDEV_DIR": str(self.root)}

    def __enter__(self) -> Self:
        if shutil.which(WRAPPER) is None or not Path(SYSTEM_PYTHON).exists():
            raise HardwareFault(ADVICE)
        self._process = subprocess.Popen(  # noqa: S603
            [WRAPPER, SYSTEM_PYTHON, "-I", str(Path(__file__).with_name("umockdev_service.py")), str(self._priority)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for us; it ends with its input
            text=True,
        )
        try:
            self.root = self._first_answer()
        except BaseException:
            self._end()
            raise
        (self.root / "dev").mkdir(exist_ok=True)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._end()

    def free_number(self) -> int:
        """Of the next node, as the kernel would count."""
        return next(number for number in range(len(self._plugged) + 1) if number not in self._plugged)

    def path(self, number: int) -> Path:
        """Where the node of that number is for those that do not see the testbed."""
        return self.root / node_of(number).removeprefix("/")

    def plug(self, identity: HidIdentity, number: int) -> None:
        """Let the device appear; its node in /dev is up to the caller."""
        self._instances += 1
        self._ask(
            {
                "add": description(identity, number, self._instances),
                "ioctls": ioctls(identity, number) if self._described.get(number) != identity else "",
            }
        )
        self._described[number] = identity
        self._plugged[number] = (identity, self._instances)

    def unplug(self, number: int) -> None:
        """Let it disappear; any number of times."""
        if number in self._plugged:
            identity, instance = self._plugged.pop(number)
            # From the inside out: umockdev forgets some links of what is within the thing that it removes.
            self._ask({"remove": [f"/sys{path}" for path in reversed(paths(identity, number, instance))]})

    def _ask(self, order: dict[str, Any]) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # the answer will be missing then
            self._process.stdin.write(json.dumps(order) + "\n")
            self._process.stdin.flush()
        answer = self._answer()
        if answer:
            raise HardwareFault(f"umockdev: {answer.get('error', answer)}")

    def _first_answer(self) -> Path:
        answer = self._answer()
        if "root" not in answer:
            raise HardwareFault(ADVICE)
        return Path(answer["root"])

    def _answer(self) -> dict[str, Any]:
        assert self._process is not None
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        line = self._process.stdout.readline()
        if not line.startswith("{"):
            complaint = (line + self._process.stderr.read()).strip().splitlines()
            raise HardwareFault(f"umockdev: {complaint[-1] if complaint else 'ended without a word'}")
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
            shutil.rmtree(self.root, ignore_errors=True)  # of a killed one
        self._plugged.clear()
        self._described.clear()


QUEUE = 64
"""Reports that the kernel keeps for a reader; what comes on top is lost."""

TORN_S = 0.05
"""After which the rest of a report is not expected any more [s]."""

LITERAL, END = b"\x16", b"\x04"


class HidNode(PtyDevice):
    """While in the `with`, the device is plugged in.

    A reader gets one report per read, as from the kernel. Unlike there, whoever opens the node reads first what was
    sent while nobody had it open.

    Args:
        testbed: to plug it into.
        emulator: the device; reports come to it without their number.
        identity: what it says it is.
        begin: see `PtyDevice`.
    """

    def __init__(
        self,
        testbed: Testbed,
        emulator: Emulator,
        identity: HidIdentity,
        *,
        begin: Callable[[], object] = lambda: None,
    ) -> None:
        self._number = testbed.free_number()
        super().__init__(emulator, testbed.path(self._number), begin=begin)
        self._testbed = testbed
        self._identity = identity
        self.node = node_of(self._number)
        """Its path for those that see the testbed."""

    def plug(self) -> None:
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
        """Reports as lines: each ended by an end-of-file character, its bytes taken literally by one in front."""
        tty.setraw(far)
        settings = termios.tcgetattr(far)
        settings[3] |= termios.ICANON | termios.IEXTEN
        special = [b"\0"] * len(settings[6])  # none of them
        special[termios.VLNEXT], special[termios.VEOF] = LITERAL, END
        settings[6] = special
        termios.tcsetattr(far, termios.TCSANOW, settings)

    def _serve(self, near: int, far: int) -> None:
        device = _Numbered(self.emulator, self._identity.report_size)
        serve(device, near, self._stopping.is_set, encode=lambda message: self._encode(message, far))

    def _encode(self, message: bytes, far: int) -> bytes:
        (waiting,) = struct.unpack("i", ioctl(far, termios.FIONREAD, bytes(4)))
        if waiting >= QUEUE * self._identity.report_size:
            return b""
        return b"".join(LITERAL + message[i : i + 1] for i in range(len(message))) + END


class _Numbered:
    """Takes bytes as hidapi writes them, and gives the device reports without the number in front."""

    def __init__(self, emulator: Emulator, report_size: int) -> None:
        self._device = emulator
        self.faults = emulator.faults
        self._size = 1 + report_size
        self._rest = b""
        self._came_at = 0.0

    def receive(self, data: bytes, now: float) -> None:
        if now - self._came_at > TORN_S:
            self._rest = b""
        self._rest += data
        self._came_at = now
        while len(self._rest) >= self._size:
            report, self._rest = self._rest[1 : self._size], self._rest[self._size :]
            self._device.receive(report, now)

    def advance(self, now: float) -> None:
        self._device.advance(now)

    def replies(self, now: float) -> list[bytes]:
        return self._device.replies(now)

    def next_timer(self) -> float | None:
        return self._device.next_timer()
