"""The `record` commands: describe recordings, and write them as tables, for ROS tools, and for LeRobot."""

import csv
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.text import Text

from weberlink.config import ConfigurationError
from weberlink.config.errors import require_package
from weberlink.master.trace import COLUMNS, TraceError, read_trace
from weberlink.session.description import RANGE
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import AXES, MOST_AXES, SECOND
from weberlink.telemetry.recorders import COMPLETE
from weberlink_figures.chain import Verified, verify
from weberlink_figures.log_file import LONGEST_LINE
from weberlink_figures.report import session_report
from weberlink_figures.session import Layout
from weberlink_figures.verdict import verdict
from weberlink_recording.configuration import BEGUN, CONFIGURATION, parse_foreign
from weberlink_recording.lerobot_frames import NoFramesError, frames_of
from weberlink_recording.reader import Recording, RecordingError, read_recording
from weberlink_recording.ros_export import RATE_HZ, write_ros
from weberlink_recording.session import RecordedSession, put_together, time_axis

FORMATS = ("csv", "parquet", "ros", "lerobot")
ARROW = ("parquet", "lerobot")  # formats that need pyarrow, which is in the extra of that name
BLOCK_ROWS = 50_000  # rows converted at a time: Python numbers take far more memory than an array


class ExportError(Exception):
    """A file cannot be written."""


class Description(NamedTuple):
    """What recordings or logs contain: for JSON, whose lines are not as they were written, and what prints it."""

    document: dict[str, Any]
    broken: str | None
    show: Callable[[Console], None]


def describe(paths: Sequence[Path]) -> Description:
    """Describe one recording, those of both sides, or logs; raises ConfigurationError if a file is not a recording, or
    the files are not of one session.
    """
    if all(map(_is_log, paths)):
        return _describe_logs({str(path): _verified(path) for path in paths})
    recordings, session = _read(paths)
    files = [
        {
            "path": str(recording.path),
            "bytes": recording.path.stat().st_size,
            "complete": recording.complete,
            "outcome": recording.outcome,
            "records": {side: len(records) for side, records in recording.records.items()},
            "lost": recording.lost,
            "clock": recording.facts.get("clock", "real"),
            "began": _date(recording),
            "begun": recording.facts.get(BEGUN),
            "configuration": recording.facts.get("configuration"),
            "journal": None if recording.journal is None else recording.journal._asdict(),
        }
        for recording in recordings
    ]
    first = min(float(records["at"][0]) for records in session.sides.values())
    marks = [{"at_s": round(mark.at - first, 3), "text": mark.text} for mark in session.marks]
    outcome = next((_ended(each) for each in recordings if not each.complete), "completed")
    figures = replace(session.figures(), outcome=outcome)
    figures = replace(figures, verdict=verdict(figures))

    def show(console: Console) -> None:
        """A line for each file, then the report of the session."""
        for file, recording in zip(files, recordings, strict=True):
            console.print(Text(_file_line(file, recording)))
            if recording.journal is not None:
                console.print(Text(f"journal: {recording.journal}"), soft_wrap=True)
        for mark in marks:
            console.print(Text(f"mark at {mark['at_s']:.3f} s: {mark['text']}"))
        session_report(figures, "weberlink record info " + " ".join(map(str, paths)), console)

    journals = ((each.path, each.journal) for each in recordings if each.journal is not None)
    broken = next((f"the journal of {path} is {journal}" for path, journal in journals if journal.broken), None)
    return Description({"files": files, "marks": marks} | figures.to_json(), broken, show)


def _describe_logs(logs: dict[str, Verified]) -> Description:
    def show(console: Console) -> None:
        for path, found in logs.items():
            console.print(Text(f"{path}: {found}"), soft_wrap=True)

    broken = next((f"{path} {found}" for path, found in logs.items() if found.broken), None)
    return Description({"logs": {path: found._asdict() for path, found in logs.items()}}, broken, show)


def _is_log(path: Path) -> bool:
    """Whether a file begins as those of `--log` do."""
    try:
        with path.open("rb") if path.is_file() else BytesIO() as file:
            return file.read(1) == b"{"
    except OSError:
        return False  # as a recording it is told why


def _verified(path: Path) -> Verified:
    with path.open("rb") as file:
        return verify(line.rstrip(b"\n") for line in iter(lambda: file.readline(LONGEST_LINE + 1), b""))


def export(paths: Sequence[Path], to: str, folder: Path | None, fps: int, task: str) -> list[str]:
    """Write files beside the first recording, or into the folder; returns a line for each.

    `csv` and `parquet` are a table for each side; with `csv` also the signal that `study evaluate` reads: what the
    robot was commanded and felt while engaged. `ros` is one MCAP file for ROS tools, `lerobot` the folder of a LeRobot
    dataset with so many frames per second, of what was done in words.

    Raises:
        ConfigurationError: for a format or a file that cannot be used, or a file that exists already.
        ExportError: a file cannot be written; no part of it is left.
    """
    if to not in FORMATS:
        raise ConfigurationError(f"--to: {to!r} is none of {', '.join(FORMATS)}")
    if to in ARROW:
        require_package("pyarrow", "recording[parquet]", f"--to {to}")
    recordings, session = _read(paths, with_pictures=to == "lerobot")
    if session.pictures:
        require_package("av", "recording[video]", f"--to {to} with pictures")
    target = folder if folder is not None else paths[0].parent
    outputs = dict(_outputs(recordings, session, to, fps, task))
    outs = {name: target / f"{paths[0].stem}-{name}" for name in outputs}
    for out in outs.values():
        if out.exists():
            raise ConfigurationError(f"--out: {out} exists; move it away or name another folder")
    try:
        target.mkdir(parents=True, exist_ok=True)
        return [f"{out}: {_place(outputs[name], out)}" for name, out in outs.items()]
    except OSError as error:
        raise ExportError(f"{target}: cannot be written: {error.strerror or error}") from None


Columns = dict[str, NDArray[Any]]
Output = Callable[[Path], str]  # writes a file that is not there yet, and says what is in it


def _outputs(
    recordings: Sequence[Recording], session: RecordedSession, to: str, fps: int, task: str
) -> Iterator[tuple[str, Output]]:
    """The end of the name of each file, and what writes it."""
    if to == "ros":
        yield "ros.mcap", lambda path: _write_ros(recordings, session, path)
        return
    if to == "lerobot":
        yield "lerobot", _lerobot(recordings, session, fps, task)
        return
    times = time_axis(session)
    for side, records in session.sides.items():
        columns = {"t": times[side]} | _columns(records, session.layout)
        yield f"{side}.{to}", _table(columns, _write_csv if to == "csv" else _write_parquet)
    signal = _signal(recordings) if to == "csv" else None
    if signal is not None:
        yield "trace.csv", _table(signal, _write_csv)


def _table(columns: Columns, write: Callable[[Columns, Path], None]) -> Output:
    def output(path: Path) -> str:
        write(columns, path)
        return f"{len(next(iter(columns.values())))} rows, {len(columns)} columns"

    return output


def _signal(recordings: Sequence[Recording]) -> dict[str, NDArray[Any]] | None:
    """The columns of the trace of the slave's side; None where it was not recorded or never engaged."""
    for recording in recordings:
        if len(recording.records.get("slave", ())):
            try:
                trace = read_trace(recording.path)
            except TraceError:
                return None
            table = np.column_stack((trace.time_s, trace.position_m, trace.force_n))
            return dict(zip(COLUMNS, table.T, strict=True))
    return None


def _write_ros(recordings: Sequence[Recording], session: RecordedSession, path: Path) -> str:
    first = next((each for each in recordings if "master" in each.origins), recordings[0])
    count = write_ros(session, first.origins, first.facts, path)
    what = "poses, forces and frames" if not session.layout.joints else "joint states"
    return f"{count} messages; {what} at {RATE_HZ:g} Hz"


def _lerobot(recordings: Sequence[Recording], session: RecordedSession, fps: int, task: str) -> Output:
    from weberlink_recording.lerobot_export import write_dataset  # noqa: PLC0415 - writes with an optional library

    if not 1 <= fps <= session.layout.rate_hz:
        raise ConfigurationError(f"--fps: {fps} is not within 1 and the {session.layout.rate_hz:g} Hz of the ticks")
    try:
        frames = frames_of(session, fps, _gripper_range(recordings))
    except NoFramesError as error:
        raise ConfigurationError(f"{', '.join(str(each.path) for each in recordings)}: {error}") from None
    notes = [f"{each.path} is {_ended(each)}" for each in recordings if not each.complete]

    def output(path: Path) -> str:
        return "; ".join([write_dataset(frames, task, _robot(recordings), path), *notes])

    return output


def _gripper_range(recordings: Sequence[Recording]) -> tuple[float, float] | None:
    """Least and largest angle of the gripper [rad]; None if no recording tells them."""
    for recording in recordings:
        try:
            low, high = (float(recording.facts[name].split()[-1]) for name in RANGE)
        except (KeyError, IndexError, ValueError):
            continue
        if low < high:
            return low, high
    return None


def _robot(recordings: Sequence[Recording]) -> str | None:
    """The driver of the follower; None if it is not known."""
    text = next((each.facts[CONFIGURATION] for each in recordings if CONFIGURATION in each.facts), "")
    try:
        return str(parse_foreign(text)["slave"]["robot"]["driver"])  # `put_together` has read it
    except (KeyError, TypeError):
        return None


def _place(write: Output, path: Path) -> str:
    """Write to a temporary name, then rename, so that no part of a file can remain."""
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        told = write(draft)
        draft.rename(path)
    except BaseException:
        if draft.is_dir():
            shutil.rmtree(draft)
        draft.unlink(missing_ok=True)
        raise
    return told


def _read(paths: Sequence[Path], *, with_pictures: bool = False) -> tuple[list[Recording], RecordedSession]:
    try:
        recordings = [read_recording(path, with_pictures=with_pictures) for path in paths]
        return recordings, put_together(recordings)
    except RecordingError as error:
        raise ConfigurationError(str(error)) from None


def _date(recording: Recording) -> str | None:
    """Start on the wall clock; None for virtual time."""
    if recording.facts.get("clock") == "virtual" or not recording.origins:
        return None
    began = min(origin.wall_s for origin in recording.origins.values())
    return datetime.fromtimestamp(began, UTC).isoformat(timespec="milliseconds")


def _file_line(file: dict[str, Any], recording: Recording) -> str:
    sides = ", ".join(f"{side} {count} records" for side, count in file["records"].items())
    began = (
        f"began {' '.join(filter(None, (file['began'], file['begun'])))}" if file["began"] else f"{file['clock']} time"
    )
    lost = sum(file["lost"].values())
    parts = [
        f"{file['path']}: {sides}",
        f"{file['bytes'] / 1e6:.1f} MB",
        began,
        _ended(recording),
    ]
    return ", ".join(parts + ([f"{lost} records lost"] if lost else []))


def _ended(recording: Recording) -> str:
    """The number of lost records is shown beside it."""
    return "whole" if recording.complete else "not whole" if recording.outcome == COMPLETE else recording.outcome


def _columns(records: Records, layout: Layout) -> Columns:
    """Flat columns of what the session has; a vector becomes one for each of its axes, named by it."""
    columns: Columns = {}
    for name in records.dtype.names or ():
        values = records[name]
        if name.startswith(SECOND) and len(layout.from_slave) == 1:
            continue
        if values.ndim == 1:
            columns[name] = values
        else:
            axes = layout.axes if values.shape[1] == MOST_AXES else AXES
            columns |= {f"{name}_{axis}": values[:, place] for place, axis in enumerate(axes)}
    return columns


def _write_csv(columns: Columns, path: Path) -> None:
    """Write numbers with enough digits to read the same ones back; unknown ones as `nan`."""
    with path.open("x", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for first in range(0, len(next(iter(columns.values()))), BLOCK_ROWS):
            block = [column[first : first + BLOCK_ROWS].tolist() for column in columns.values()]
            writer.writerows(zip(*block, strict=True))


def _write_parquet(columns: Columns, path: Path) -> None:
    import pyarrow  # noqa: PLC0415
    import pyarrow.parquet  # noqa: PLC0415

    table = pyarrow.table({name: np.ascontiguousarray(column) for name, column in columns.items()})
    pyarrow.parquet.write_table(table, path)
