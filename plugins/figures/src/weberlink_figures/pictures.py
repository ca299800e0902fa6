"""Pictures of a session for who shows or records them on this host: a local stream socket beside the ring.

The process of a camera driver (`weberlink.config.cameras`) serves it. Who connects gets the newest picture of each
camera, then every new one; who reads too slowly misses some. `at` is on the monotonic clock of this host, as that of
the records is, whichever host took the picture.
"""

from struct import Struct
from typing import Final, NamedTuple

HEAD: Final = Struct("<dHHI")  # moment, and the bytes of name, note and JPEG that follow
LONGEST_TEXT: Final = 500  # of a name or a note [bytes]
LARGEST: Final = 2**21  # of a JPEG [bytes]


class Picture(NamedTuple):
    """A picture, or why there is none."""

    at: float  # when it was taken [s]
    camera: str
    jpeg: bytes  # empty where there is none
    note: str = ""  # why there is none, in one line


def pack(picture: Picture) -> bytes:
    """As on the socket; raises ValueError for what `split` would refuse."""
    texts = [text.encode() for text in (picture.camera, picture.note)]
    if len(picture.jpeg) > LARGEST or max(map(len, texts)) > LONGEST_TEXT:
        raise ValueError(f"a picture of {len(picture.jpeg)} bytes; at most {LARGEST}")
    return HEAD.pack(picture.at, *map(len, texts), len(picture.jpeg)) + b"".join((*texts, picture.jpeg))


def split(data: bytes) -> tuple[list[Picture], bytes]:
    """The whole pictures in what was read from the socket, and the rest; ValueError for what `pack` does not make."""
    pictures, at = [], 0
    while len(data) - at >= HEAD.size:
        when, *lengths = HEAD.unpack_from(data, at)
        if max(lengths[:2]) > LONGEST_TEXT or lengths[2] > LARGEST:
            raise ValueError("no picture")
        begin = at + HEAD.size
        if len(data) < begin + sum(lengths):
            break
        parts = []
        for length in lengths:
            parts.append(data[begin : begin + length])
            begin += length
        camera, note = (part.decode() for part in parts[:2])
        pictures.append(Picture(when, camera, parts[2], note))
        at = begin
    return pictures, data[at:]
