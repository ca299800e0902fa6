"""An emulated HID device at its node in /dev: a pseudo terminal that keeps reports apart as the kernel does."""

import struct
import termios
import tty
from collections.abc import Callable
from fcntl import ioctl

from weberlink.hardware.emulator import Emulator, serve
from weberlink.hardware.pty_device import PtyDevice
from weberlink.hardware.umockdev.description import HidIdentity, node_of
from weberlink.hardware.umockdev.testbed import Testbed

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
