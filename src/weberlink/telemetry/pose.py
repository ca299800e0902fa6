"""The pose of a simulated robot in a small file in shared memory, for who draws its scene.

The writer makes the sequence number odd, writes the values, and makes it even again; a reader takes the values if it
found the same even number before and after.
"""

import os
from contextlib import suppress
from mmap import ACCESS_READ, mmap
from pathlib import Path
from struct import Struct
from tempfile import mkstemp

import numpy as np
from numpy.typing import NDArray

from weberlink.telemetry.runtime_directory import directory, open_file

MAGIC = b"WEBPOSE\x01"
HEADER = Struct("<8sQ")
"""Magic, and number of values."""
SEQUENCE_AT = 16
TIME_AT = 24
VALUES_AT = 32
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
        size = VALUES_AT + 8 * count
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
        self._sequence = memoryview(self._map)[SEQUENCE_AT : SEQUENCE_AT + 8].cast("Q")
        self._values: NDArray[np.float64] = np.frombuffer(self._map, np.float64, offset=TIME_AT)
        self._count = 0

    def write(self, at: float, values: NDArray[np.float64]) -> None:
        """Publish the values at a moment [s] on the monotonic clock."""
        self._count += 2
        self._sequence[0] = self._count - 1
        self._values[0] = at
        self._values[1:] = values
        self._sequence[0] = self._count

    def close(self) -> None:
        """Remove the file."""
        self._sequence.release()
        del self._values
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
            if magic != MAGIC or size != VALUES_AT + 8 * self.count:
                raise ValueError(f"{path}: holds no poses of this release")
            self._map = mmap(fd, size, access=ACCESS_READ)
        finally:
            os.close(fd)
        self._sequence = memoryview(self._map)[SEQUENCE_AT : SEQUENCE_AT + 8].cast("Q")

    def read(self) -> tuple[float, NDArray[np.float64]] | None:
        """The newest pose: its moment on the monotonic clock [s], and its values; None before the first."""
        for _ in range(ATTEMPTS):
            before = self._sequence[0]
            values = np.frombuffer(self._map[TIME_AT:], np.float64)
            if before and before % 2 == 0 and self._sequence[0] == before:
                return float(values[0]), values[1:]
        return None

    def close(self) -> None:
        with suppress(BufferError):
            self._sequence.release()
            self._map.close()
