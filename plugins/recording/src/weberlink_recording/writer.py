"""Writes a recording: the records of one or both sides, in order of time, into one MCAP file.

What was flushed stays readable whatever happens next: at any moment the file is a sequence of whole chunks.
"""

import errno
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Metadata

from weberlink.telemetry.message import (
    ENCAPSULATION,
    MESSAGE_ENCODING,
    QOS,
    SCHEMA_ENCODING,
    SCHEMA_NAME,
    SCHEMA_TEXT,
    Origin,
    Rows,
)
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.recorders import COMPLETE
from weberlink_recording.container import END, FACTS, FRAME, McapFile, rows_of
from weberlink_recording.marks import MARK_DEFINITION, MARK_SCHEMA, MARK_TOPIC, Mark, pack_mark

__all__ = ["Origin", "RecordingExistsError", "RecordingWriter"]

CHUNK_RECORDS = 4096
"""A chunk is written when it holds so many records, or earlier by `flush`."""

_ROW = rows_of(DTYPE.itemsize)
_SEQUENCES = 2**32


class RecordingExistsError(FileExistsError):
    """The file exists already."""


@dataclass
class _Side:
    origin: Origin
    channel: int
    taken: int = 0


class RecordingWriter:
    """One new recording; made by `create`.

    After a failed write every call raises the same OSError. The file is then cut back to its last whole chunk and, if
    possible, finished in order.
    """

    def __init__(self, path: Path, file: McapFile) -> None:
        self.path = path
        self._file = file
        self._sides: dict[str, _Side] = {}
        self._lost: Counter[str] = Counter()
        self._schema: int | None = None
        self._marks: int | None = None
        """Channel of the marks; None before the first."""
        self._pending: list[Rows] = []
        self._waiting = 0
        self._error: OSError | None = None
        self._closed = False

    @classmethod
    def create(cls, path: str | Path, facts: Mapping[str, str]) -> Self:
        """Begin a recording.

        Args:
            path: of a file that is not there yet.
            facts: what a reader is to know beside the records.

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
        return {name: self._file.messages[side.channel] for name, side in self._sides.items()}

    @property
    def lost(self) -> dict[str, int]:
        """How many records of each side are known to be missing."""
        return {name: self._lost[name] for name in self._sides}

    @property
    def marks(self) -> int:
        """How many marks are in the file."""
        return 0 if self._marks is None else self._file.messages[self._marks]

    @property
    def size(self) -> int:
        """Of the file [bytes]."""
        return self._file.size

    def add_side(self, origin: Origin) -> None:
        """Announce a side before its first record.

        Raises:
            ValueError: it is there already, or is none.
            OSError: as of the class.
        """
        self._check()
        if origin.side in self._sides:
            raise ValueError(f"{origin.side} is recorded already")
        topic = origin.topic
        try:
            if self._schema is None:
                self._schema = self._file.add_schema(SCHEMA_NAME, SCHEMA_ENCODING, SCHEMA_TEXT)
            channel = self._file.add_channel(topic, MESSAGE_ENCODING, self._schema, origin.to_metadata())
        except OSError as error:
            self._give_up(error)
            raise
        self._sides[origin.side] = _Side(origin, channel)

    def write(self, side: str, records: Rows) -> None:
        """Take the next records of a side; they are in the file after `flush`, or when a chunk is full.

        Args:
            side: one that was added.
            records: of `weberlink.telemetry.reader.DTYPE`, shape (n,), oldest first.

        Raises:
            ValueError: of another type, or of a side that was not added.
            OSError: as of the class.
        """
        self._check()
        if side not in self._sides:
            raise ValueError(f"{side!r} was not added")
        if records.dtype != DTYPE:
            raise ValueError("records have other fields than those of this release")
        if not len(records):
            return
        self._pending.append(_framed(records, self._sides[side]))
        self._waiting += len(records)
        if self._waiting >= CHUNK_RECORDS:
            self.flush()

    def mark(self, mark: Mark) -> None:
        """Write a mark.

        Raises:
            OSError: as of the class.
        """
        self._check()
        body = pack_mark(mark)
        row = np.zeros(1, rows_of(len(body)))
        try:
            if self._marks is None:
                schema = self._file.add_schema(MARK_SCHEMA, SCHEMA_ENCODING, MARK_DEFINITION)
                self._marks = self._file.add_channel(MARK_TOPIC, MESSAGE_ENCODING, schema, QOS)
            _frame(row, self._marks, self.marks)
            row["log_time"] = row["publish_time"] = mark.wall_ns
            row["body"] = np.void(body)
            self._file.add_chunk(row)
        except OSError as error:
            self._give_up(error)
            raise

    def flush(self) -> None:
        """Hand all records so far to the kernel, so that the death of this process costs none of them.

        Raises:
            OSError: as of the class; the records that were not yet in the file are gone.
        """
        self._check()
        if not self._pending:
            return
        rows = np.concatenate(self._pending)
        self._pending.clear()
        self._waiting = 0
        try:
            self._file.add_chunk(rows[np.argsort(rows["log_time"], kind="stable")])
        except OSError as error:
            self._give_up(error)
            raise

    def note_lost(self, side: str, count: int) -> None:
        """Count records that came too late to be written."""
        self._lost[side] += count

    def close(self, outcome: str = COMPLETE) -> None:
        """Write what is left, how it ended, and the index. Does nothing after an error or another `close`.

        Raises:
            OSError: as of the class.
        """
        if self._closed:
            return
        self.flush()
        try:
            self._file.finish(self._end(outcome))
        except OSError as error:
            self._give_up(error)
            raise
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

    def _give_up(self, error: OSError) -> None:
        """Finish what can be finished: with the index if there is room, else without."""
        self._error = error
        self._pending.clear()
        end = self._end(error.strerror or str(error))
        for indexed in (True, False):
            try:
                self._file.finish(end, indexed=indexed)
                break
            except OSError:
                continue
        self._release()

    def _end(self, outcome: str) -> Metadata:
        counts = {f"records_{side}": str(count) for side, count in self.records.items()}
        lost = {f"lost_{side}": str(count) for side, count in self.lost.items()}
        return Metadata(END, {"outcome": outcome, **counts, **lost})

    def _release(self) -> None:
        self._closed = True
        self._file.close()


def _framed(records: Rows, side: _Side) -> Rows:
    """The records as messages of a chunk."""
    count = len(records)
    rows = np.empty(count, _ROW)
    _frame(rows, side.channel, side.taken)
    rows["log_time"] = rows["publish_time"] = side.origin.log_times_ns(records["at"])
    rows["body"] = np.ascontiguousarray(records).view(_ROW["body"])
    side.taken += count
    return rows


def _frame(rows: Rows, channel: int, taken: int) -> None:
    """Fill in what is before the times and the body of messages."""
    rows["opcode"] = Opcode.MESSAGE
    rows["length"] = rows.dtype.itemsize - FRAME.size
    rows["channel"] = channel
    rows["sequence"] = np.arange(taken, taken + len(rows)) % _SEQUENCES
    rows["encapsulation"] = np.void(ENCAPSULATION)
