"""Recordings that somebody made to keep a reader busy: small files that stand for large ones, and absurd numbers."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import FrameType

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.records import Chunk, Metadata

from plugins.recording.tests.records import SIDES, origin
from weberlink.telemetry.reader import DTYPE
from weberlink_figures.session import SessionScore
from weberlink_recording.container import END, FRAME, MESSAGE, _bytes, framed, metadata_of
from weberlink_recording.marks import Mark
from weberlink_recording.reader import MOST_CHANNELS, UNPACKED_LEAST, RecordingError, read_recording
from weberlink_recording.session import put_together
from weberlink_recording.writer import RecordingWriter

EMPTY = FRAME.pack(Opcode.MESSAGE, MESSAGE.size) + MESSAGE.pack(9, 0, 0, 0)
BANK = {"bank": "zoh"}
LAUGH = "a: &a [x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{former}'] * 5)}]\n" for former, name in zip("abcdef", "bcdefg", strict=True)
)
NAMING = """
rate_hz: 1000
codec: {force: {weber: 0.1, floor_n: 0.1, reference: actual, deadband: {shape: isotropic}}}
master: {device: {driver: replay, trace: /dev/zero}}
slave: {robot: {driver: mujoco, model: /dev/zero}}
"""


def records(count: int, step_s: float = 1e-3) -> np.ndarray:
    made = np.zeros(count, DTYPE)
    made["tick"], made["weber"] = np.arange(count), 0.1
    made["at"] = made["tick"] * step_s
    return made


def made(path: Path, count: int = 10, step_s: float = 1e-3, facts: dict[str, str] | None = None) -> Path:
    """A finished recording of both sides."""
    with RecordingWriter.create(path, BANK | (facts or {})) as writer:
        for side in SIDES:
            writer.add_side(origin(side))
            writer.write(side, records(count, step_s))
    return path


def with_chunks(path: Path, *chunks: Chunk) -> Path:
    """A recording of ten ticks of the slave, and chunks of our making."""
    with RecordingWriter.create(path, BANK) as writer:
        writer.add_side(origin("slave"))
        writer.write("slave", records(10))
        writer.flush()
        for chunk in chunks:
            writer._file._append(_bytes(chunk))
    return path


def packed(data: bytes, size: int | None = None, compression: str = "zstd") -> Chunk:
    """A chunk that says that it unpacks to `size` bytes."""
    compress = zstandard.compress if compression == "zstd" else lz4.frame.compress
    return Chunk(compression, compress(data), 0, 0, 0, len(data) if size is None else size)


def rows(count: int) -> bytes:
    return framed(1, 0, 0, np.zeros(count, DTYPE)).tobytes()


@pytest.mark.parametrize(
    ("chunks", "outcome"),
    [
        ([packed(EMPTY * 500_000)], "damaged: it unpacks to more than"),
        ([packed(rows(40_000)) for _ in range(5)], "damaged: it unpacks to more than"),
        ([packed(rows(20_000), 1000)], "damaged: a chunk that does not unpack: it has not the 1000 bytes"),
        ([packed(rows(20_000), 1000, "lz4")], "damaged: a chunk that does not unpack"),
        ([packed(rows(1), 1 << 60)], "damaged: it unpacks to more than"),
    ],
    ids=["messages without content", "many", "more than it says", "the same in lz4", "absurd"],
)
def test_a_small_file_that_stands_for_a_large_one_is_read_up_to_there(
    tmp_path: Path, chunks: list[Chunk], outcome: str
) -> None:
    recording = read_recording(with_chunks(tmp_path / "small.mcap", *chunks))
    assert recording.outcome.startswith(outcome) and not recording.complete
    records = recording.records["slave"]
    assert len(records) >= 10 and records.nbytes < 1.5 * UNPACKED_LEAST


def test_a_topic_that_is_there_many_times_is_foreign(tmp_path: Path) -> None:
    with RecordingWriter.create(tmp_path / "many.mcap", BANK) as writer:
        writer.add_side(origin("slave"))
        for _ in range(MOST_CHANNELS):
            writer._file.add_channel("/weberlink/slave", 1, metadata_of(origin("slave")))
    with pytest.raises(RecordingError, match=f"more than {MOST_CHANNELS} channels"):
        read_recording(writer.path)


def test_what_was_ticked_once_an_hour_takes_no_longer_than_what_was_ticked_at_its_rate(tmp_path: Path) -> None:
    session = put_together([read_recording(made(tmp_path / "sparse.mcap", 5000, 3600.0))])
    scored = 0

    def count(frame: FrameType, event: str, _argument: object) -> None:
        nonlocal scored
        scored += event == "call" and frame.f_code is SessionScore.add.__code__

    sys.setprofile(count)
    try:
        figures = session.figures()
    finally:
        sys.setprofile(None)
    assert scored <= 5
    assert figures.ticks["master"].count == 5000


@pytest.mark.parametrize(
    ("configuration", "why"),
    [
        (LAUGH, "YAML with an alias"),
        ("[" * 200 + "]" * 200, "nested more than 32 deep"),
        (f"x: [{'1,' * 40_000}]", "more than 65536 characters"),
        (f"rate_hz: {'9' * 5000}", "digits"),
        ("- 1", "no settings of a deadband"),
    ],
    ids=["aliases", "deep", "long", "digits", "a list"],
)
def test_a_configuration_that_is_none_is_one_line(tmp_path: Path, configuration: str, why: str) -> None:
    with pytest.raises(RecordingError, match=why) as raised:
        put_together([read_recording(made(tmp_path / "a.mcap", facts={"configuration": configuration}))])
    assert str(raised.value).isprintable()


@pytest.mark.parametrize("rate_hz", [1e300, 1e-300])
def test_an_absurd_rate_is_refused(tmp_path: Path, rate_hz: float) -> None:
    with RecordingWriter.create(tmp_path / "rate.mcap", BANK) as writer:
        writer.add_side(replace(origin("slave"), rate_hz=rate_hz))
        writer.write("slave", records(10))
    with pytest.raises(RecordingError, match="no plausible rate"):
        put_together([read_recording(writer.path)])


def test_texts_of_a_recording_are_shown_in_printable_lines(tmp_path: Path) -> None:
    with RecordingWriter.create(tmp_path / "marks.mcap", BANK) as writer:
        writer.add_side(origin("slave"))
        writer.write("slave", records(10))
        writer.mark(Mark(round(origin("slave").wall_s * 1e9), "\x1b[2Jstart\nhere"))
        writer._file.finish(Metadata(END, {"outcome": "\x1b[2Jbad\nend"}))
    recording = read_recording(writer.path)
    assert recording.outcome.isprintable() and "bad end" in recording.outcome
    assert [mark.text for mark in recording.marks] == ["[2Jstart here"]


def test_files_that_a_recording_names_are_not_opened(tmp_path: Path) -> None:
    path = made(tmp_path / "naming.mcap", facts={"configuration": NAMING})
    code = (
        "import sys; sys.addaudithook(lambda event, of: event == 'open' and print(of[0]));"
        "from pathlib import Path; from weberlink_recording.export import describe; describe([Path(sys.argv[1])])"
    )
    told = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, check=True).stdout
    assert str(path) in told and "/dev/zero" not in told
