"""Reading a recording: all that is whole in it, of whatever release and however it ended.

Owns the way through the file and the lines that say what is wrong with one. Knows no ring and no figure.
"""

import os
import zlib
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path

from mcap.opcode import Opcode

from weberlink.telemetry.recording.content import Content, DamagedError, ForeignError
from weberlink.telemetry.recording.framing import FRAME, MAGIC
from weberlink.telemetry.recording.message import COMPLETE, END, FACTS, Rows
from weberlink.telemetry.recording.origin import TOPICS, Origin

CUT_OFF = "cut off"
SHOWN_TOPICS = 3


class RecordingError(ValueError):
    """The file is no recording that can be read; the message is one line with its path."""


@dataclass(frozen=True)
class Recording:
    """What a file holds.

    Args:
        facts: what was said of the system when it began.
        origins: by side.
        records: by side, in order of `tick`; the fields are those of the release that wrote the file.
        complete: whether the recording was closed in order and nothing was lost.
        lost: records by side that the recorder missed, as far as it could say so.
        outcome: "complete", "cut off", or in words what ended the recording.
    """

    path: Path
    facts: dict[str, str]
    origins: dict[str, Origin]
    records: dict[str, Rows]
    complete: bool
    lost: dict[str, int]
    outcome: str


def read_recording(path: str | Path) -> Recording:
    """Read a file to its end, or to where it is cut off or damaged.

    Raises:
        RecordingError: it cannot be opened, is something else, or nothing of a recording is left.
    """
    path = Path(path)
    content = Content()
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            raise RecordingError(f"{path}: is no regular file; expected a recording")  # a pipe may never end
        with path.open("rb") as file:
            _check_magic(path, file)
            fault = _take_all(file, content)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}; expected a recording") from None
    except ForeignError as error:
        raise RecordingError(f"{path}: {error}; not a recording that this release can read") from None
    if not content.origins:
        raise RecordingError(f"{path}: {_without_a_side(content, fault)}; expected a recording of a session")
    end = content.metadata.get(END, {})
    outcome = fault or end.get("outcome", CUT_OFF)
    lost = {side: int(end[f"lost_{side}"]) for side in TOPICS if end.get(f"lost_{side}", "").isdecimal()}
    return Recording(
        path=path,
        facts=content.metadata.get(FACTS, {}),
        origins=content.origins,
        records={side: content.records(side) for side in TOPICS if side in content.origins},
        complete=outcome == COMPLETE and not any(lost.values()),
        lost=lost,
        outcome=outcome,
    )


def _check_magic(path: Path, file: BufferedReader) -> None:
    begin = file.read(len(MAGIC))
    if not begin:
        raise RecordingError(f"{path}: is empty; expected a recording, an MCAP file")
    if begin != MAGIC:
        raise RecordingError(f"{path}: is no MCAP file, it begins with {begin!r}; expected a recording")


def _take_all(file: BufferedReader, content: Content) -> str:
    """Read frame by frame; returns what ended it before the end of the file, or nothing."""
    size = os.fstat(file.fileno()).st_size
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
        try:
            if opcode == Opcode.DATA_END:
                _check_data(body, crc)
            content.take(opcode, body)
        except DamagedError as error:
            return f"damaged: {error}"
        crc = zlib.crc32(body, zlib.crc32(head, crc))


def _check_data(body: bytes, crc: int) -> None:
    """Compare the checksum of all before the index; 0 stands for none."""
    expected = int.from_bytes(body, "little")
    if expected not in (0, crc):
        raise DamagedError("the checksum of the file is another")


def _without_a_side(content: Content, fault: str) -> str:
    if content.foreign:
        shown = ", ".join(content.foreign[:SHOWN_TOPICS])
        more = len(content.foreign) - SHOWN_TOPICS
        return f"holds {shown}{f' and {more} more' if more > 0 else ''}"
    if fault == CUT_OFF:
        return "is cut off before its first record"
    return fault or "is an MCAP file without a topic"
