"""Reads a ring: every complete record since the last read, as a numpy array, without disturbing the writer."""

import os
from mmap import ACCESS_READ, mmap
from pathlib import Path
from struct import Struct
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from weberlink.telemetry.record import ALL, DESCRIPTION, layout
from weberlink.telemetry.ring import (
    CHECK,
    CLOSED_AT,
    COUNTER_AT,
    LARGEST_FILE,
    RECORDS_AT,
    body_of,
    is_alive,
    read_header,
    slot_bytes,
)
from weberlink.telemetry.runtime_directory import open_file

Records = NDArray[Any]  # structured array of telemetry records
DTYPE = np.dtype(DESCRIPTION)
_NUMBER = Struct("<Q").unpack_from


class RingReader:
    """Follows one ring file from the oldest record it still holds; outlives the writer.

    Args:
        path: of the file. A writer that starts again makes a new file: open a new reader when `alive` turns false.

    Attributes:
        side, pid, rate_hz, capacity: of the writer.
        started_wall_s: when it began, on the wall clock [s since 1970].
        started_monotonic_s: the same moment on the clock of the records [s].
        overrun: records that were overwritten before they could be read.

    Raises:
        FileNotFoundError: there is no such file.
        ForeignFileError: it is no regular file of this user or of root, or it is too large.
        RingFormatError: it is not a ring that this release can read.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        fd = open_file(self.path, LARGEST_FILE)
        try:
            self._header = header = read_header(self.path, fd)
            self._layout = layout(header.axes, header.streams)
            self._body_bytes, self._slot_bytes = body_of(self._layout).size, slot_bytes(self._layout)
            self._map = mmap(fd, RECORDS_AT + header.capacity * self._slot_bytes, access=ACCESS_READ)
        finally:
            os.close(fd)
        self.side = header.side.rstrip(b"\x00").decode(errors="replace")
        self.pid, self.rate_hz, self.capacity = header.pid, header.rate_hz, header.capacity
        self.started_wall_s, self.started_monotonic_s = header.started_wall_s, header.started_monotonic_s
        formats = ["<u8", np.dtype(self._layout.description)]
        slot = {"names": ["number", "record"], "formats": formats, "offsets": [0, 8], "itemsize": self._slot_bytes}
        self._slot: np.dtype[np.void] = np.dtype(slot)  # type: ignore[call-overload]
        whole = memoryview(self._map)
        self._counter = whole[COUNTER_AT : COUNTER_AT + 8].cast("Q")
        self._data = whole[RECORDS_AT:]
        whole.release()
        self._next = self._oldest(self._counter[0])
        self.overrun = 0

    @property
    def written(self) -> int:
        """Records published so far."""
        return self._counter[0]

    @property
    def passed(self) -> int:
        """Records before the one that `read` gives next: read, overwritten, or older than what it began with."""
        return self._next

    @property
    def alive(self) -> bool:
        """Whether more can come: the writer has not closed the ring and its process runs. Costs a file of /proc."""
        return self._map[CLOSED_AT] == 0 and is_alive(self._header)

    @property
    def ended_in_order(self) -> bool:
        """Whether the writer has closed the ring; one that was killed has not."""
        return self._map[CLOSED_AT] != 0

    def read(self) -> NDArray[np.void]:
        """All complete records since the last call, oldest first, as an array of `DTYPE` of its own.

        Axes and fields that the session does not have are 0.

        Records that the writer has overwritten before they could be copied whole are left out and counted in `overrun`.
        A record that is published and not whole yet is left for the next call, and so are those after it.
        """
        end = self._counter[0]
        first = max(self._next, self._oldest(end))
        start, size = first % self.capacity, self._slot_bytes
        until_end = min(end - first, self.capacity - start)
        copied = bytearray(self._data[start * size : (start + until_end) * size])
        copied += self._data[: (end - first - until_end) * size]
        intact = min(max(first, self._oldest(self._counter[0])), end)
        end = self._whole(copied, first, intact, end)
        self.overrun += intact - self._next
        self._next = end
        records: NDArray[np.void] = np.frombuffer(copied, self._slot)["record"][intact - first : end - first]
        if self._layout is ALL:
            return records.copy()
        filled = np.zeros(len(records), DTYPE)
        for field in self._layout.fields:
            own = records[field.name]
            (filled[field.name][:, : own.shape[1]] if own.ndim > 1 else filled[field.name])[:] = own
        return filled

    def close(self) -> None:
        """Release the mapping; arrays that were read stay valid. May be repeated."""
        self._counter.release()
        self._data.release()
        self._map.close()

    def _oldest(self, complete: int) -> int:
        """The oldest record that the writer cannot be touching when so many are complete."""
        return max(0, complete - self.capacity + 1)

    def _whole(self, slots: bytearray, first: int, intact: int, end: int) -> int:
        """The first record from `intact` to `end` that is not whole, or `end`; `first` is that of the first slot."""
        view, size = memoryview(slots), self._body_bytes
        for record in range(intact, end):
            slot = view[(record - first) * self._slot_bytes :]
            if (record + 1, crc32(slot[:size])) != (_NUMBER(slot)[0], CHECK.unpack_from(slot, size)[0]):
                return record
        return end
