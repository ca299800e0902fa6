"""Devices of the kernel's input layer, and those that a library reaches by libusb, among what is plugged in."""

from collections.abc import Iterable
from pathlib import Path
from struct import calcsize

from weberlink.hardware.discovery import PluggedDevice, UsbId, by_path


def input_devices(key: int, root: Path = Path("/sys/class/input")) -> list[PluggedDevice]:
    """Event devices of the kernel that have a key of this code, by path; none of them is opened."""
    found = []
    for entry in root.glob("event*"):
        device = entry / "device"
        words = _attribute(device, "capabilities/key").split() or ["0"]  # hexadecimal, the highest first
        size = 8 * calcsize("l")
        if sum(int(word, 16) << size * place for place, word in enumerate(reversed(words))) >> key & 1:
            found.append((f"/dev/input/{entry.name}", _attribute(device, "name"), _attribute(device, "uniq")))
    return by_path(found)


def usb_devices(ids: Iterable[UsbId], root: Path = Path("/sys/bus/usb/devices")) -> list[PluggedDevice]:
    """USB devices with one of these identities that a library reaches by libusb, by path; none of them is opened."""
    wanted = tuple(ids)
    found = []
    for entry in root.glob("*"):
        try:
            vendor, product, bus, number = (
                int(_attribute(entry, name), base)
                for name, base in (("idVendor", 16), ("idProduct", 16), ("busnum", 10), ("devnum", 10))
            )
        except ValueError:  # an interface, which has none of these
            continue
        if any(id_.matches(vendor, product) for id_ in wanted):
            path = f"/dev/bus/usb/{bus:03d}/{number:03d}"
            found.append((path, _attribute(entry, "product"), _attribute(entry, "serial")))
    return by_path(found)


def _attribute(device: Path, name: str) -> str:
    try:
        return (device / name).read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
