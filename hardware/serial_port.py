"""A serial port, opened for one process alone, with waits that have an end.

pyserial opens and sets it up; reading goes by the descriptor, which costs one system call for whatever is there.
"""

import os
from contextlib import suppress
from select import select
from time import monotonic

import serial

from hardware.fault import HardwareFault
from hardware.found import permission_advice

CHUNK = 4096


class SerialPort:
    """An open port.

    Args:
        path: of the device, or of a link to it.
        baud: rate [bit/s]; without meaning where the port is USB from end to end.

    Raises:
        HardwareFault: it is not there, in use, or not permitted.
    """

    def __init__(self, path: str, baud: int = 115_200) -> None:
        self.path = path
        try:
            self._port = serial.Serial(path, baud, timeout=0, write_timeout=0.05, exclusive=True)
        except serial.SerialException as error:
            raise HardwareFault(f"{path}: {_reason(path, error)}") from None
        except ValueError as error:
            raise HardwareFault(f"{path}: {error}") from None
        with suppress(ValueError, OSError, NotImplementedError):  # a pty has no latency to lower
            self._port.set_low_latency_mode(True)
        self._descriptor = self._port.fileno()

    def write(self, data: bytes) -> None:
        """Hand over all of it.

        Raises:
            HardwareFault: it was unplugged, or takes nothing.
        """
        try:
            sent = 0
            while sent < len(data):
                _, ready, _ = select((), (self._descriptor,), (), 0.05)
                if not ready:
                    raise HardwareFault(f"{self.path}: takes no more data")
                sent += os.write(self._descriptor, data[sent:] if sent else data)
        except (OSError, ValueError):
            raise HardwareFault(f"{self.path}: unplugged") from None

    def read(self, until: float) -> bytes:
        """Whatever has come, as soon as something has; nothing where it does not by `until` [s, monotonic].

        Raises:
            HardwareFault: it was unplugged.
        """
        try:
            ready, _, _ = select((self._descriptor,), (), (), max(0.0, until - monotonic()))
            if not ready:
                return b""
            data = os.read(self._descriptor, CHUNK)
        except (OSError, ValueError):
            data = b""
        if not data:  # readable and empty: nobody is at the other end
            raise HardwareFault(f"{self.path}: unplugged")
        return data

    def drain(self) -> bytes:
        """Everything that has come, without a wait."""
        parts = []
        while part := self.read(0.0):
            parts.append(part)
        return b"".join(parts)

    def close(self) -> None:
        with suppress(OSError):
            self._port.close()


def _reason(path: str, error: serial.SerialException) -> str:
    if not os.path.exists(path):  # noqa: PTH110 - a path in a message, not one to work with
        return "there is no such port; `weberlink devices` lists what there is"
    if not os.access(path, os.R_OK | os.W_OK):
        return permission_advice(path)
    if "exclusively lock" in str(error) or "busy" in str(error):
        return "in use by another process; is a second copy running?"
    return os.strerror(error.errno) if error.errno else str(error)
