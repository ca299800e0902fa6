"""The pose of a simulated robot in a small file in shared memory, for who draws its scene: a `weberlink.slot`."""

import os
from mmap import ACCESS_READ, mmap
from pathlib import Path
from struct import Struct
from tempfile import mkstemp

import numpy as np
from numpy.typing import NDArray

from weberlink.slot import Slot, size_of
from weberlink.telemetry.runtime_directory import directory, open_file

MAGIC = b"WEBPOSE\x02"
HEADER = Struct("<8sQ")  # magic, and number of values
LARGEST_FILE = 65_536
ATTEMPTS = 5


def path_of(pid: int) -> Path:
    """The file of the daemon with this process id."""
    return directory() / f"weberlink-{pid}.pose"


class PoseWriter:
    """Publishes poses of so many values in a file, which is replaced; OSError if it cannot be made."""

    def __init__(self, path: Path, count: int) -> None:
        values = _values(count)
        fd, draft = mkstemp(prefix=f"{path.name}.", dir=path.parent)
        try:
            os.pwrite(fd, HEADER.pack(MAGIC, count) + bytes(size_of(values)), 0)
            self._map = mmap(fd, HEADER.size + size_of(values))
            Path(draft).replace(path)
        except BaseException:
            Path(draft).unlink(missing_ok=True)
            raise
        finally:
            os.close(fd)
        self._path, self._slot = path, Slot(self._map, HEADER.size, values)

    def write(self, at: float, values: NDArray[np.float64]) -> None:
        """Publish the values at a moment [s] on the monotonic clock."""
        self._slot.write(at, *values.tolist())

    def close(self) -> None:
        """Remove the file."""
        self._map.close()
        self._path.unlink(missing_ok=True)


class PoseReader:
    """Reads the newest pose; FileNotFoundError without the file, ForeignFileError if it is no file of this user,
    ValueError if it holds no poses.
    """

    def __init__(self, path: Path) -> None:
        fd = open_file(path, LARGEST_FILE)
        try:
            size = os.fstat(fd).st_size
            magic, self.count = HEADER.unpack(os.pread(fd, HEADER.size, 0).ljust(HEADER.size, b"\0"))
            if magic != MAGIC or size != HEADER.size + 20 + 8 * self.count:
                raise ValueError(f"{path}: holds no poses of this release")
            self._map = mmap(fd, size, access=ACCESS_READ)
        finally:
            os.close(fd)
        self._slot = Slot(self._map, HEADER.size, _values(self.count))

    def read(self) -> tuple[float, NDArray[np.float64]] | None:
        """A pose that was not read before: its moment on the monotonic clock [s], and its values; None without one."""
        for _ in range(ATTEMPTS):
            if (newest := self._slot.newest()) is not None:
                at, *values = newest
                return at, np.array(values)
        return None

    def close(self) -> None:
        self._map.close()


def _values(count: int) -> Struct:
    """Moment, and so many values."""
    return Struct(f"<d{count}d")
