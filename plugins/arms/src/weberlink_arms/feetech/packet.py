"""Packets of the Feetech STS protocol: bytes to frames and back.

Layout (Feetech's own SDK; the same as Dynamixel protocol 1.0, words little endian)::

    FF FF | id | length | code | parameters ... | checksum

`length` counts from the code to the checksum. The code is the instruction of a request and the error byte of an answer.
The checksum is the complement of the sum from the id to the last parameter. Nothing makes a header unique, so a reader
that lost the place may take parameters for a header until a checksum is wrong.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple

HEADER: Final = b"\xff\xff"
BROADCAST: Final = 0xFE
HIGHEST_ID: Final = 253

PING: Final = 0x01
READ: Final = 0x02
WRITE: Final = 0x03
SYNC_READ: Final = 0x82
SYNC_WRITE: Final = 0x83

VOLTAGE_ERROR: Final = 1
ANGLE_ERROR: Final = 2
HEAT_ERROR: Final = 4
CURRENT_ERROR: Final = 8
OVERLOAD_ERROR: Final = 32

OVERHEAD: Final = 6
"""Bytes of a frame without parameters."""
LONGEST_LENGTH: Final = 250
"""Largest length byte that a reader accepts, that of Feetech's SDK."""


class Frame(NamedTuple):
    """A request or an answer."""

    id: int
    code: int
    parameters: bytes = b""


def checksum(data: bytes | bytearray) -> int:
    """Of the bytes from the id to the last parameter."""
    return ~sum(data) & 0xFF


def encode(frame: Frame) -> bytes:
    body = bytes((frame.id, len(frame.parameters) + 2, frame.code)) + frame.parameters
    return HEADER + body + bytes((checksum(body),))


def ping(id_: int) -> bytes:
    return encode(Frame(id_, PING))


def read(id_: int, address: int, size: int) -> bytes:
    return encode(Frame(id_, READ, bytes((address, size))))


def write(id_: int, address: int, data: bytes) -> bytes:
    return encode(Frame(id_, WRITE, bytes((address,)) + data))


def sync_read(address: int, size: int, ids: Iterable[int]) -> bytes:
    """Read the same registers of several servos, which answer in this order."""
    return encode(Frame(BROADCAST, SYNC_READ, bytes((address, size, *ids))))


def sync_write(address: int, size: int, values: Iterable[tuple[int, bytes]]) -> bytes:
    """Write the same registers of several servos, `size` bytes each; they do not answer."""
    return encode(
        Frame(BROADCAST, SYNC_WRITE, bytes((address, size)) + b"".join(bytes((id_,)) + data for id_, data in values))
    )


class FrameReader:
    """Cuts a stream into frames; never raises, and never holds more than the longest frame."""

    def __init__(self) -> None:
        self._waiting = bytearray()
        self.bad_checksums = 0
        """Frames with a wrong checksum since the start."""

    def clear(self) -> None:
        self._waiting.clear()

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that are complete with these bytes."""
        waiting = self._waiting
        waiting += data
        frames: list[Frame] = []
        while (begin := waiting.find(HEADER)) >= 0:
            del waiting[:begin]
            if len(waiting) < 4:
                return frames
            size = waiting[3] + 4
            if waiting[2] > BROADCAST or not 2 <= waiting[3] <= LONGEST_LENGTH:
                del waiting[:1]
            elif len(waiting) < size:
                return frames
            elif checksum(waiting[2 : size - 1]) != waiting[size - 1]:
                self.bad_checksums += 1
                del waiting[:1]
            else:
                frames.append(Frame(waiting[2], waiting[4], bytes(waiting[5 : size - 1])))
                del waiting[:size]
        del waiting[: len(waiting) - waiting.endswith(b"\xff")]  # it may be half a header
        return frames
