"""Reads a recording: all that is intact in it, of whatever release and however it ended."""

import os
import struct
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BufferedReader, BytesIO
from pathlib import Path
from struct import pack
from typing import Any, TypeVar

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata, Schema

from weberlink.telemetry.record import AXES, MOST_AXES
from weberlink.telemetry.recorders import COMPLETE
from weberlink.text import one_line
from weberlink_figures.chain import Verified, verify
from weberlink_figures.message import (
    CODES,
    ENCAPSULATION,
    MESSAGE_ENCODING,
    SCHEMA_ENCODING,
    SIDES,
    TOPICS,
    Origin,
    Rows,
    aligned,
    fields_in,
)
from weberlink_recording.configuration import joints_of
from weberlink_recording.container import (
    END,
    FACTS,
    FRAME,
    HEAD,
    JOURNAL,
    MAGIC,
    MESSAGE,
    frames,
    origin_in,
    rows_of,
    uniform,
)
from weberlink_recording.former import of_this_release
from weberlink_recording.marks import JOURNAL_TOPIC, MARK_SCHEMA, MARK_TOPIC, Mark, read_mark, shortened
from weberlink_recording.pictures import PICTURE_SCHEMA, PICTURE_TOPIC, RecordedPicture, read_picture

Parsed = TypeVar("Parsed")

_LAYOUTS: dict[str, tuple[str, int]] = {
    **{"float64": ("<f8", 1), "float32": ("<f4", 1), "uint64": ("<u8", 1), "uint8": ("u1", 1)},
    **dict.fromkeys(("geometry_msgs/Vector3", "geometry_msgs/msg/Vector3"), ("<f8", len(AXES))),
    **{f"{kind}[{axes}]": (CODES[kind], axes) for kind in ("float32", "float64") for axes in (len(AXES), MOST_AXES)},
}


def dtype_of(schema_text: str) -> np.dtype[np.void]:
    """The layout of the body of a message of numbers and vectors, each value on its own boundary as CDR has it; raises
    ValueError if the definition has a field of another type, one name twice, or none at all.
    """
    columns: dict[str, tuple[str, tuple[str, tuple[int, ...]], int]] = {}
    for kind, name in fields_in(schema_text):
        if kind not in _LAYOUTS:
            raise ValueError(f"field {name} is of type {kind}, expected one of {', '.join(_LAYOUTS)}")
        if name in columns:
            raise ValueError(f"field {name} is defined twice")
        code, axes = _LAYOUTS[kind]
        columns[name] = name, (code, () if axes == 1 else (axes,)), np.dtype(code).itemsize
    if not columns:
        raise ValueError("no field is defined")
    return aligned(tuple(columns.values()))


COMPRESSIONS = ("", "lz4", "zstd")
UNPACKED_LEAST, UNPACKED_FACTOR = 1 << 26, 32
"""A file may unpack to so many bytes, and so many times its size; sessions that stand still unpack to 20 times it."""
FRAME_COST = 512  # what each message that Python handles alone counts of that: it takes the time of so many bytes
MOST_CHANNELS = 16  # of sides and marks; a file of two hosts has three
NEEDED = {"at": np.dtype("<f8"), "tick": np.dtype("<u8")}  # without these a record cannot be placed


class DamagedError(ValueError):
    """A frame is not what it was when it was written."""


class ForeignError(ValueError):
    """The file is in order, and no recording that can be read."""


_DAMAGE = (McapError, ValueError, EOFError, struct.error, RuntimeError, MemoryError, OverflowError, zstandard.ZstdError)
"""What the library and the decompressors raise over bytes that have changed."""


class Content:
    """Takes frames in the order of the file.

    Raises DamagedError for a frame that cannot be read, of which nothing was taken, and ForeignError for one that is
    not of a recording.

    Args:
        size: of the file [bytes], which bounds what it may unpack to.
        with_pictures: whether to take pictures too, which may fill the memory.
    """

    def __init__(self, size: int, *, with_pictures: bool = False) -> None:
        self._with_pictures = with_pictures
        self.pictures: list[RecordedPicture] = []
        self._left = UNPACKED_LEAST + UNPACKED_FACTOR * size
        self.metadata: dict[str, dict[str, str]] = {}
        self.origins: dict[str, Origin] = {}
        self.marks: list[Mark] = []
        self.journal: list[bytes] = []
        self.foreign: dict[str, None] = {}  # topics that are none of a recording, with the name of their schema
        self._schemas: dict[int, Schema] = {}
        self._sides: dict[int, tuple[str, np.dtype[np.void]]] = {}
        self._layouts: dict[str, np.dtype[np.void]] = {}
        self._logs: dict[int, str] = {}  # topics of marks, journal and pictures, by channel
        self._parts: dict[str, list[Rows]] = defaultdict(list)

    def take(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.CHUNK:
            self._take_chunk(body)
        elif opcode == Opcode.MESSAGE:
            self._take_messages([body])
        elif opcode == Opcode.METADATA:
            metadata: Metadata = _parsed(Metadata.read, body)
            self.metadata[metadata.name] = metadata.metadata
        else:
            self._take_definition(opcode, body)

    def take_cut(self, opcode: int, body: bytes) -> None:
        """What is left of the last frame: of a chunk that is not compressed, the messages that are whole."""
        if opcode != Opcode.CHUNK:
            return
        with suppress(DamagedError):
            chunk: Chunk = _parsed(Chunk.read, body)
            if not chunk.compression:
                self._take_frames(chunk.data)

    def records(self, side: str) -> Rows:
        """All records of a side in order of their ticks; may be asked for once."""
        parts = self._parts.pop(side, [])
        records = np.concatenate(parts) if parts else np.empty(0, self._layouts[side])
        ticks = records["tick"]
        return records if (ticks[1:] >= ticks[:-1]).all() else records[np.argsort(ticks, kind="stable")]

    def _spend(self, size: int) -> None:
        self._left -= size
        if self._left < 0:
            raise DamagedError("it unpacks to more than a recording of its size holds")

    def _take_chunk(self, body: bytes) -> None:
        chunk: Chunk = _parsed(Chunk.read, body)
        if chunk.compression not in COMPRESSIONS:
            raise ForeignError(f"is compressed by {chunk.compression!r}, expected lz4, zstd or nothing")
        self._spend(chunk.uncompressed_size)
        with _damaged("a chunk that does not unpack"):
            data = _unpacked(chunk)
        rows = uniform(data)
        if rows is None:
            self._take_frames(data)
        else:
            self._take_rows(rows)

    def _take_frames(self, data: bytes) -> None:
        messages = []
        for opcode, body in frames(data):
            self._spend(FRAME_COST)
            if opcode == Opcode.MESSAGE:
                messages.append(body)
            else:
                self._take_definition(opcode, body)
        self._take_messages(messages)

    def _take_definition(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema: Schema = _parsed(Schema.read, body)
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            self._take_channel(_parsed(Channel.read, body))

    def _take_channel(self, channel: Channel) -> None:
        if channel.id in self._sides:
            return  # repeated, as each chunk and the index may
        if len(self._sides) + len(self._logs) >= MOST_CHANNELS:
            raise ForeignError(f"has more than {MOST_CHANNELS} channels of a session")
        schema = self._schemas.get(channel.schema_id)
        name = "no schema" if schema is None else schema.name
        side = SIDES.get(channel.topic)
        if channel.topic in (MARK_TOPIC, JOURNAL_TOPIC) and name == MARK_SCHEMA:
            self._logs[channel.id] = channel.topic
        elif channel.topic.startswith(PICTURE_TOPIC) and name == PICTURE_SCHEMA:
            self._logs[channel.id] = PICTURE_TOPIC
        elif side is None:
            self.foreign.setdefault(f"{channel.topic} ({name})")
        else:
            try:
                layout = _layout(channel, schema)
                self.origins.setdefault(side, origin_in(side, channel.metadata))
            except ValueError as error:
                raise ForeignError(f"{channel.topic}: {error}") from None
            if self._layouts.setdefault(side, layout) != layout:
                raise ForeignError(f"{channel.topic}: is there twice, with different fields")
            self._sides[channel.id] = (side, layout)

    def _take_messages(self, messages: list[bytes]) -> None:
        """Messages of any channels and sizes."""
        of_side: dict[int, list[bytes]] = defaultdict(list)
        for message in messages:
            if len(message) < MESSAGE.size:
                raise DamagedError(f"a message of {len(message)} bytes")
            channel = MESSAGE.unpack_from(message)[0]
            if channel in self._sides:
                of_side[channel].append(message)
            elif channel in self._logs:
                self._take_log(channel, message)
        for channel, own in of_side.items():
            size = self._sides[channel][1].itemsize + HEAD - FRAME.size
            if min(map(len, own)) < size:
                raise DamagedError("a message that is shorter than its schema says")
            # Some writers fill a message up at its end.
            framed = b"".join(pack("<BQ", Opcode.MESSAGE, size) + message[:size] for message in own)
            self._take_rows(np.frombuffer(framed, rows_of(size + FRAME.size - HEAD)))

    def _take_rows(self, rows: Rows) -> None:
        for channel in np.unique(rows["channel"]).tolist():
            if channel in self._logs:
                for row in rows[rows["channel"] == channel]:
                    self._spend(FRAME_COST)
                    self._take_log(channel, row.tobytes()[FRAME.size :])
            if channel not in self._sides:
                continue
            side, layout = self._sides[channel]
            own = rows[rows["channel"] == channel]
            if own["body"].dtype.itemsize != layout.itemsize:
                # Of another channel's size, or filled up at the end.
                self._spend(FRAME_COST * len(own))
                self._take_messages([row.tobytes()[FRAME.size :] for row in own])
                continue
            # The last two bytes are options that no one uses.
            kinds = np.ascontiguousarray(own["encapsulation"]).view("u1").reshape(len(own), -1)[:, :2]
            if (kinds != np.frombuffer(ENCAPSULATION[:2], "u1")).any():
                raise ForeignError("holds messages that are not plain little-endian CDR")
            self._parts[side].append(np.ascontiguousarray(own["body"]).view(layout))

    def _take_log(self, channel: int, message: bytes) -> None:
        if self._logs[channel] == PICTURE_TOPIC:
            with _damaged("a picture"):
                self.pictures += [read_picture(message[MESSAGE.size :])] if self._with_pictures else []
            return
        with _damaged("a mark"):
            mark = read_mark(message[MESSAGE.size :])
        if self._logs[channel] == MARK_TOPIC:
            self.marks.append(mark._replace(text=shortened(mark.text)))
        else:
            self.journal.append(mark.text.encode())


def _layout(channel: Channel, schema: Schema | None) -> np.dtype[np.void]:
    """Raises ValueError if the messages of the channel cannot be read."""
    if schema is None:
        raise ValueError("has no schema")
    own, expected = (channel.message_encoding, schema.encoding), (MESSAGE_ENCODING, SCHEMA_ENCODING)
    if own != expected:
        raise ValueError(f"is encoded as {own[0]!r} with a schema as {own[1]!r}, expected {' and '.join(expected)}")
    layout = dtype_of(schema.data.decode())
    fields: Mapping[str, tuple[Any, ...]] = layout.fields or {}
    lacks = [name for name, kind in NEEDED.items() if name not in fields or fields[name][0] != kind]
    if lacks:
        raise ValueError(f"its schema {schema.name} lacks {' and '.join(lacks)}")
    return layout


def _unpacked(chunk: Chunk) -> bytes:
    """The content of a chunk, of the size that it states: its own decompressors trust what is compressed. Raises one of
    `_DAMAGE`.
    """
    size, data = chunk.uncompressed_size, chunk.data
    if chunk.compression == "zstd":
        data = zstandard.ZstdDecompressor().stream_reader(data).read(size + 1)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(data, size + 1)
    if len(data) != size:
        raise ValueError(f"it has not the {size} bytes that it states")
    if chunk.uncompressed_crc not in (0, crc := zlib.crc32(data)):
        raise ValueError(f"its checksum is {crc:x}, not {chunk.uncompressed_crc:x}")
    return data


def _parsed(read: Callable[[ReadDataStream], Parsed], body: bytes) -> Parsed:
    with _damaged("a frame that cannot be read"):
        return read(ReadDataStream(BytesIO(body)))


@contextmanager
def _damaged(what: str) -> Iterator[None]:
    try:
        yield
    except _DAMAGE as error:
        raise DamagedError(f"{what}: {error}") from None


LONGEST_ERROR = 1000
CUT_OFF = "cut off"
SHOWN_TOPICS = 3


class RecordingError(ValueError):
    """The file is no recording that can be read; the message is one line with its path."""

    def __init__(self, text: str) -> None:
        super().__init__(one_line(text, LONGEST_ERROR))


@dataclass(frozen=True)
class Recording:
    """What a file holds; what is by side has the sides that are there."""

    path: Path
    facts: dict[str, str]  # what was said of the system when it began
    origins: dict[str, Origin]
    records: dict[str, Rows]  # in order of `tick`; the fields are those of this release, but for what the file lacks
    complete: bool  # whether the recording was closed in order and nothing was lost
    lost: dict[str, int]  # records that the recorder missed, as far as it could say so
    outcome: str  # "complete", "cut off", or in words what ended the recording
    joints: tuple[str, ...] = ()  # axes of a session in joint space, the gripper last; none of a hand
    marks: tuple[Mark, ...] = ()  # that a person set, in order of time
    journal: Verified | None = None  # what its chain of lines says of itself; None where there is none
    pictures: tuple[RecordedPicture, ...] = ()  # of the robot, in order of time


def read_recording(path: str | Path, *, with_pictures: bool = False) -> Recording:
    """Read a file to its end, or to where it is cut off or damaged; its pictures only where they are asked for. Raises
    RecordingError if it cannot be opened, is something else, or nothing of a recording is left.
    """
    path = Path(path)
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            raise RecordingError(f"{path}: is no regular file; expected a recording")  # a pipe may never end
        with path.open("rb") as file:
            begin = file.read(len(MAGIC))
            if begin != MAGIC:
                is_what = f"is no MCAP file, it begins with {begin!r}" if begin else "is empty"
                raise RecordingError(f"{path}: {is_what}; expected a recording, an MCAP file")
            content = Content(size := os.fstat(file.fileno()).st_size, with_pictures=with_pictures)
            fault = _take_all(file, size, content)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}; expected a recording") from None
    except ForeignError as error:
        raise RecordingError(f"{path}: {error}; not a recording that this release can read") from None
    if not content.origins:
        raise RecordingError(f"{path}: {_without_a_side(content, fault)}; expected a recording of a session")
    end = content.metadata.get(END, {})
    outcome = one_line(fault or end.get("outcome", CUT_OFF))
    lost = {side: int(end[f"lost_{side}"]) for side in TOPICS if end.get(f"lost_{side}", "").isdecimal()}
    facts, sides = content.metadata.get(FACTS, {}), [side for side in TOPICS if side in content.origins]
    joints = joints_of(facts)
    return Recording(
        path=path,
        facts=facts,
        origins=content.origins,
        records={side: of_this_release(content.records(side), side, joints) for side in sides},
        joints=joints,
        marks=tuple(sorted(content.marks)),
        journal=_journal(content.journal, end.get(JOURNAL)),
        pictures=tuple(sorted(content.pictures)),
        complete=outcome == COMPLETE and not any(lost.values()),
        lost=lost,
        outcome=outcome,
    )


def _journal(lines: list[bytes], head: str | None) -> Verified | None:
    """The chain of the lines, whose last hash is as stated at the end of the file, if that is there."""
    found = verify(lines)
    is_short = not found.broken and head not in (None, found.head)
    found = found._replace(broken=found.lines + 1) if is_short else found
    return found if lines or found.broken else None


def _take_all(file: BufferedReader, size: int, content: Content) -> str:
    """Read frame by frame; returns what ended it before the end of the file, or nothing."""
    crc = zlib.crc32(MAGIC)
    while True:
        head = file.read(FRAME.size)
        if len(head) < FRAME.size:
            return CUT_OFF
        opcode, length = FRAME.unpack(head)
        if length > size - file.tell():
            content.take_cut(opcode, file.read())
            return CUT_OFF
        body = file.read(length)
        if opcode == Opcode.FOOTER:
            return "" if file.read(len(MAGIC)) == MAGIC else CUT_OFF
        if opcode == Opcode.DATA_END and int.from_bytes(body, "little") not in (0, crc):  # 0 stands for none
            return "damaged: the checksum of the file is another"
        try:
            content.take(opcode, body)
        except DamagedError as error:
            return f"damaged: {error}"
        crc = zlib.crc32(body, zlib.crc32(head, crc))


def _without_a_side(content: Content, fault: str) -> str:
    if content.foreign:
        shown = ", ".join([*content.foreign][:SHOWN_TOPICS])
        more = len(content.foreign) - SHOWN_TOPICS
        return f"holds {shown}{f' and {more} more' if more > 0 else ''}"
    if fault == CUT_OFF:
        return "is cut off before its first record"
    return fault or "is an MCAP file without a topic"
