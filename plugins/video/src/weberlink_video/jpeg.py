"""What must be known of a JPEG that is not decoded: its size, and where it ends (ITU-T T.81, annex B)."""

from typing import Final

from weberlink_figures.pictures import LARGEST

MOST_PIXELS: Final = 4096
"""Of width and height: a larger picture of a few bytes would fill the memory of who decodes it."""
_BEGIN, _END = b"\xff\xd8", b"\xff\xd9"
_SCAN: Final = 0xDA
_FRAMES: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # markers of a segment that tells the size


def read_head(data: bytes) -> tuple[int, int, int] | None:
    """Width and height [pixels] of a JPEG, and where its first scan begins; None while its head is not complete. Raises
    ValueError if it is none, or too large.
    """
    if data[:2] != _BEGIN[: len(data)]:
        raise ValueError("not a JPEG picture")
    at, size = 2, None
    while len(data) >= at + 4:
        kind, length = data[at + 1], int.from_bytes(data[at + 2 : at + 4], "big")
        if data[at] != 0xFF or length < 2:
            raise ValueError("a damaged JPEG picture")
        if kind in _FRAMES and len(data) >= at + 9:
            size = int.from_bytes(data[at + 7 : at + 9], "big"), int.from_bytes(data[at + 5 : at + 7], "big")
            if min(size) == 0 or max(size) > MOST_PIXELS:
                raise ValueError(f"a picture of {size[0]} x {size[1]} pixels; at most {MOST_PIXELS} on a side")
        if kind == _SCAN:
            if size is None:
                raise ValueError("a JPEG picture without a size")
            return *size, at
        at += 2 + length
    if at > LARGEST:
        raise ValueError(f"the head of a picture is longer than {LARGEST} bytes")
    return None


def check(data: bytes) -> tuple[int, int]:
    """Width and height of a whole JPEG; ValueError if it is none, or too large to show."""
    if len(data) > LARGEST:
        raise ValueError(f"a picture of {len(data)} bytes; at most {LARGEST}")
    head = read_head(data)
    if head is None or _END not in data[head[2] :]:
        raise ValueError("a JPEG picture that is cut short")
    return head[:2]


class Splitter:
    """Cuts a stream of JPEG pictures, such as the MJPG of a camera, into pictures."""

    def __init__(self) -> None:
        self._data = b""

    def add(self, data: bytes) -> list[bytes]:
        """The whole pictures so far; ValueError for what is none, after which the stream has no use."""
        self._data += data
        pictures = []
        while self._data and (head := read_head(self._data)) is not None:
            end = self._data.find(_END, head[2])  # within a scan, 0xFF is followed by 0 or by a restart marker
            if end < 0:
                break
            pictures.append(self._data[: end + 2])
            self._data = self._data[end + 2 :]
        if len(self._data) > LARGEST:
            raise ValueError(f"a picture of more than {LARGEST} bytes")
        return pictures
