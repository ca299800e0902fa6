"""Writes a recording: the records of one or both sides, in order of time, into one MCAP file.

What was flushed stays readable whatever happens next: at any moment the file is a sequence of whole chunks.
"""

import errno
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from mcap.records import Metadata

from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.recorders import COMPLETE
from weberlink_figures.chain import Chain
from weberlink_figures.message import SCHEMA_NAME, SCHEMA_TEXT, Origin, Rows
from weberlink_recording.container import END, FACTS, JOURNAL, QOS, McapFile, framed, metadata_of
from weberlink_recording.marks import JOURNAL_TOPIC, MARK_DEFINITION, MARK_SCHEMA, MARK_TOPIC, Mark, pack_mark
from weberlink_recording.pictures import PICTURE_DEFINITION, PICTURE_SCHEMA, RecordedPicture, pack_picture, topic_of

CHUNK_RECORDS = 4096  # a chunk is written when it holds so many records, or earlier by `flush`


class RecordingExistsError(FileExistsError):
    """The file exists already."""


class RecordingWriter:
    """One new recording; made by `create`.

    After a failed write every call but `close` raises the same OSError. The file is then cut back to its last whole
    chunk and, if possible, finished in order.
    """

    def __init__(self, path: Path, file: McapFile) -> None:
        self.path = path
        self._file = file
        self._sides: dict[str, tuple[Origin, int]] = {}  # with the channel of each
        self._taken: Counter[str] = Counter()
        self._lost: Counter[str] = Counter()
        self._schema: int | None = None
        self._logs: dict[str, int] = {}  # channels of marks, journal and pictures by topic
        self._log_schema = self._picture_schema = 0
        self._chain = Chain()
        self._pending: list[Rows] = []
        self._error: OSError | None = None
        self._closed = False

    @classmethod
    def create(cls, path: str | Path, facts: Mapping[str, str]) -> Self:
        """Begin a recording, with the facts that a reader is to know beside the records.

        Raises:
            RecordingExistsError: the path is taken; what is there is left alone.
            OSError: the file cannot be made.
        """
        path = Path(path)
        try:
            return cls(path, McapFile.create(path, Metadata(FACTS, dict(facts))))
        except FileExistsError:
            text = "exists already; recordings are never overwritten, give another name"
            raise RecordingExistsError(errno.EEXIST, text, str(path)) from None

    @property
    def records(self) -> dict[str, int]:
        """How many records of each side are in the file."""
        return {side: self._file.messages[channel] for side, (_, channel) in self._sides.items()}

    @property
    def lost(self) -> dict[str, int]:
        """How many records of each side are known to be missing."""
        return {side: self._lost[side] for side in self._sides}

    @property
    def marks(self) -> int:
        """How many marks are in the file."""
        return self._file.messages[self._logs[MARK_TOPIC]] if MARK_TOPIC in self._logs else 0

    @property
    def size(self) -> int:
        """Of the file [bytes]."""
        return self._file.size

    def add_side(self, origin: Origin) -> None:
        """Announce a side before its first record; raises ValueError for one that is there already, or is none."""
        if origin.side in self._sides:
            raise ValueError(f"{origin.side} is recorded already")
        topic = origin.topic
        with self._writing():
            if self._schema is None:
                self._schema = self._file.add_schema(SCHEMA_NAME, SCHEMA_TEXT)
            self._sides[origin.side] = origin, self._file.add_channel(topic, self._schema, metadata_of(origin))

    def write(self, side: str, records: Rows) -> None:
        """Take the next records of a side; they are in the file after `flush`, or when a chunk is full.

        Oldest first, of `weberlink.telemetry.reader.DTYPE`; raises ValueError for those of another type, or of a side
        that was not added.
        """
        self._check()
        if side not in self._sides:
            raise ValueError(f"{side!r} was not added")
        if records.dtype != DTYPE:
            raise ValueError("records have other fields than those of this release")
        if not len(records):
            return
        origin, channel = self._sides[side]
        self._pending.append(framed(channel, self._taken[side], origin.log_times_ns(records["at"]), records))
        self._taken[side] += len(records)
        if sum(map(len, self._pending)) >= CHUNK_RECORDS:
            self.flush()

    def mark(self, mark: Mark, topic: str = MARK_TOPIC) -> None:
        """Write a mark, or a line of the journal by its topic."""
        with self._writing():
            if topic not in self._logs:
                self._log_schema = self._log_schema or self._file.add_schema(MARK_SCHEMA, MARK_DEFINITION)
                self._logs[topic] = self._file.add_channel(topic, self._log_schema, QOS)
            channel, body = self._logs[topic], pack_mark(mark)
            count = self._file.messages[channel]
            self._file.add_chunk(framed(channel, count, mark.wall_ns, np.array([body], f"V{len(body)}")))

    def picture(self, picture: RecordedPicture) -> None:
        """Write a picture of the robot."""
        topic = topic_of(picture.camera)
        with self._writing():
            if topic not in self._logs:
                self._picture_schema = self._picture_schema or self._file.add_schema(PICTURE_SCHEMA, PICTURE_DEFINITION)
                self._logs[topic] = self._file.add_channel(topic, self._picture_schema, QOS)
            channel, body = self._logs[topic], pack_picture(picture)
            row = framed(channel, self._file.messages[channel], picture.wall_ns, np.array([body], f"V{len(body)}"))
            self._file.add_chunk(row, is_packed=True)

    def journal(self, wall_ns: int, document: Mapping[str, Any]) -> None:
        """Write the next line of the journal; its moment on the wall clock is that of its event."""
        line = self._chain.line(document)
        self.mark(Mark(wall_ns, line), JOURNAL_TOPIC)
        self._chain.append(line)

    def flush(self) -> None:
        """Hand all records so far to the kernel, so that the death of this process costs none of them."""
        with self._writing():
            if self._pending:
                rows = np.concatenate(self._pending)
                self._pending.clear()
                self._file.add_chunk(rows[np.argsort(rows["log_time"], kind="stable")])

    def note_lost(self, side: str, count: int) -> None:
        """Count records that came too late to be written."""
        self._lost[side] += count

    def close(self, outcome: str = COMPLETE) -> None:
        """Write what is left, how it ended, and the index. Does nothing after an error or another `close`."""
        if self._closed:
            return
        self.flush()
        with self._writing():
            self._file.finish(self._end(outcome))
        try:
            self._file.sync()
        finally:
            self._release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if error is None:
            self.close()
            return
        with suppress(OSError):  # the first error is the one to hear of
            self.close(f"failed: {error or type(error).__name__}")

    def _check(self) -> None:
        if self._error is not None:
            raise OSError(self._error.errno, self._error.strerror, str(self.path))
        if self._closed:
            raise ValueError(f"{self.path} is closed")

    @contextmanager
    def _writing(self) -> Iterator[None]:
        self._check()
        try:
            yield
        except OSError as error:
            self._give_up(error)
            raise

    def _give_up(self, error: OSError) -> None:
        """Finish what can be finished: with the index if there is room, else without."""
        self._error = error
        self._pending.clear()
        end = self._end(error.strerror or str(error))
        for indexed in (True, False):
            with suppress(OSError):
                self._file.finish(end, indexed=indexed)
                break
        self._release()

    def _end(self, outcome: str) -> Metadata:
        counts = {f"records_{side}": str(count) for side, count in self.records.items()}
        lost = {f"lost_{side}": str(count) for side, count in self.lost.items()}
        journal = {JOURNAL: self._chain.head} if JOURNAL_TOPIC in self._logs else {}
        return Metadata(END, {"outcome": outcome, **counts, **lost, **journal})

    def _release(self) -> None:
        self._closed = True
        self._file.close()
