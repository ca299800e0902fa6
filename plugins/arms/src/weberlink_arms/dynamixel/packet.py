"""Packets of Dynamixel protocol 2.0: bytes to packets and back.

Layout (ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0"; little endian)::

    FF FF FD 00 | id | length (2) | instruction | parameters ... | crc (2)

`length` counts from the instruction to the end of the CRC. A status has the instruction 0x55 and an error byte before
its parameters. Stuffing (an FD after FF FF FD between instruction and CRC) makes a header unique.
"""

from typing import Final

from weberlink_arms.servo.packet import Framing, Packet, Status

HEADER: Final = b"\xff\xff\xfd\x00"
HIGHEST_ID: Final = 252
STATUS: Final = 0x55
"""Instruction of an answer."""

ALERT: Final = 0x80
"""Bit of the error byte: see the hardware error register."""
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

LONGEST: Final = 1024
"""Bytes of the longest packet that a reader accepts."""

_SHORTEST: Final = 10
_UNSTUFFED: Final = HEADER[:3]
_STUFFED: Final = _UNSTUFFED + b"\xfd"


def _table() -> tuple[int, ...]:
    entries = []
    for byte in range(256):
        remainder = byte << 8
        for _ in range(8):
            remainder = (remainder << 1) ^ (0x8005 if remainder & 0x8000 else 0)
        entries.append(remainder & 0xFFFF)
    return tuple(entries)


_TABLE: Final = _table()


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


class _FrameReader:
    """Cuts a stream into frames; never raises, and never holds more than the longest frame.

    Stuffing keeps headers out of frames, so a header inside one means that it was cut short.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.bad = 0

    def clear(self) -> None:
        self._buffer.clear()

    def _frames(self, data: bytes) -> list[tuple[int, bytes]]:
        """Id, and instruction with parameters, of every frame that is now whole."""
        frames: list[tuple[int, bytes]] = []
        for start in range(0, len(data), LONGEST):
            self._buffer += data[start : start + LONGEST]
            while self._cut(frames):
                pass
        return frames

    def _cut(self, frames: list[tuple[int, bytes]]) -> bool:
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
        return self._take(end, frames)

    def _take(self, end: int, frames: list[tuple[int, bytes]]) -> bool:
        buffer = self._buffer
        if crc16(buffer[: end - 2]) != buffer[end - 2] | buffer[end - 1] << 8:
            self.bad += 1
            del buffer[:4]
            return True
        body = bytes(buffer[7 : end - 2])
        if _STUFFED in body:
            body = body.replace(_STUFFED, _UNSTUFFED)
        frames.append((buffer[4], body))
        del buffer[:end]
        return True


class _Requests(_FrameReader):
    """For a motor; answers of others are skipped."""

    def feed(self, data: bytes) -> list[Packet]:
        return [Packet(id_, body[0], body[1:]) for id_, body in self._frames(data) if body[0] != STATUS]


class _Answers(_FrameReader):
    """For the host; an echo of its own requests is skipped."""

    def feed(self, data: bytes) -> list[Status]:
        return [
            Status(id_, body[1], body[2:]) for id_, body in self._frames(data) if body[0] == STATUS and len(body) > 1
        ]


class _Framing(Framing):
    OVERHEAD = _SHORTEST + 1
    WIDTH = 2
    REFUSAL = ~ALERT & 0xFF
    MARKS = (120, range(11, 27))

    def encode(self, packet: Packet | Status) -> bytes:
        code = (STATUS, packet.error) if isinstance(packet, Status) else (packet.instruction,)
        body = bytes(code) + packet.parameters
        if _UNSTUFFED in body:
            body = body.replace(_UNSTUFFED, _STUFFED)
        frame = HEADER + bytes((packet.id,)) + (len(body) + 2).to_bytes(2, "little") + body
        return frame + crc16(frame).to_bytes(2, "little")

    def requests(self) -> _Requests:
        return _Requests()

    def answers(self) -> _Answers:
        return _Answers()


FRAMING: Final = _Framing()
