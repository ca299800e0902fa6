"""The pose of a simulated robot in a small file in shared memory, for who draws its scene.

A pose lies there with its number and a checksum over both, so that a reader knows one that is only partly written or
visible, on any processor.
"""

import os
from mmap import ACCESS_READ, mmap
from pathlib import Path
from struct import Struct
from tempfile import mkstemp
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from weberlink.telemetry.runtime_directory import directory, open_file

MAGIC = b"WEBPOSE\x02"
HEADER = Struct("<8sQ")
"""Magic, and number of values."""
CHECK = Struct("<I")
LARGEST_FILE = 65_536
ATTEMPTS = 5


def path_of(pid: int) -> Path:
    """The file of the daemon with this process id."""
    return directory() / f"weberlink-{pid}.pose"


class PoseWriter:
    """Publishes poses.

    Args:
        path: of the file, which is replaced.
        count: number of values.

    Raises:
        OSError: the file cannot be made.
    """

    def __init__(self, path: Path, count: int) -> None:
        self._body = _body(count)
        size = _size(count)
        fd, draft = mkstemp(prefix=f"{path.name}.", dir=path.parent)
        try:
            os.pwrite(fd, HEADER.pack(MAGIC, count) + bytes(size - HEADER.size), 0)
            self._map = mmap(fd, size)
            Path(draft).replace(path)
        except BaseException:
            Path(draft).unlink(missing_ok=True)
            raise
        finally:
            os.close(fd)
        self._path = path
        self._number = 0

    def write(self, at: float, values: NDArray[np.float64]) -> None:
        """Publish the values at a moment [s] on the monotonic clock."""
        self._number += 1
        body = self._body.pack(self._number, at, *values.tolist())
        self._map[HEADER.size : HEADER.size + len(body) + CHECK.size] = body + CHECK.pack(crc32(body))

    def close(self) -> None:
        """Remove the file."""
        self._map.close()
        self._path.unlink(missing_ok=True)


class PoseReader:
    """Reads the newest pose.

    Raises:
        FileNotFoundError: there is no such file.
        ForeignFileError: it is no file of this user.
        ValueError: it holds no poses.
    """

    def __init__(self, path: Path) -> None:
        fd = open_file(path, LARGEST_FILE)
        try:
            size = os.fstat(fd).st_size
            magic, self.count = HEADER.unpack(os.pread(fd, HEADER.size, 0).ljust(HEADER.size, b"\0"))
            if magic != MAGIC or size != _size(self.count):
                raise ValueError(f"{path}: holds no poses of this release")
            self._body = _body(self.count)
            self._map = mmap(fd, size, access=ACCESS_READ)
        finally:
            os.close(fd)

    def read(self) -> tuple[float, NDArray[np.float64]] | None:
        """The newest pose: its moment on the monotonic clock [s], and its values; None before the first."""
        for _ in range(ATTEMPTS):
            data = self._map[HEADER.size :]
            body = data[: self._body.size]
            number, at, *values = self._body.unpack(body)
            if number and CHECK.unpack_from(data, self._body.size)[0] == crc32(body):
                return at, np.array(values)
        return None

    def close(self) -> None:
        self._map.close()


def _body(count: int) -> Struct:
    """Number, moment, and so many values."""
    return Struct(f"<Qd{count}d")


def _size(count: int) -> int:
    """Of a file with so many values [bytes]."""
    return HEADER.size + 16 + 8 * count + CHECK.size
