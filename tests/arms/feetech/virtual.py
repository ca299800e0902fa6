"""An emulated SO-101 on a port in virtual time, and a request as seen by it."""

from weberlink.arms.emulators.feetech import FeetechEmulator
from weberlink.arms.feetech.packet import Frame, FrameReader


class VirtualPort:
    """As `hardware.serial_port.SerialPort`, with an emulator at its other end and a clock that passes while one waits.

    Wire faults: those of the emulator, but `late_s`.
    """

    path = "/dev/virtual"

    def __init__(self, emulator: FeetechEmulator) -> None:
        self.emulator = emulator
        self.now = 100.0
        self.closed = False
        self.sent: list[bytes] = []
        emulator.advance(self.now)

    def clock(self) -> float:
        return self.now

    def pause(self, time: float) -> None:
        self.now += time

    def write(self, data: bytes) -> None:
        assert not self.closed
        self.sent.append(data)
        self.emulator.receive(data, self.now)

    def read(self, until: float) -> bytes:
        while not (said := self.drain()) and self.now < until:
            due = self.emulator.next_timer()
            self.now = min(until, max(self.now + 1e-5, until if due is None else due))
        return said

    def drain(self) -> bytes:
        faults = self.emulator.faults
        self.emulator.advance(self.now)
        said = b"".join(self.emulator.replies(self.now))
        if said and faults.garble:
            faults.garble -= 1
            said = said[:7] + bytes((said[7] ^ 0x55,)) + said[8:]
        return b"" if faults.silent else said

    def close(self) -> None:
        self.closed = True


def frames(data: bytes) -> list[Frame]:
    return FrameReader().feed(data)
