"""Pictures in a recording: messages of Foxglove's schema CompressedImage, each a JPEG with its moment of capture."""

import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from struct import Struct
from typing import NamedTuple

from weberlink.config.cameras import path_beside
from weberlink_figures.pictures import Picture, split
from weberlink_recording.marks import NS, pack_cdr, read_cdr

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
_TIME = Struct("<iI")


class RecordedPicture(NamedTuple):
    """Moment on the wall clock [ns since 1970], camera, and JPEG."""

    wall_ns: int
    camera: str
    jpeg: bytes


def topic_of(camera: str) -> str:
    return PICTURE_TOPIC + "".join(letter if letter.isalnum() else "_" for letter in camera)


def pack_picture(picture: RecordedPicture) -> bytes:
    """The CDR body of a picture, without the encapsulation header."""
    return pack_cdr(_TIME.pack(*divmod(picture.wall_ns, NS)), picture.camera.encode() + b"\0", picture.jpeg, FORMAT)


def read_picture(message: bytes) -> RecordedPicture:
    """Read a message with its encapsulation header; ValueError if it is none, or not plain CDR."""
    wall_ns, (camera, jpeg) = read_cdr(message, _TIME, 2, "picture")
    return RecordedPicture(wall_ns, camera[:-1].decode(errors="replace"), jpeg)


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
