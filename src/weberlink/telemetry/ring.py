"""The ring file and its writer: records in shared memory, published by one counter.

Record number n lies in slot n modulo capacity. The counter of complete records is stored after the record, as one
aligned 8-byte word. A reader copies records and reads the counter again: with c records complete, record c may be being
written, so c - capacity and all older ones may be overwritten.

Not every processor makes stores visible in order (x86-64 does, ARM64 does not): a reader may see the counter before all
of the record. So a slot holds the number of its record, from 1, and a checksum over both (as in
`weberlink.slot`), and what is not whole yet is taken at the next look.
"""

import os
import zlib
from collections.abc import Sequence
from contextlib import suppress
from mmap import MAP_POPULATE, MAP_SHARED, mmap
from pathlib import Path
from struct import Struct
from tempfile import mkstemp
from time import monotonic, time
from types import TracebackType
from typing import NamedTuple, Self

from weberlink.child_process import process_columns
from weberlink.compiled import mypyc_attr
from weberlink.telemetry.record import ALL, FIELDS, Layout, layout
from weberlink.telemetry.runtime_directory import directory, open_file

MAGIC = b"WEBRING\x00"
VERSION = 4
# Changes with every change of the table, so that a reader of another release refuses the file.
SCHEMA = zlib.crc32(repr([(field.name, field.kind, field.axes) for field in FIELDS]).encode())

HEADER = Struct("<8sIIIIQQddd32sBB")
COUNTER_AT = 128
CLOSED_AT = 136
RECORDS_AT = 192
CHECK = Struct("<I")
NUMBER_BYTES = 8
SIDE_BYTES = 32
LARGEST_FILE = 128 * 2**20  # of a ring that is made or opened [bytes]; ten seconds at 10 kHz take 62 MB


def body_of(records: Layout) -> Struct:
    """Number and record of a slot."""
    return Struct(f"<Q{records.format}")


def slot_bytes(records: Layout = ALL) -> int:
    """Number, record and checksum, filled up so that every value is aligned."""
    return (body_of(records).size + CHECK.size + 7) // 8 * 8


class Header(NamedTuple):
    """Header of a ring file; `side` is UTF-8 filled up with zero bytes, `axes` and `streams` those of the records.

    Fields up to `pid_started` keep their place in later versions, so that a stale file of any release can be replaced.
    """

    magic: bytes
    version: int
    schema: int
    record_size: int
    pid: int
    pid_started: int
    capacity: int
    rate_hz: float
    started_wall_s: float
    started_monotonic_s: float
    side: bytes
    axes: int
    streams: int


class RingFormatError(ValueError):
    """The file is not a telemetry ring that this release can read."""


@mypyc_attr(native_class=False)
class RingInUseError(FileExistsError):
    """The file belongs to a writer that is alive."""


def default_path(name: str) -> Path:
    """The path of a ring: in the runtime directory of this user, which is created if there is none. Raises ValueError
    if the name would lead to another directory or is empty, RuntimeDirectoryError if no directory can be made."""
    if not name or "/" in name or "\x00" in name:
        raise ValueError(f"name must be a file name without a slash, got {name!r}")
    return directory() / f"weberlink-{name}.ring"


def read_header(path: Path, fd: int) -> Header:
    """The checked header of an open file; raises RingFormatError if it is no ring, or one of another release, or it is
    shorter than it says.
    """
    header = _parse_header(path, fd)
    if header.version != VERSION:
        raise RingFormatError(f"{path}: layout version {header.version}, this program reads version {VERSION}")
    known = header.schema == SCHEMA and 1 <= header.axes <= ALL.axes and 1 <= header.streams <= ALL.streams
    if not known or header.record_size != body_of(layout(header.axes, header.streams)).size - NUMBER_BYTES:
        raise RingFormatError(f"{path}: its records have other fields than those of this program; use the same release")
    size, expected = (
        os.fstat(fd).st_size,
        RECORDS_AT + header.capacity * slot_bytes(layout(header.axes, header.streams)),
    )
    if header.capacity < 2 or size < expected:
        raise RingFormatError(f"{path}: {size} bytes are too few for {header.capacity} records ({expected} bytes)")
    return header


def _parse_header(path: Path, fd: int) -> Header:
    data = os.pread(fd, RECORDS_AT, 0)
    if len(data) < RECORDS_AT or not data.startswith(MAGIC):
        raise RingFormatError(f"{path}: not a telemetry ring")
    return Header(*HEADER.unpack_from(data))


def is_alive(header: Header) -> bool:
    """Whether the process that wrote this header still runs; a reused process id does not count."""
    return process_started(header.pid) == header.pid_started


def process_started(pid: int) -> int | None:
    """When a process started, in clock ticks since boot; None if it does not run, or is a zombie."""
    columns = process_columns(pid)
    return None if columns is None or columns[0] in ("Z", "X") else int(columns[19])


class RingWriter:
    """Publishes records in a ring file; for one thread.

    The file is made with all of its memory, in place of one that a dead writer left.

    Args:
        path: as of `default_path`.
        side: name of who writes, up to 32 bytes.
        rate_hz: records per second that are intended [Hz].
        capacity: slots; a reader can lag behind by one record less.

    Raises:
        ValueError: an argument is out of range.
        RingInUseError: a living process writes this file.
        RingFormatError: the path holds something else, which is left alone.
        ForeignFileError: the path holds what is no file, or belongs to another user; it is left alone.
        OSError: there is no room for the file.
    """

    __slots__ = ("_body", "_count", "_counter", "_end", "_map", "_slot", "_slot_bytes", "path")

    def __init__(self, path: str | Path, *, side: str, rate_hz: float, capacity: int, records: Layout = ALL) -> None:
        self.path, name = Path(path), side.encode()
        if not 0 < len(name) <= SIDE_BYTES:
            raise ValueError(f"side must be 1 to {SIDE_BYTES} bytes, got {side!r}")
        if not rate_hz > 0.0:
            raise ValueError(f"rate_hz must be positive, got {rate_hz}")
        self._body, self._slot_bytes = body_of(records), slot_bytes(records)
        most = (LARGEST_FILE - RECORDS_AT) // self._slot_bytes
        if not 2 <= capacity <= most:
            raise ValueError(f"capacity must be 2 to {most} records, got {capacity}")
        _refuse_to_replace(self.path)
        pid = os.getpid()
        known, began = (MAGIC, VERSION, SCHEMA, self._body.size - NUMBER_BYTES), (time(), monotonic())
        started, shape = process_started(pid) or 0, (records.axes, records.streams)
        header = Header(*known, pid, started, capacity, rate_hz, *began, name, *shape)
        self._slot, self._count = RECORDS_AT, 0
        self._end = RECORDS_AT + capacity * self._slot_bytes
        self._map = _place(self.path, header, self._end)
        # A native 64-bit item is stored as one word; packing with an explicit byte order would store eight bytes.
        self._counter = memoryview(self._map)[COUNTER_AT : COUNTER_AT + 8].cast("Q")

    def write(self, record: Sequence[float]) -> None:
        """Publish the values of one record; never blocks and does not depend on readers. Raises struct.error or
        OverflowError if a value does not fit its type; nothing is published.
        """
        slot, count = self._slot, self._count + 1
        body: bytes = self._body.pack(count, *record)
        self._map[slot : slot + len(body) + 4] = body + CHECK.pack(zlib.crc32(body))
        self._count = count
        self._counter[0] = count
        following = slot + self._slot_bytes
        self._slot = following if following < self._end else RECORDS_AT

    def close(self, *, unlink: bool = True) -> None:
        """Mark the end, release the memory and remove the file; readers keep their mapping. May be repeated."""
        if self._map.closed:
            return
        self._map[CLOSED_AT] = 1
        self._counter.release()
        self._map.close()
        if unlink:
            with suppress(FileNotFoundError):
                self.path.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def _refuse_to_replace(path: Path) -> None:
    """Raise unless the path is free or holds the ring, of whatever release, of a dead or finished writer."""
    try:
        fd = open_file(path, LARGEST_FILE)
    except FileNotFoundError:
        return
    try:
        header = _parse_header(path, fd)
        closed = os.pread(fd, 1, CLOSED_AT) != b"\x00"
    finally:
        os.close(fd)
    if not closed and is_alive(header):
        raise RingInUseError(f"{path}: process {header.pid} is writing it")


def _place(path: Path, header: Header, size: int) -> mmap:
    """Map a new file, private to this user, that appears under its path only when it is complete."""
    fd, draft = mkstemp(prefix=f"{path.name}.", dir=path.parent)
    try:
        # Allocated now: missing memory at a later store would kill the process in the middle of a tick.
        os.posix_fallocate(fd, 0, size)
        mapping = mmap(fd, size, flags=MAP_SHARED | MAP_POPULATE)
        mapping[: HEADER.size] = HEADER.pack(*header)
        Path(draft).replace(path)
    except BaseException:
        Path(draft).unlink()
        raise
    finally:
        os.close(fd)
    return mapping
