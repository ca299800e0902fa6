"""Recorded teleoperation signals: positions and forces over time, from CSV, npz or a recording of a session."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from weberlink.protocol.states import State
from weberlink.telemetry.record import FORCE

COLUMNS = ("t", "px", "py", "pz", "fx", "fy", "fz")
MCAP_MAGIC = b"\x89MCAP0\r\n"
FEWEST_ROWS = 2
LIMIT = 1e12  # times, positions and forces in SI units must be smaller; squares of such values can be summed
LARGEST_ARRAYS = 1 << 30  # bytes of an npz file when unpacked: five hours at 1 kHz

Array = NDArray[np.float64]
Side = Literal["master", "slave"]

# Position and force of each side: commanded and measured of the robot, measured and displayed of the device.
SIGNALS = {"slave": ("output", "raw"), "master": ("position", "output")}


class TraceError(ValueError):
    """The file is not a trace; one line says where and what was expected."""


@dataclass(frozen=True, slots=True)
class Trace:
    """A recorded signal: times [s], strictly rising, shape (n,); positions [m] and forces [N], shape (n, 3)."""

    time_s: Array
    position_m: Array
    force_n: Array

    @property
    def duration_s(self) -> float:
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def period_s(self) -> float:
        """Median time between samples."""
        return float(np.median(np.diff(self.time_s)))


def read_trace(path: Path | str, factors: Array | float = 1.0) -> Trace:
    """Read what the teleoperator was commanded and felt.

    The file is CSV with a header of t, px, py, pz, fx, fy, fz in any order (other columns are ignored), an npz file
    with an array of each of these names, or a recording, in SI units, that has the slave's side. `factors` turn a row
    of the first two into SI units. Raises TraceError with file, row (the header is row 1), column, and what was
    expected.
    """
    return _read(Path(path), ("slave",), factors)


def read_motion(path: Path | str) -> Trace:
    """Read what the operator did: the motion of the device, or of the robot in a recording of the slave's side alone;
    raises TraceError as for `read_trace`.
    """
    return _read(Path(path), ("master", "slave"))


def as_trace(table: Array) -> Trace:
    """From rows of time, position and force, shape (n, 7), the time strictly rising."""
    return Trace(table[:, 0].copy(), table[:, 1:4].copy(), table[:, 4:7].copy())


def _read(path: Path, sides: Sequence[Side], factors: Array | float = 1.0) -> Trace:
    try:
        # A pipe or a device may never end.
        if path.exists() and not path.is_file() and not path.is_dir():
            raise TraceError(f"{path}: is no regular file; expected a trace")
        with path.open("rb") as file:
            begins = file.read(len(MCAP_MAGIC))
    except FileNotFoundError:
        raise TraceError(f"{path}: not found") from None
    except OSError as error:
        raise TraceError(f"{path}: cannot be read: {error.strerror}") from None
    if path.suffix.lower() == ".mcap" or begins == MCAP_MAGIC:
        return as_trace(_recorded(path, sides))
    table, numbers = _arrays(path) if path.suffix.lower() == ".npz" else _numbers(path)
    time = table[:, 0]
    if len(time) < FEWEST_ROWS:
        raise TraceError(f"{path}: expected at least {FEWEST_ROWS} rows of samples, found {len(time)}")
    falling = np.diff(time) <= 0.0
    if falling.any():
        last = int(np.argmax(falling))
        raise TraceError(
            f"{path}: row {numbers[last + 1]}, column t: expected a time after {time[last]:.9g}, "
            f"found {time[last + 1]:.9g}"
        )
    return as_trace(table * factors)


def _recorded(path: Path, sides: Sequence[Side]) -> Array:
    """Rows of one side while it was engaged, shape (n, 7), the time from 0; of the first of `sides` that is there."""
    from weberlink.telemetry.recorders import format_of  # noqa: PLC0415 - for recordings alone

    try:
        recording = format_of(path, f"{path}: reading recordings").read(path)
    except ValueError as error:
        raise TraceError(str(error)) from None
    side = next((side for side in sides if len(recording.records.get(side, ()))), None)
    if side is None:
        held = ", ".join(recording.records) or "neither"
        raise TraceError(f"{path}: expected the {sides[0]}'s side of a session, found {held}")
    records = recording.records[side]
    lacks = {*SIGNALS[side], "at", "state"} - set(records.dtype.names or ())
    if lacks:
        raise TraceError(f"{path}: the {side}'s records lack {', '.join(sorted(lacks))}")
    position, force = SIGNALS[side]
    if recording.joints:
        raise TraceError(f"{path}: holds the angles and torques of arms, expected a session in Cartesian space")
    engaged = records[records["state"] == State.ENGAGED.value]
    signals = np.column_stack((engaged[position][:, FORCE], engaged[force][:, FORCE]))
    usable = np.isfinite(signals).all(axis=1)
    engaged, signals = engaged[usable], signals[usable]
    if len(engaged) < FEWEST_ROWS:
        raise TraceError(f"{path}: expected at least {FEWEST_ROWS} ticks of an engaged session, found {len(engaged)}")
    if not (np.diff(engaged["at"]) > 0.0).all():
        raise TraceError(f"{path}: the time of the {side}'s ticks does not rise; the recording is damaged")
    return np.column_stack((engaged["at"] - engaged["at"][0], signals))


def _arrays(path: Path) -> tuple[Array, Sequence[int]]:
    """The rows of an npz file, shape (n, 7), and their numbers."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as held:  # np.load leaves a damaged file open
            if sum(entry.file_size for entry in held.zip.infolist()) > LARGEST_ARRAYS:
                raise ValueError(f"it unpacks to more than {LARGEST_ARRAYS} bytes")  # noqa: TRY301
            table = np.array([held[name] for name in COLUMNS], dtype=np.float64).T
    except Exception as error:  # zipfile, zlib and numpy have many for a damaged file
        why = " ".join(str(error).split())
        raise TraceError(
            f"{path}: expected an npz file with arrays {','.join(COLUMNS)} of one length ({why})"
        ) from None
    if table.ndim != 2 or not (np.abs(table) < LIMIT).all():
        raise TraceError(
            f"{path}: expected arrays {','.join(COLUMNS)} of finite numbers less than {LIMIT:g} in SI units"
        )
    return table, range(1, len(table) + 1)


def _numbers(path: Path) -> tuple[Array, Sequence[int]]:
    """The rows of a CSV file, shape (n, 7), and the numbers of their lines."""
    numbers, rows = list[int](), list[list[float]]()
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            columns = _columns(path, [name.strip() for name in next(reader, ())])
            for cells in reader:
                if any(cell.strip() for cell in cells):
                    numbers.append(reader.line_num)
                    rows.append([_number(path, reader.line_num, cells, name, column) for name, column in columns])
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise TraceError(f"{path}: expected a readable CSV file ({error})") from None
    return np.array(rows).reshape(-1, len(COLUMNS)), numbers


def _columns(path: Path, names: list[str]) -> list[tuple[str, int]]:
    """Each of `COLUMNS`, and its index among the names of the header."""
    wanted = ",".join(COLUMNS)
    if not any(names):
        raise TraceError(f"{path}: row 1: expected the header {wanted}, found nothing")
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        raise TraceError(f"{path}: row 1: missing column {', '.join(missing)}; expected {wanted}")
    repeated = [name for name in COLUMNS if names.count(name) > 1]
    if repeated:
        raise TraceError(f"{path}: row 1: column {', '.join(repeated)} appears more than once")
    return [(name, names.index(name)) for name in COLUMNS]


def _number(path: Path, row: int, cells: list[str], name: str, column: int) -> float:
    at = f"{path}: row {row}, column {name}"
    if column >= len(cells):
        raise TraceError(f"{at}: expected a number, found only {len(cells)} values")
    text = cells[column].strip()
    try:
        value = float(text)
    except ValueError:
        raise TraceError(f"{at}: expected a number, found {text!r}") from None
    if not abs(value) < LIMIT:
        expected = f"less than {LIMIT:g} in SI units" if isfinite(value) else "a finite number"
        raise TraceError(f"{at}: expected {expected}, found {text!r}")
    return value
