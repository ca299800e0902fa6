"""Emulated devices of the kernel's input layer (evdev) in a testbed of umockdev."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from struct import Struct, calcsize
from typing import NamedTuple

EVENT = Struct("@llHHi")
"""struct input_event of a 64-bit kernel: seconds, microseconds, type, code, value."""
EV_SYN, EV_KEY, EV_ABS = 0x00, 0x01, 0x03
KEY_BYTES, NAME_BYTES = 96, 256
"""Sizes that python-evdev asks for, of bit maps and texts; umockdev gives less than was asked for as nothing."""
USB_BUS = 3


class AxisRange(NamedTuple):
    """What the kernel says of an absolute axis."""

    least: int
    most: int
    value: int = 0


@dataclass(frozen=True, slots=True)
class InputIdentity:
    """A device with keys and absolute axes.

    Args:
        vendor: 16 bits.
        product: 16 bits.
        name: of the device.
        keys: codes of its keys.
        axes: its absolute axes, by their codes.
        serial_number: empty for none.
    """

    vendor: int
    product: int
    name: str
    keys: tuple[int, ...]
    axes: Mapping[int, AxisRange]
    serial_number: str = ""

    def node(self, number: int) -> str:
        return f"/dev/input/event{number}"

    def paths(self, number: int, instance: int) -> tuple[str, ...]:
        device = f"/devices/pci0000:00/0000:00:14.0/usb1/1-{instance}/1-{instance}:1.0/input/input{instance}"
        return device, f"{device}/event{number}"

    def description(self, number: int, instance: int) -> str:
        device, node = self.paths(number, instance)
        size = calcsize("l")
        bits = bitmap(self.keys, KEY_BYTES)
        words = [int.from_bytes(bits[at : at + size], "little") for at in range(0, KEY_BYTES, size)]
        while len(words) > 1 and words[-1] == 0:
            words.pop()
        lines = [
            *(
                f"P: {device}",
                "E: SUBSYSTEM=input",
                f'E: NAME="{self.name}"',
                "E: ID_INPUT=1",
                "E: ID_INPUT_JOYSTICK=1",
            ),
            *(f"A: name={self.name}", f"A: uniq={self.serial_number}"),
            f"A: capabilities/key={' '.join(f'{word:x}' for word in reversed(words))}",
            *("", f"P: {node}", f"E: DEVNAME={self.node(number)}", "E: SUBSYSTEM=input", "E: MAJOR=13"),
            *(f"E: MINOR={64 + number}", "L: device=../../input" + str(instance)),
        ]
        return "\n".join(lines) + "\n"

    def ioctls(self, number: int) -> str:
        """Of the size that python-evdev asks for."""
        version = b"\x01\x00\x01\x00"
        identity = b"".join(part.to_bytes(2, "little") for part in (USB_BUS, self.vendor, self.product, 0x0100))
        name = self.name.encode()[: NAME_BYTES - 1]
        texts = {"EVIOCGNAME": name, "EVIOCGPHYS": b"usb/input0", "EVIOCGUNIQ": self.serial_number.encode()}
        lines = [
            f"@DEV {self.node(number)}",
            f"EVIOCGVERSION 0 {version.hex().upper()}",
            f"EVIOCGID 0 {identity.hex().upper()}",
            "EVIOCGEFFECTS 0 00000000",
            *(
                f"{request}(0) {len(text) + 1} {text.ljust(NAME_BYTES, bytes(1)).hex().upper()}"
                for request, text in texts.items()
            ),
            f"EVIOCGBIT(0) 4 {bitmap((EV_SYN, EV_KEY, EV_ABS), 4).hex().upper()}",
            f"EVIOCGBIT({EV_KEY}) {KEY_BYTES} {bitmap(self.keys, KEY_BYTES).hex().upper()}",
            f"EVIOCGBIT({EV_ABS}) {KEY_BYTES} {bitmap(self.axes, KEY_BYTES).hex().upper()}",
            f"EVIOCGKEY(0) {KEY_BYTES} {bytes(KEY_BYTES).hex().upper()}",
            *(
                f"EVIOCGABS({code}) 0 {Struct('<6i').pack(axis.value, axis.least, axis.most, 0, 0, 0).hex().upper()}"
                for code, axis in self.axes.items()
            ),
        ]
        return "\n".join(lines) + "\n"


def bitmap(codes: Iterable[int], size: int) -> bytes:
    """Bit i of the `size` bytes is set for each code i."""
    return sum(1 << code for code in codes).to_bytes(size, "little")


def event(kind: int, code: int, value: int, at: float) -> bytes:
    """An event as the kernel writes it; `at` is its time [s]."""
    seconds = int(at)
    return EVENT.pack(seconds, int((at - seconds) * 1e6), kind, code, value)
