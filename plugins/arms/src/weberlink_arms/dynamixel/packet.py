"""Packets of Dynamixel protocol 2.0: bytes to packets and back.

Layout (ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0"; little endian)::

    FF FF FD 00 | id | length (2) | instruction | parameters ... | crc (2)

`length` counts from the instruction to the end of the CRC. A status has the instruction 0x55 and an error byte before
its parameters. Stuffing (an FD after FF FF FD between instruction and CRC) makes a header unique.
"""

from collections.abc import Iterable
from struct import Struct
from typing import Final, NamedTuple

HEADER: Final = b"\xff\xff\xfd\x00"
BROADCAST: Final = 0xFE
HIGHEST_ID: Final = 252

PING: Final = 0x01
READ: Final = 0x02
WRITE: Final = 0x03
REBOOT: Final = 0x08
STATUS: Final = 0x55
SYNC_READ: Final = 0x82
SYNC_WRITE: Final = 0x83

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

OVERHEAD: Final = 10
"""Bytes of an instruction without parameters; a status has one more."""

_UNSTUFFED: Final = HEADER[:3]
_STUFFED: Final = _UNSTUFFED + b"\xfd"
_WORDS: Final = Struct("<HH")


class Packet(NamedTuple):
    """An instruction."""

    id: int
    instruction: int
    parameters: bytes = b""


class StatusPacket(NamedTuple):
    """A motor's answer; `error` is 0 for success."""

    id: int
    error: int
    parameters: bytes = b""


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


def encode_packet(packet: Packet) -> bytes:
    return _framed(packet.id, bytes((packet.instruction,)) + packet.parameters)


def encode_status(status: StatusPacket) -> bytes:
    return _framed(status.id, bytes((STATUS, status.error)) + status.parameters)


def _framed(id_: int, body: bytes) -> bytes:
    if _UNSTUFFED in body:
        body = body.replace(_UNSTUFFED, _STUFFED)
    frame = HEADER + bytes((id_,)) + (len(body) + 2).to_bytes(2, "little") + body
    return frame + crc16(frame).to_bytes(2, "little")


def ping(id_: int) -> Packet:
    return Packet(id_, PING)


def read(id_: int, address: int, size: int) -> Packet:
    return Packet(id_, READ, _WORDS.pack(address, size))


def write(id_: int, address: int, data: bytes) -> Packet:
    return Packet(id_, WRITE, address.to_bytes(2, "little") + data)


def sync_read(address: int, size: int, ids: Iterable[int]) -> Packet:
    """Read the same registers of several motors, which answer in this order."""
    return Packet(BROADCAST, SYNC_READ, _WORDS.pack(address, size) + bytes(ids))


def sync_write(address: int, size: int, values: Iterable[tuple[int, bytes]]) -> Packet:
    """Write the same registers of several motors, `size` bytes each; they do not answer."""
    return Packet(
        BROADCAST, SYNC_WRITE, _WORDS.pack(address, size) + b"".join(bytes((id_,)) + data for id_, data in values)
    )


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
        self.dropped_bytes = 0
        """Bytes that belong to no good frame."""
        self.bad_crc = 0
        """Frames whose checksum was wrong."""

    def clear(self) -> None:
        """Forget what has come of an unfinished frame."""
        self.dropped_bytes += len(self._buffer)
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
            self._drop(begin if begin > 0 else len(buffer) - begun)
            if begin < 0:
                return False
        if len(buffer) < 7:
            return False
        end = 7 + (buffer[5] | buffer[6] << 8)
        if not OVERHEAD <= end <= LONGEST:
            self._drop(4)
            return True
        following = buffer.find(HEADER, 4, end + 3)  # the last byte may be the first of the next header
        if following >= 0:
            self._drop(following)
            return True
        if len(buffer) < end:
            return False
        return self._take(end, frames)

    def _take(self, end: int, frames: list[tuple[int, bytes]]) -> bool:
        buffer = self._buffer
        if crc16(buffer[: end - 2]) != buffer[end - 2] | buffer[end - 1] << 8:
            self.bad_crc += 1
            self._drop(4)
            return True
        body = bytes(buffer[7 : end - 2])
        if _STUFFED in body:
            body = body.replace(_STUFFED, _UNSTUFFED)
        frames.append((buffer[4], body))
        del buffer[:end]
        return True

    def _drop(self, count: int) -> None:
        self.dropped_bytes += count
        del self._buffer[:count]


class PacketReader(_FrameReader):
    """Instructions in a stream, for a motor; status packets are skipped."""

    def feed(self, data: bytes) -> list[Packet]:
        """The instructions that are now complete, oldest first."""
        return [Packet(id_, body[0], body[1:]) for id_, body in self._frames(data) if body[0] != STATUS]


class StatusPacketReader(_FrameReader):
    """Status packets in a stream, for the host; an echo of its own instructions is skipped."""

    def feed(self, data: bytes) -> list[StatusPacket]:
        """The answers that are now complete, oldest first."""
        return [
            StatusPacket(id_, body[1], body[2:])
            for id_, body in self._frames(data)
            if body[0] == STATUS and len(body) > 1
        ]
