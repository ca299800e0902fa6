"""Recorded teleoperation signals: positions and forces over time, read from CSV or from a recording of a session."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from math import isfinite
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

COLUMNS = ("t", "px", "py", "pz", "fx", "fy", "fz")
MCAP_MAGIC = b"\x89MCAP0\r\n"
FEWEST_ROWS = 2
BEYOND = 1e12
"""No time, position or force of a recording is this large in SI units; squares of what is below can be summed up."""
GAP_FACTOR = 5.0

Array = NDArray[np.float64]


class TraceError(ValueError):
    """The file is not a trace; one line says where and what was expected."""


@dataclass(frozen=True, slots=True)
class Trace:
    """A recording.

    Args:
        time_s: Strictly increasing, shape (n,) [s]. position_m: Commanded or measured positions, shape (n, 3) [m].
        force_n: Contact forces, shape (n, 3) [N]. gaps_s: Where sampling paused for more than five median periods,
        shape (g, 2): the time of the last sample before the
            gap, and its length [s].
    """

    time_s: Array
    position_m: Array
    force_n: Array
    gaps_s: Array

    @property
    def duration_s(self) -> float:
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def period_s(self) -> float:
        """Median time between samples."""
        return float(np.median(np.diff(self.time_s)))


def read_trace(path: Path | str) -> Trace:
    """What the teleoperator was commanded and felt.

    Reads a CSV file whose header names t, px, py, pz, fx, fy, fz, in any order (other columns are ignored), or an MCAP
    recording that has the slave's side (extra: recording).

    Raises:
        TraceError: With file, row (the header is row 1), column, and what was expected.
    """
    return _read(Path(path), ("slave",))


def read_motion(path: Path | str) -> Trace:
    """What the operator did: the motion of the device, or of the robot where a recording has the slave's side alone.

    A CSV file is taken as it is.

    Raises:
        TraceError: As of `read_trace`.
    """
    return _read(Path(path), ("master", "slave"))


def _check_regular(path: Path) -> None:
    """A pipe or a device may never end, and is read more than once here."""
    try:
        is_other = path.exists() and not path.is_file() and not path.is_dir()
    except OSError as error:  # a name that no file can have
        raise TraceError(f"{path}: cannot be read: {error.strerror}") from None
    if is_other:
        raise TraceError(f"{path}: is no regular file; expected a trace")


def _read(path: Path, sides: tuple[Literal["master", "slave"], ...]) -> Trace:
    _check_regular(path)
    if is_recording(path):
        if find_spec("mcap") is None:
            raise TraceError(f'{path}: reading it needs mcap; install it with: pip install "weberlink[recording]"')
        from weberlink.master.recorded import table_of  # noqa: PLC0415 - an optional library

        return as_trace(table_of(path, sides))
    columns = positions_in_header(path)
    table = numbers(path, columns)
    if table is None:
        raise TraceError(first_fault(path, columns))
    return checked(path, table)


def is_recording(path: Path) -> bool:
    """Whether a file says that it is MCAP, by its name or its first bytes."""
    if path.suffix.lower() == ".mcap":
        return True
    try:
        with path.open("rb") as file:
            return file.read(len(MCAP_MAGIC)) == MCAP_MAGIC
    except OSError:
        return False


def numbers(path: Path, columns: list[int]) -> Array | None:
    """All rows at once, shape (n, 7); None where anything is not a finite number, or there is no row."""
    try:
        if next(data_rows(path), None) is None:
            return None
        table = np.loadtxt(path, delimiter=",", skiprows=1, usecols=columns, ndmin=2, comments=None, encoding="utf-8")
    except (ValueError, OSError, csv.Error):
        return None
    return table if (np.abs(table) < BEYOND).all() else None


def checked(path: Path, table: Array) -> Trace:
    time = table[:, 0]
    if len(time) < FEWEST_ROWS:
        raise TraceError(f"{path}: expected at least {FEWEST_ROWS} rows of samples, found {len(time)}")
    steps = np.diff(time)
    if not (steps > 0.0).all():
        index = int(np.argmax(steps <= 0.0)) + 1
        row = line_numbers(path)[index]
        raise TraceError(
            f"{path}: row {row}, column t: expected a time after {time[index - 1]:.9g} s, found {time[index]:.9g} s"
        )
    return as_trace(table)


def as_trace(table: Array) -> Trace:
    """Rows of time, position and force, shape (n, 7), the time strictly rising."""
    time = table[:, 0]
    steps = np.diff(time)
    paused = np.flatnonzero(steps > GAP_FACTOR * np.median(steps))
    gaps = np.column_stack((time[paused], steps[paused]))
    return Trace(time.copy(), table[:, 1:4].copy(), table[:, 4:7].copy(), gaps)


def positions_in_header(path: Path) -> list[int]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            header = next(csv.reader(file), None)
    except FileNotFoundError:
        raise TraceError(f"{path}: not found") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise TraceError(f"{path}: expected a readable CSV file ({error})") from None
    names = [name.strip() for name in header or ()]
    if not any(names):
        raise TraceError(f"{path}: row 1: expected the header {','.join(COLUMNS)}, found nothing")
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        raise TraceError(f"{path}: row 1: missing column {', '.join(missing)}; expected {','.join(COLUMNS)}")
    repeated = [name for name in COLUMNS if names.count(name) > 1]
    if repeated:
        raise TraceError(f"{path}: row 1: column {', '.join(repeated)} appears more than once")
    return [names.index(name) for name in COLUMNS]


def first_fault(path: Path, columns: list[int]) -> str:
    """Goes through a file that the fast reader refused, row by row, for the first thing wrong with it."""
    try:
        for number, cells in data_rows(path):
            for name, column in zip(COLUMNS, columns, strict=True):
                if column >= len(cells):
                    return f"{path}: row {number}, column {name}: expected a number, found only {len(cells)} values"
                text = cells[column].strip()
                try:
                    value = float(text)
                except ValueError:
                    return f"{path}: row {number}, column {name}: expected a number, found {text!r}"
                if not abs(value) < BEYOND:
                    expected = f"less than {BEYOND:g} in SI units" if isfinite(value) else "a finite number"
                    return f"{path}: row {number}, column {name}: expected {expected}, found {text!r}"
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        return f"{path}: expected a readable CSV file ({error})"
    if next(data_rows(path), None) is None:
        return f"{path}: expected at least {FEWEST_ROWS} rows of samples, found none"
    return f"{path}: expected numbers with commas between them and no quotes"


def data_rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    with path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.reader(file)
        next(reader, None)
        for cells in reader:
            if any(cell.strip() for cell in cells):
                yield reader.line_num, cells


def line_numbers(path: Path) -> list[int]:
    return [number for number, _ in data_rows(path)]
