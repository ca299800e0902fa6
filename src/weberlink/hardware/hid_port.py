"""A HID device, through hidapi; every wait has a time limit."""

import os
from time import monotonic

from weberlink.hardware.discovery import hidapi, permission_advice
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.guardian import Guardian

LONGEST_REPORT = 64


class HidPort:
    """An open device, at a path as given by `hardware.discovery.hid_devices`; raises HardwareFault if it is not there
    or not permitted."""

    def __init__(self, path: str) -> None:
        self.path = path
        self._guardian: Guardian | None = None
        self._device = hidapi().device()
        try:
            self._device.open_path(path.encode())
        except OSError as error:
            raise HardwareFault(f"{path}: {_reason(path) or error}") from None
        self._device.set_nonblocking(1)  # a read without a time limit takes what is there

    def guard(self, guardian: Guardian) -> None:
        """Have a guardian take the force off when this process stops, from now on and until the port is closed.

        Its messages begin with the number of the report, a zero byte. Raises HardwareFault if this host reaches the
        device through libusb, or the guardian does not start."""
        try:
            descriptor = os.open(self.path, os.O_WRONLY | os.O_CLOEXEC)
        except OSError as error:
            raise HardwareFault(f"{self.path}: no guardian can write to it: {error.strerror}") from None
        try:
            guardian.watch(descriptor)
        finally:
            os.close(descriptor)
        self._guardian = guardian

    def write(self, report: bytes, number: int = 0) -> None:
        """Send one report; `number` is that of the report, 0 for a device whose reports have none. Raises HardwareFault
        if it was unplugged, or of the guardian, see `Guardian.before`."""
        message, guardian = bytes([number]) + report, self._guardian
        if guardian is not None:
            guardian.before(message)
        try:
            written = self._device.write(message)
        except (OSError, ValueError):
            written = -1
        if written < 0:  # hidapi gives no other reason
            raise HardwareFault(f"{self.path}: unplugged")
        if guardian is not None:
            guardian.after(message)

    def read_all(self, until: float) -> list[bytes]:
        """All reports that have come, oldest first, as soon as there are any; a numbered one has its number in front.

        None where none comes by `until` [s, monotonic]; 0 does not wait. Raises HardwareFault if it was unplugged."""
        try:
            reports = self._waiting()
            if reports or until == 0.0:
                return reports
            # A timeout of 0 ms would wait for ever.
            first = self._device.read(LONGEST_REPORT, max(1, round((until - monotonic()) * 1e3)))
            return [bytes(first), *self._waiting()] if first else []
        except (OSError, ValueError):
            raise HardwareFault(f"{self.path}: unplugged") from None

    def _waiting(self) -> list[bytes]:
        return [bytes(report) for report in iter(lambda: self._device.read(LONGEST_REPORT), [])]

    def close(self) -> None:
        if self._guardian is not None:
            self._guardian.stop()
        self._device.close()


def _reason(path: str) -> str | None:
    """The reason why a device cannot be opened, which hidapi does not give; None if the path does not show it."""
    if not path.startswith("/"):  # of libusb
        return None
    try:
        with open(path, "r+b", buffering=0):  # noqa: PTH123 - a device, not a file to read
            return None
    except FileNotFoundError:
        return "there is no such device; `weberlink device list` lists what there is"
    except PermissionError:
        return permission_advice(path)
    except OSError as error:
        return error.strerror
