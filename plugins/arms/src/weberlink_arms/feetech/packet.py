"""Packets of the Feetech STS protocol: bytes to frames and back.

Layout (Feetech's own SDK; the same as Dynamixel protocol 1.0, words little endian)::

    FF FF | id | length | code | parameters ... | checksum

`length` counts from the code to the checksum. The code is the instruction of a request and the error byte of an answer.
The checksum is the complement of the sum from the id to the last parameter. Nothing makes a header unique, so a reader
that lost the place may take parameters for a header until a checksum is wrong.
"""

from collections.abc import Callable
from typing import Final, Generic, TypeVar

from weberlink_arms.servo.packet import Framing, Packet, Status

HEADER: Final = b"\xff\xff"
HIGHEST_ID: Final = 253

VOLTAGE_ERROR: Final = 1
HEAT_ERROR: Final = 4
OVERLOAD_ERROR: Final = 32

LONGEST_LENGTH: Final = 250  # largest length byte that a reader accepts, that of Feetech's SDK


def checksum(data: bytes | bytearray) -> int:
    return ~sum(data) & 0xFF


Heard = TypeVar("Heard", Packet, Status)


class _Reader(Generic[Heard]):
    """Nothing in a frame tells requests from answers."""

    def __init__(self, kind: Callable[[int, int, bytes], Heard]) -> None:
        self._kind: Callable[[int, int, bytes], Heard] = kind
        self._waiting = bytearray()
        self.bad = 0

    def clear(self) -> None:
        self._waiting.clear()

    def feed(self, data: bytes) -> list[Heard]:
        waiting = self._waiting
        waiting += data
        frames: list[Heard] = []
        while (begin := waiting.find(HEADER)) >= 0:
            del waiting[:begin]
            if len(waiting) < 4:
                return frames
            size = waiting[3] + 4
            if waiting[2] > HIGHEST_ID + 1 or not 2 <= waiting[3] <= LONGEST_LENGTH:
                del waiting[:1]
            elif len(waiting) < size:
                return frames
            elif checksum(waiting[2 : size - 1]) != waiting[size - 1]:
                self.bad += 1
                del waiting[:1]
            else:
                frames.append(self._kind(waiting[2], waiting[4], bytes(waiting[5 : size - 1])))
                del waiting[:size]
        del waiting[: len(waiting) - waiting.endswith(b"\xff")]  # it may be half a header
        return frames


class _Framing(Framing):
    OVERHEAD = 6
    WIDTH = 1
    REFUSAL = 0
    MARKS = (56, range(3, 15))

    def encode(self, packet: Packet | Status) -> bytes:
        id_, code, parameters = packet
        body = bytes((id_, len(parameters) + 2, code)) + parameters
        return HEADER + body + bytes((checksum(body),))

    def requests(self) -> _Reader[Packet]:
        return _Reader(Packet)

    def answers(self) -> _Reader[Status]:
        return _Reader(Status)


FRAMING: Final = _Framing()
