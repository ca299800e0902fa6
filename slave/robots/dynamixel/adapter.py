"""The USB adapter between host and motors: what it is known by, and how long it sits on what it has received."""

from pathlib import Path
from typing import Final

from weberlink.hardware.discovery import UDEV_RULES, UsbId

USB: Final = (UsbId(0x0403, 0x6014), UsbId(0x0403, 0x6001), UsbId(0x0403, 0x6010), UsbId(0x0403, 0x6015))
"""ROBOTIS U2D2 (an FT232H by its identity) and other adapters with a chip of FTDI; which one leads to an arm, only
the motors can say."""

SYSFS: Final = Path("/sys/bus/usb-serial/devices")


def latency_ms(path: str, sysfs: Path = SYSFS) -> int | None:
    """How long the driver of an FTDI chip lets it collect bytes [ms]; None where nothing of the kind is known."""
    try:
        return int((sysfs / Path(path).resolve().name / "latency_timer").read_text())
    except (OSError, ValueError):
        return None


def latency_advice(path: str, sysfs: Path = SYSFS) -> str | None:
    """What to do about an adapter that collects for more than 1 ms; None where there is nothing to do."""
    latency = latency_ms(path, sysfs)
    if latency is None or latency <= 1:
        return None
    name = Path(path).resolve().name
    return (
        f"{path} collects what it receives for {latency} ms; set it to 1 ms with: "
        f"echo 1 | sudo tee {SYSFS / name / 'latency_timer'} (the shipped {UDEV_RULES} does so for good)"
    )
