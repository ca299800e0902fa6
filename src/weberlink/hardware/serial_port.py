"""A serial port with exclusive access; every wait has a time limit.

pyserial opens and configures it; reads use the descriptor directly, at one system call each.
"""

import errno
import os
import termios
from contextlib import suppress
from select import select
from time import monotonic, sleep

import serial

from weberlink.hardware.discovery import permission_advice
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.guardian import Guardian

CHUNK = 4096
WRITING_S = 0.05  # longest time that a port may accept no data [s]
LEAVING_S = 0.05  # longest wait for pending data before the port is closed [s]


class SerialPort:
    """An open port.

    `baud` [bit/s] is without effect on a native USB port. The guardian, None for a device that takes its force off
    itself, watches from the opening of the port to its closing. Raises HardwareFault if the port is not there, in use,
    or not permitted, or the guardian does not start."""

    def __init__(self, path: str, baud: int = 115_200, guardian: Guardian | None = None) -> None:
        self.path = path
        self._guardian = guardian
        try:
            self._port = serial.Serial(path, baud, timeout=0, write_timeout=WRITING_S, exclusive=True)
        except (OSError, ValueError, termios.error) as error:  # pyserial's own is an OSError
            raise HardwareFault(f"{path}: {_reason(path, error)}") from None
        with suppress(ValueError, OSError, NotImplementedError):  # a pty has no latency to lower
            self._port.set_low_latency_mode(True)
        self._descriptor = self._port.fileno()
        if guardian is not None:
            try:
                guardian.watch(self._descriptor)
            except HardwareFault:
                self._port.close()
                raise

    def write(self, data: bytes) -> None:
        """Write all data. Raises HardwareFault if it was unplugged, or takes nothing, or of the guardian:
        `Guardian.before`."""
        guardian = self._guardian
        if guardian is None:
            self._write(data)
        else:
            guardian.before(data)
            self._write(data)
            guardian.after(data)

    def _write(self, data: bytes) -> None:
        sent, until = 0, monotonic() + WRITING_S
        try:
            while sent < len(data):
                _, ready, _ = select((), (self._descriptor,), (), max(0.0, until - monotonic()))
                taken = 0
                with suppress(BlockingIOError):  # it was ready for less than a byte
                    taken = os.write(self._descriptor, data[sent:]) if ready else 0
                if taken:
                    sent, until = sent + taken, monotonic() + WRITING_S
                    if sent < len(data) and self._guardian is not None:
                        # The guardian may write next, and the rest of this message would corrupt the stream behind it.
                        raise HardwareFault(f"{self.path}: takes no more data")
                elif monotonic() >= until:
                    raise HardwareFault(f"{self.path}: takes no more data")
        except (OSError, ValueError):
            raise HardwareFault(f"{self.path}: unplugged") from None

    def read(self, until: float) -> bytes:
        """Read what has come, waiting for the first byte until `until` [s, monotonic]; empty if none comes. Raises
        HardwareFault if it was unplugged."""
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
        """Read everything that has come, without waiting."""
        return b"".join(iter(lambda: self.read(0.0), b""))

    def close(self) -> None:
        """Close the port after pending data has left; may be called again."""
        self._descriptor = -1  # the number may be another file's by now
        if self._guardian is not None:
            self._guardian.stop()  # it has the port open too
        with suppress(OSError, termios.error):
            # The kernel would delay closing by half a minute if the device does not take the data.
            until = monotonic() + LEAVING_S
            while self._port.is_open and self._port.out_waiting:
                if monotonic() >= until:
                    self._port.reset_output_buffer()
                    break
                sleep(0.001)
        with suppress(OSError):
            self._port.close()


def _reason(path: str, error: Exception) -> str:
    if not os.path.exists(path):  # noqa: PTH110 - a path in a message, not one to work with
        return "there is no such port; `weberlink device list` lists what there is"
    if not os.access(path, os.R_OK | os.W_OK):
        return permission_advice(path)
    number = error.errno if isinstance(error, OSError) else None
    if number in (errno.EAGAIN, errno.EBUSY):  # the lock is taken, or the driver allows one alone
        return "in use by another process; is a second copy running?"
    if "Could not configure port" in str(error) or number == errno.ENOTTY:
        return "this is no serial port"
    return os.strerror(number) if number else str(error)
