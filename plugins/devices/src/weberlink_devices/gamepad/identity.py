"""What the emulated gamepad says of itself to the kernel's input layer, and events as the kernel has them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from struct import Struct, calcsize, pack
from typing import NamedTuple

from weberlink_devices.umockdev import TestbedEntry, usb_interface

EVENT = Struct("@llHHi")
"""struct input_event of a 64-bit kernel: seconds, microseconds, type, code, value."""
EV_SYN, EV_KEY, EV_ABS = 0x00, 0x01, 0x03
KEY_BYTES, NAME_BYTES = 96, 256
"""Sizes that python-evdev asks for, of bit maps and texts; umockdev gives less than was asked for as nothing."""
USB_BUS = 3


def event(kind: int, code: int, value: int, at: float) -> bytes:
    """An event as the kernel writes it; `at` is its time [s]."""
    seconds = int(at)
    return EVENT.pack(seconds, int((at - seconds) * 1e6), kind, code, value)


class AxisRange(NamedTuple):
    """What the kernel says of an absolute axis."""

    least: int
    most: int
    value: int = 0


@dataclass(frozen=True, slots=True)
class InputIdentity:
    """What a device of the kernel's input layer says of itself."""

    vendor: int  # 16 bits
    product: int  # 16 bits
    name: str
    keys: tuple[int, ...]  # their codes
    axes: Mapping[int, AxisRange]  # the absolute ones, by their codes
    serial_number: str = ""

    def entry(self, number: int, instance: int) -> TestbedEntry:
        path = f"/dev/input/event{number}"
        device = f"{usb_interface(instance)[1]}/input/input{instance}"
        node = f"{device}/event{number}"
        size, bits = calcsize("l"), _bitmap(self.keys, KEY_BYTES)
        words = [f"{int.from_bytes(bits[at : at + size], 'little'):x}" for at in range(0, KEY_BYTES, size)]
        keys = " ".join(reversed(words)).lstrip("0 ") or "0"
        lines = [
            *(f"P: {device}", "E: SUBSYSTEM=input", f'E: NAME="{self.name}"'),
            *("E: ID_INPUT=1", "E: ID_INPUT_JOYSTICK=1"),
            *(f"A: name={self.name}", f"A: uniq={self.serial_number}", f"A: capabilities/key={keys}"),
            *("", f"P: {node}", f"E: DEVNAME={path}", "E: SUBSYSTEM=input", "E: MAJOR=13"),
            *(f"E: MINOR={64 + number}", f"L: device=../../input{instance}", ""),
        ]
        return TestbedEntry(path, (device, node), "\n".join(lines), self._ioctls(path))

    def _ioctls(self, path: str) -> str:
        """Answers of the sizes that python-evdev asks for."""
        usb_id = b"".join(part.to_bytes(2, "little") for part in (USB_BUS, self.vendor, self.product, 0x0100))
        name = self.name.encode()[: NAME_BYTES - 1]
        texts = {"EVIOCGNAME": name, "EVIOCGPHYS": b"usb/input0", "EVIOCGUNIQ": self.serial_number.encode()}
        answers = {
            "EVIOCGID 0": usb_id,
            "EVIOCGEFFECTS 0": bytes(4),
            **{f"{name}(0) {len(text) + 1}": text.ljust(NAME_BYTES, b"\0") for name, text in texts.items()},
            "EVIOCGBIT(0) 4": _bitmap((EV_SYN, EV_KEY, EV_ABS), 4),
            f"EVIOCGBIT({EV_KEY}) {KEY_BYTES}": _bitmap(self.keys, KEY_BYTES),
            f"EVIOCGBIT({EV_ABS}) {KEY_BYTES}": _bitmap(self.axes, KEY_BYTES),
            f"EVIOCGKEY(0) {KEY_BYTES}": bytes(KEY_BYTES),
            **{
                f"EVIOCGABS({code}) 0": pack("<6i", axis.value, axis.least, axis.most, 0, 0, 0)
                for code, axis in self.axes.items()
            },
        }
        lines = [f"{request} {answer.hex().upper()}" for request, answer in answers.items()]
        return "\n".join([f"@DEV {path}", "EVIOCGVERSION 0 01000100", *lines, ""])


def _bitmap(codes: Iterable[int], size: int) -> bytes:
    """Bit i of the `size` bytes is set for each code i."""
    return sum(1 << code for code in codes).to_bytes(size, "little")
