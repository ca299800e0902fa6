"""An MCAP file that grows by whole chunks, and how MCAP frames messages.

The writer of the mcap library keeps unwritten data and cannot go on after a failed write: here a failed append cuts the
file back to what it was. A chunk of messages of one size is one array, without a Python step for each message.
"""

import os
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from math import isfinite
from pathlib import Path
from struct import Struct, pack
from typing import Self

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from weberlink_figures.message import ENCAPSULATION, MESSAGE_ENCODING, SCHEMA_ENCODING, Origin, Rows

MAGIC = b"\x89MCAP0\r\n"  # begins a file and ends a complete one
FRAME = Struct("<BQ")
MESSAGE = Struct("<HIQQ")  # what a message begins with: channel, sequence, log time, publish time [ns]
HEAD = FRAME.size + MESSAGE.size + len(ENCAPSULATION)
QOS = {"offered_qos_profiles": ""}  # players of ROS 2 ask for this key; without a profile they use their default
_NUMBERS = ("rate_hz", "wall_s", "monotonic_s")


def metadata_of(origin: Origin) -> dict[str, str]:
    """What the channel of a side says of its origin."""
    return {"side": origin.side} | {name: repr(float(getattr(origin, name))) for name in _NUMBERS} | QOS


def origin_in(side: str, metadata: Mapping[str, str]) -> Origin:
    """The origin that a channel tells; raises ValueError if a number is missing or none."""
    numbers = {}
    for name in _NUMBERS:
        try:
            numbers[name] = float(metadata[name])
        except (KeyError, ValueError):
            numbers[name] = float("nan")
        if not isfinite(numbers[name]):
            raise ValueError(f"its channel says {name} = {metadata.get(name)!r}, expected a number")
    return Origin(side, **numbers)


@lru_cache(64)
def rows_of(body: int) -> np.dtype[np.void]:
    """The frame of a message whose record has `body` bytes, the record itself as raw bytes."""
    kinds = {"opcode": "u1", "length": "<u8", "channel": "<u2", "sequence": "<u4", "log_time": "<u8"}
    kinds |= {"publish_time": "<u8", "encapsulation": f"V{len(ENCAPSULATION)}", "body": f"V{body}"}
    return np.dtype([*kinds.items()])


def framed(channel: int, first: int, times_ns: NDArray[np.uint64] | int, bodies: Rows) -> Rows:
    """Records as the messages of a channel, `first` the sequence number of the first."""
    layout = rows_of(bodies.dtype.itemsize)
    rows = np.empty(len(bodies), layout)
    rows["opcode"], rows["length"] = Opcode.MESSAGE, layout.itemsize - FRAME.size
    rows["channel"], rows["sequence"] = channel, np.arange(first, first + len(bodies)) % 2**32
    rows["log_time"] = rows["publish_time"] = times_ns
    rows["encapsulation"] = np.void(ENCAPSULATION)
    rows["body"] = np.ascontiguousarray(bodies).view(layout["body"])
    return rows


def frames(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of each frame that is whole; what is left at the end is dropped."""
    at, size = 0, len(data)
    while at + FRAME.size <= size:
        opcode, length = FRAME.unpack_from(data, at)
        at += FRAME.size
        if length > size - at:
            return
        yield opcode, data[at : at + length]
        at += length


def uniform(data: bytes) -> Rows | None:
    """All of a chunk as rows, if it holds nothing but messages of one size; else None."""
    if len(data) < HEAD:
        return None
    opcode, length = FRAME.unpack_from(data)
    size = FRAME.size + length
    if opcode != Opcode.MESSAGE or size <= HEAD or len(data) % size:
        return None
    # One row after the other is where the first says, so that this holds of all or of none.
    rows: Rows = np.frombuffer(data, rows_of(size - HEAD))
    return rows if (rows["opcode"] == Opcode.MESSAGE).all() and (rows["length"] == length).all() else None


PROFILE, LIBRARY = "ros2", "weberlink"
FACTS, END = "weberlink", "end"  # names of the records of metadata at the start and at the end of a recording
JOURNAL = "journal"  # in that at the end, the hash of the last line of the journal


class McapFile:
    """One new file, made by `create`. Every method that appends raises OSError with the file as it was before."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._crc = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._compress = zstandard.ZstdCompressor().compress
        self.size = 0  # of what is in the file [bytes]
        self.messages: Counter[int] = Counter()  # by channel

    @classmethod
    def create(cls, path: Path, first: Metadata) -> Self:
        """Begin a file; OSError if it is there, or cannot be made, and then it is not there."""
        file = cls(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666))
        try:
            file._append(MAGIC + _bytes(Header(PROFILE, LIBRARY)))
            file.add_metadata(first)
        except BaseException:
            file.close()
            path.unlink()
            raise
        return file

    def add_metadata(self, metadata: Metadata) -> None:
        data = _bytes(metadata)
        self._append(data)
        self._metadata.append(MetadataIndex(self.size - len(data), len(data), metadata.name))

    def add_schema(self, name: str, text: str) -> int:
        schema = Schema(id=len(self._schemas) + 1, data=text.encode(), encoding=SCHEMA_ENCODING, name=name)
        self._append(_bytes(schema))
        self._schemas.append(schema)
        return schema.id

    def add_channel(self, topic: str, schema: int, metadata: Mapping[str, str]) -> int:
        number = len(self._channels) + 1
        channel = Channel(
            id=number, topic=topic, message_encoding=MESSAGE_ENCODING, metadata=dict(metadata), schema_id=schema
        )
        self._append(_bytes(channel))
        self._channels.append(channel)
        return channel.id

    def add_chunk(self, rows: Rows, *, is_packed: bool = False) -> None:
        """Append framed messages, at least one; `is_packed` for those that a compression would not make smaller."""
        data = rows.tobytes()
        compression, packed = ("", data) if is_packed else ("zstd", self._compress(data))
        begin, end = int(rows["log_time"].min()), int(rows["log_time"].max())
        builder = RecordBuilder()
        Chunk(compression, packed, end, begin, zlib.crc32(data), len(data)).write(builder)
        length = builder.count
        places, counts = {}, {}
        for index in _message_indexes(rows):
            places[index.channel_id] = self.size + builder.count
            counts[index.channel_id] = len(index.records)
            index.write(builder)
        entry = ChunkIndex(
            message_start_time=begin,
            message_end_time=end,
            chunk_start_offset=self.size,
            chunk_length=length,
            message_index_offsets=places,
            message_index_length=builder.count - length,
            compression=compression,
            compressed_size=len(packed),
            uncompressed_size=len(data),
        )
        self._append(_content(builder))
        self._chunks.append(entry)
        self.messages.update(counts)

    def finish(self, last: Metadata, *, indexed: bool = True) -> None:
        """Append the end of the file: a record of metadata and, if there is room for one, the index."""
        builder = RecordBuilder()
        last.write(builder)
        metadata = MetadataIndex(self.size, builder.count, last.name)
        body = _content(builder)
        body += _bytes(DataEnd(zlib.crc32(body, self._crc)))
        summary = self._summary(self.size + len(body), metadata) if indexed else _bytes(Footer(0, 0, 0))
        self._append(body + summary + MAGIC)

    def sync(self) -> None:
        os.fsync(self._fd)

    def close(self) -> None:
        """May be repeated, and before the file is finished."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def _append(self, data: bytes) -> None:
        view, at = memoryview(data), self.size
        try:
            while view:  # a disk that gets full takes a part first
                taken = os.pwrite(self._fd, view, at)
                view, at = view[taken:], at + taken
        except BaseException:
            with suppress(OSError):
                os.ftruncate(self._fd, self.size)
            raise
        self.size = at
        self._crc = zlib.crc32(data, self._crc)

    def _summary(self, start: int, last: MetadataIndex) -> bytes:
        """All that allows a reader to seek, and the footer that points to it."""
        builder = RecordBuilder()
        offsets = []
        groups: list[tuple[Opcode, Iterable[McapRecord]]] = [
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.METADATA_INDEX, [*self._metadata, last]),
        ]
        for opcode, records in groups:
            begin = builder.count
            for record in records:
                record.write(builder)
            if builder.count > begin:
                offsets.append(SummaryOffset(opcode, start + begin, builder.count - begin))
        at = start + builder.count
        for offset in offsets:
            offset.write(builder)
        summary = _content(builder)
        # The checksum covers the footer up to itself.
        crc = zlib.crc32(pack("<BQQQ", Opcode.FOOTER, 20, start, at), zlib.crc32(summary))
        return summary + _bytes(Footer(start, at, crc))

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self.messages),
            chunk_count=len(self._chunks),
            message_count=self.messages.total(),
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            metadata_count=len(self._metadata) + 1,
            schema_count=len(self._schemas),
        )


def _bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return _content(builder)


def _content(builder: RecordBuilder) -> bytes:
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def _message_indexes(rows: Rows) -> list[MessageIndex]:
    """Where in the chunk the messages of each channel are, and when."""
    offsets = np.arange(len(rows)) * rows.dtype.itemsize
    found = []
    for channel in np.unique(rows["channel"]).tolist():
        of_channel = rows["channel"] == channel
        entries = zip(rows["log_time"][of_channel].tolist(), offsets[of_channel].tolist(), strict=True)
        found.append(MessageIndex(channel, list(entries)))
    return found
