"""Which device it is that a driver speaks to, so that another one in its place is noticed."""

from collections.abc import Callable, Sequence

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.found import Found, only


class Identity:
    """Where the device is, and its serial number where it has one.

    Args:
        name: of the driver.
        port: path that the file names; None for the only one plugged in.
        plugged: what is plugged in.
    """

    def __init__(self, name: str, port: str | None, plugged: Callable[[], Sequence[Found]]) -> None:
        self._name = name
        self._port = port
        self._plugged = plugged
        self._serial_number = ""

    def forget(self) -> None:
        self._serial_number = ""

    def locate(self) -> str:
        """The path to open; the same device as the last time.

        Raises:
            HardwareFault: none is there, several are, the one cannot be used, or it is another one.
        """
        there = list(self._plugged())
        if self._port is None:
            found = only(there, self._name, "master.device.port")
        else:
            found = next((each for each in there if each.path == self._port), Found(self._port))
        if self._serial_number not in ("", found.serial_number):
            raise HardwareFault(f"{found} is another one than before, which had serial number {self._serial_number}")
        self._serial_number = found.serial_number
        return found.path


def located(path: str, fault: HardwareFault) -> HardwareFault:
    """The same complaint with the path in front, once."""
    return HardwareFault(f"{path}: {str(fault).removeprefix(f'{path}: ')}")
