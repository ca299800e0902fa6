"""Packets of Dynamixel protocol 2.0: bytes to packets and back.

Layout (ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0"; little endian)::

    FF FF FD 00 | id | length (2) | instruction | parameters ... | crc (2)

`length` counts from the instruction to the end of the CRC. A status has the instruction 0x55 and an error byte before
its parameters. Stuffing (an FD after FF FF FD between instruction and CRC) makes a header unique.
"""

from collections.abc import Callable
from typing import Final, Generic, TypeVar

from weberlink_arms.servo.packet import Framing, Packet, Status

HEADER: Final = b"\xff\xff\xfd\x00"
HIGHEST_ID: Final = 252
STATUS: Final = 0x55  # instruction of an answer

ALERT: Final = 0x80  # bit of the error byte: see the hardware error register
RESULT_FAIL: Final = 1
INSTRUCTION_ERROR: Final = 2
CRC_ERROR: Final = 3
DATA_RANGE_ERROR: Final = 4
DATA_LENGTH_ERROR: Final = 5
DATA_LIMIT_ERROR: Final = 6
ACCESS_ERROR: Final = 7

ERRORS: Final = {
    RESULT_FAIL: "the instruction failed",
    INSTRUCTION_ERROR: "unknown instruction",
    CRC_ERROR: "it received a wrong checksum",
    DATA_RANGE_ERROR: "value out of range",
    DATA_LENGTH_ERROR: "value of the wrong length",
    DATA_LIMIT_ERROR: "value beyond the limit set in the motor",
    ACCESS_ERROR: "register not writable now",
}

LONGEST: Final = 1024  # bytes of the longest packet that a reader accepts
_SHORTEST: Final = 10
_UNSTUFFED: Final = HEADER[:3]
_STUFFED: Final = _UNSTUFFED + b"\xfd"


def _remainder(byte: int) -> int:
    remainder = byte << 8
    for _ in range(8):
        remainder = (remainder << 1) ^ (0x8005 if remainder & 0x8000 else 0)
    return remainder & 0xFFFF


_TABLE: Final = tuple(map(_remainder, range(256)))


def crc16(data: bytes | bytearray) -> int:
    """CRC-16 of polynomial 0x8005 that starts at 0, bits in their order (CRC-16/BUYPASS)."""
    crc, table = 0, _TABLE
    for byte in data:
        crc = ((crc << 8) & 0xFFFF) ^ table[(crc >> 8) ^ byte]
    return crc


def error_text(error: int) -> str:
    """Meaning of the error byte, without its alert bit."""
    number = error & ~ALERT
    return ERRORS.get(number, f"error {number}") if number else "no error"


Heard = TypeVar("Heard", Packet, Status)


def _request(id_: int, body: bytes) -> list[Packet]:
    return [] if body[0] == STATUS else [Packet(id_, body[0], body[1:])]


def _answer(id_: int, body: bytes) -> list[Status]:
    return [Status(id_, body[1], body[2:])] if body[0] == STATUS and len(body) > 1 else []


class _Reader(Generic[Heard]):
    """Cuts a stream into frames; `kind` makes packets of them, and none of those of the other kind.

    Stuffing keeps headers out of frames, so a header inside one means that it was cut short.
    """

    def __init__(self, kind: Callable[[int, bytes], list[Heard]]) -> None:
        self._kind: Callable[[int, bytes], list[Heard]] = kind
        self._buffer, self.bad = bytearray(), 0

    def clear(self) -> None:
        self._buffer.clear()

    def feed(self, data: bytes) -> list[Heard]:
        heard: list[Heard] = []
        for start in range(0, len(data), LONGEST):
            self._buffer += data[start : start + LONGEST]
            while self._cut(heard):
                pass
        return heard

    def _cut(self, heard: list[Heard]) -> bool:  # noqa: PLR0911
        """Remove one frame or some garbage from the front; False if more bytes are needed."""
        buffer = self._buffer
        begin = buffer.find(HEADER)
        if begin != 0:
            # Without a header, the last bytes may be the beginning of one.
            begun = next((length for length in (3, 2, 1) if buffer.endswith(HEADER[:length])), 0)
            del buffer[: begin if begin > 0 else len(buffer) - begun]
            if begin < 0:
                return False
        if len(buffer) < 7:
            return False
        end = 7 + (buffer[5] | buffer[6] << 8)
        if not _SHORTEST <= end <= LONGEST:
            del buffer[:4]
            return True
        following = buffer.find(HEADER, 4, end + 3)  # the last byte may be the first of the next header
        if following >= 0:
            del buffer[:following]
            return True
        if len(buffer) < end:
            return False
        if crc16(buffer[: end - 2]) != buffer[end - 2] | buffer[end - 1] << 8:
            self.bad += 1
            del buffer[:4]
            return True
        heard += self._kind(buffer[4], bytes(buffer[7 : end - 2]).replace(_STUFFED, _UNSTUFFED))
        del buffer[:end]
        return True


class _Framing(Framing):
    OVERHEAD = _SHORTEST + 1
    WIDTH = 2
    REFUSAL = ~ALERT & 0xFF
    MARKS = (120, range(11, 27))

    def encode(self, packet: Packet | Status) -> bytes:
        code = (STATUS, packet.error) if isinstance(packet, Status) else (packet.instruction,)
        body = (bytes(code) + packet.parameters).replace(_UNSTUFFED, _STUFFED)
        frame = HEADER + bytes((packet.id,)) + (len(body) + 2).to_bytes(2, "little") + body
        return frame + crc16(frame).to_bytes(2, "little")

    def requests(self) -> _Reader[Packet]:
        return _Reader(_request)

    def answers(self) -> _Reader[Status]:
        return _Reader(_answer)


FRAMING: Final = _Framing()
