"""The `info` and `export` commands: describe recordings, and write their records as tables."""

import csv
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.text import Text

from weberlink.system.configuration import ConfigurationError
from weberlink.system.configuration.extras import need
from weberlink.system.report import session_report
from weberlink.system.scoring.session import Records
from weberlink.system.verdict import verdict
from weberlink.telemetry.record import AXES

FORMATS = ("csv", "parquet")
BLOCK_ROWS = 50_000
"""Rows converted at a time: Python numbers take far more memory than an array."""


class ExportError(Exception):
    """A table cannot be written."""


@dataclass(frozen=True)
class RecordingDescription:
    """What the recordings contain, and how it is shown."""

    document: dict[str, Any]

    def show(self, console: Console) -> None:
        """Print a line for each file, then the report of the session."""
        for file in self.document["files"]:
            console.print(Text(_file_line(file)))
        title = "weberlink info " + " ".join(file["path"] for file in self.document["files"])
        session_report(self.document, title, console)


def describe(paths: Sequence[Path]) -> RecordingDescription:
    """Describe one recording, or those of both sides.

    Raises:
        ConfigurationError: a file is not a recording, or the files are not of one session.
    """
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
            "configuration": recording.facts.get("configuration"),
        }
        for recording in recordings
    ]
    document = {"files": files} | session.summary()
    document["outcome"] = next((_ended(file) for file in files if not file["complete"]), "completed")
    document["verdict"] = verdict(document).document()
    return RecordingDescription(document)


def export(paths: Sequence[Path], to: str, folder: Path | None) -> list[str]:
    """Write one table for each side beside the first recording, or into the folder; returns a line for each.

    Raises:
        ConfigurationError: for a format or a file that cannot be used, or a table that exists already.
        ExportError: a table cannot be written; no part of it is left.
    """
    if to not in FORMATS:
        raise ConfigurationError(f"--to: {to!r} is none of {', '.join(FORMATS)}")
    if to == "parquet":
        need("pyarrow", "parquet", "--to parquet")
    _, session = _read(paths)
    from weberlink.system.scoring.recorded import time_axis  # noqa: PLC0415 - reads with an optional library

    times = time_axis(session)
    target = folder if folder is not None else paths[0].parent
    outs = {side: target / f"{paths[0].stem}-{side}.{to}" for side in session.sides}
    for out in outs.values():
        if out.exists():
            raise ConfigurationError(f"--out: {out} exists; move it away or name another folder")
    lines = []
    try:
        target.mkdir(parents=True, exist_ok=True)
        for side, records in session.sides.items():
            columns = {"t": times[side]} | _columns(records)
            _place(columns, outs[side], _write_csv if to == "csv" else _write_parquet)
            lines.append(f"{outs[side]}: {len(records)} rows, {len(columns)} columns")
    except OSError as error:
        raise ExportError(f"{target}: cannot be written: {error.strerror or error}") from None
    return lines


def _place(
    columns: dict[str, NDArray[Any]], path: Path, write: Callable[[dict[str, NDArray[Any]], Path], None]
) -> None:
    """Write to a temporary name, then rename, so that no part of a table can remain."""
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        write(columns, draft)
        draft.rename(path)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise


def _read(paths: Sequence[Path]) -> tuple[list[Any], Any]:
    need("mcap", "recording", str(paths[0]))
    from weberlink.system.scoring.recorded import put_together  # noqa: PLC0415 - reads with an optional library
    from weberlink.telemetry.recording.reader import RecordingError, read_recording  # noqa: PLC0415

    try:
        recordings = [read_recording(path) for path in paths]
        return recordings, put_together(recordings)
    except RecordingError as error:
        raise ConfigurationError(str(error)) from None


def _date(recording: Any) -> str | None:
    """Start on the wall clock; None for virtual time."""
    if recording.facts.get("clock") == "virtual" or not recording.origins:
        return None
    began = min(origin.wall_s for origin in recording.origins.values())
    return datetime.fromtimestamp(began, UTC).isoformat(timespec="milliseconds")


def _file_line(file: dict[str, Any]) -> str:
    sides = ", ".join(f"{side} {count} records" for side, count in file["records"].items())
    lost = sum(file["lost"].values())
    parts = [
        f"{file['path']}: {sides}",
        f"{file['bytes'] / 1e6:.1f} MB",
        f"began {file['began']}" if file["began"] else f"{file['clock']} time",
        _ended(file),
    ]
    return ", ".join(parts + ([f"{lost} records lost"] if lost else []))


def _ended(file: dict[str, Any]) -> str:
    if file["complete"]:
        return "whole"
    if file["outcome"] == "complete":
        return "not whole"  # the number of lost records is shown beside it
    outcome: str = file["outcome"]
    return outcome


def _columns(records: Records) -> dict[str, NDArray[Any]]:
    """Flat columns; a vector becomes three, named by axis."""
    columns: dict[str, NDArray[Any]] = {}
    for name in records.dtype.names or ():
        if records[name].ndim == 1:
            columns[name] = records[name]
        else:
            columns |= {f"{name}_{axis}": records[name][:, index] for index, axis in enumerate(AXES)}
    return columns


def _write_csv(columns: dict[str, NDArray[Any]], path: Path) -> None:
    """Write numbers with enough digits to read the same ones back; unknown ones as `nan`."""
    with path.open("x", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for first in range(0, len(next(iter(columns.values()))), BLOCK_ROWS):
            block = [column[first : first + BLOCK_ROWS].tolist() for column in columns.values()]
            writer.writerows(zip(*block, strict=True))


def _write_parquet(columns: dict[str, NDArray[Any]], path: Path) -> None:
    import pyarrow  # noqa: PLC0415
    import pyarrow.parquet  # noqa: PLC0415

    table = pyarrow.table({name: np.ascontiguousarray(column) for name, column in columns.items()})
    pyarrow.parquet.write_table(table, path)
