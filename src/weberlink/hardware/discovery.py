"""USB devices that are plugged in, and the choice among them."""

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

from weberlink.hardware.fault import HardwareFault


class UsbId(NamedTuple):
    """USB vendor and product; product None matches all of the vendor."""

    vendor: int
    product: int | None = None

    def matches(self, vendor: int | None, product: int | None) -> bool:
        return vendor == self.vendor and self.product in (None, product)


@dataclass(frozen=True, slots=True)
class PluggedDevice:
    path: str  # to open, for example /dev/ttyACM0
    name: str = ""  # of the product; empty if it has none
    serial_number: str = ""
    problem: str | None = None  # why it cannot be used as it is, with what to do about it

    def __str__(self) -> str:
        number = f" (serial number {self.serial_number})" if self.serial_number else ""
        return f"{self.path} {self.name}".strip() + number


def hidapi() -> Any:
    """The hidapi binding, with its hidraw backend if available: libusb would detach the kernel driver."""
    try:
        return import_module("hidraw")
    except ImportError:
        return import_module("hid")


def serial_ports(ids: Iterable[UsbId]) -> list[PluggedDevice]:
    """Serial ports of USB devices with one of these identities, by path."""
    from serial.tools.list_ports import comports  # noqa: PLC0415 - a daemon without a serial device does without

    wanted = tuple(ids)
    return by_path(
        (port.device, port.product or port.description, port.serial_number)
        for port in comports()
        if any(id_.matches(port.vid, port.pid) for id_ in wanted)
    )


def hid_devices(
    ids: Iterable[UsbId], usage_pages: Sequence[int] = (0,), usages: Sequence[int] = ()
) -> list[PluggedDevice]:
    """HID devices with one of these identities, usage pages and usages (0: not reported), by path; no usages: any.

    A composite device has several; the usage page, or the usage within it, selects one."""
    wanted = tuple(ids)
    return by_path(
        (entry["path"].decode(errors="replace"), entry.get("product_string"), entry.get("serial_number"))
        for entry in hidapi().enumerate()
        if any(id_.matches(entry["vendor_id"], entry["product_id"]) for id_ in wanted)
        and entry.get("usage_page", 0) in usage_pages
        and (not usages or entry.get("usage", 0) in usages)
    )


def by_path(found: Iterable[tuple[str, str | None, str | None]]) -> list[PluggedDevice]:
    """Devices of their paths, names and serial numbers; with the problem, where this user may not open one."""
    devices = []
    for path, name, number in sorted(found, key=lambda each: each[0]):
        may = not path.startswith("/dev/") or os.access(path, os.R_OK | os.W_OK)
        devices.append(PluggedDevice(path, name or "", number or "", None if may else permission_advice(path)))
    return devices


def only(found: Sequence[PluggedDevice], what: str, option: str) -> PluggedDevice:
    """Choose the device when the file names none; `option` is the key that chooses among several. Raises HardwareFault
    if none is there, several are, or the one cannot be used."""
    if not found:
        raise HardwareFault(f"{what}: nothing of the kind is plugged in; `weberlink device list` lists what there is")
    if len(found) > 1:
        there = ", ".join(map(str, found))
        raise HardwareFault(f"{what}: {len(found)} are plugged in: {there}; say which with {option}: {found[0].path}")
    if found[0].problem is not None:
        raise HardwareFault(f"{what}: {found[0].path}: {found[0].problem}")
    return found[0]


def permission_advice(path: str) -> str:
    return (
        f"no permission to open {path}; install the shipped rules with: weberlink device rules, "
        "then unplug it and plug it in again"
    )


class DeviceLocator:
    """Finds the device of a driver, and notices by the serial number when another one is in its place.

    `port` is the path that the options name, None for the only device of those `plugged` in."""

    def __init__(self, name: str, port: str | None, plugged: Callable[[], Sequence[PluggedDevice]]) -> None:
        self._name = name
        self._port = port
        self._plugged = plugged
        self._serial_number = ""

    def forget(self) -> None:
        self._serial_number = ""

    def locate(self) -> str:
        """The path to open; that of the same device as last time. Raises HardwareFault if none is there, several are,
        the one cannot be used, or it is another one."""
        there = list(self._plugged())
        if self._port is None:
            found = only(there, self._name, "master.device.port")
        else:
            found = next((each for each in there if each.path == self._port), PluggedDevice(self._port))
        if self._serial_number not in ("", found.serial_number):
            raise HardwareFault(f"{found} is another one than before, which had serial number {self._serial_number}")
        self._serial_number = found.serial_number
        return found.path
