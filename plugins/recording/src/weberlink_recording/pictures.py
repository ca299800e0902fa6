"""Pictures in a recording: messages of Foxglove's schema CompressedImage, each a JPEG with its moment of capture."""

import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from struct import Struct, error
from typing import NamedTuple

from weberlink.telemetry.message import ENCAPSULATION
from weberlink.telemetry.pictures import Picture, path_beside, split

PICTURE_TOPIC = "/weberlink/pictures/"  # with the name of the camera behind it
PICTURE_SCHEMA = "foxglove_msgs/msg/CompressedImage"
PICTURE_DEFINITION = """\
# A picture of the robot, stamped at its capture on the clock of the records.
builtin_interfaces/Time timestamp
string frame_id
uint8[] data
string format
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
FORMAT = b"jpeg\0"
READ_BYTES = 1 << 20
_TIME, _LENGTH = Struct("<iI"), Struct("<I")
_NS = 1_000_000_000


class RecordedPicture(NamedTuple):
    """Moment on the wall clock [ns since 1970], camera, and JPEG."""

    wall_ns: int
    camera: str
    jpeg: bytes


def topic_of(camera: str) -> str:
    return PICTURE_TOPIC + "".join(letter if letter.isalnum() else "_" for letter in camera)


def pack_picture(picture: RecordedPicture) -> bytes:
    """The CDR body of a picture, without the encapsulation header."""
    body = bytearray(_TIME.pack(*divmod(picture.wall_ns, _NS)))
    for data in (picture.camera.encode() + b"\0", picture.jpeg, FORMAT):
        body += bytes(-len(body) % _LENGTH.size) + _LENGTH.pack(len(data)) + data
    return bytes(body)


def read_picture(message: bytes) -> RecordedPicture:
    """Read a message with its encapsulation header; ValueError if it is none, or not plain CDR."""
    body, at, parts = message[len(ENCAPSULATION) :], _TIME.size, []
    try:
        seconds, nanoseconds = _TIME.unpack_from(body)
        for _ in range(2):
            at += -at % _LENGTH.size
            (length,) = _LENGTH.unpack_from(body, at)
            at += _LENGTH.size + length
            parts.append(body[at - length : at])
    except error:
        raise ValueError("a picture that is cut short") from None
    if message[:2] != ENCAPSULATION[:2] or at > len(body):
        raise ValueError("a picture that is cut short, or not plain little-endian CDR")
    return RecordedPicture(seconds * _NS + nanoseconds, parts[0][:-1].decode(errors="replace"), parts[1])


class PictureSource:
    """The pictures of one side on this host, if it has any; never waits."""

    def __init__(self, ring: str) -> None:
        self._path: Path = path_beside(ring)
        self._socket: socket.socket | None = None
        self._rest = b""

    def read(self) -> Iterator[Picture]:
        """The pictures since the last call."""
        if self._socket is None and self._path.exists():
            asked = socket.socket(socket.AF_UNIX)
            asked.setblocking(False)
            with suppress(OSError):
                asked.connect(str(self._path))
                self._socket = asked
            if self._socket is None:
                asked.close()
        data = bytearray(self._rest)
        try:
            while self._socket is not None and (part := self._socket.recv(READ_BYTES)):
                data += part
        except BlockingIOError:
            pass
        except OSError:
            self.close()
        pictures, self._rest = split(bytes(data))
        return (picture for picture in pictures if picture.jpeg)

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
