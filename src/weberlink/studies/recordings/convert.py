"""Make the shipped recordings from checkouts of their public sources.

    python -m weberlink.studies.recordings.convert SOURCE CHECKOUT [--out DIR]

converts every file of a source, writes each as CSV (header t,px,py,pz,fx,fy,fz, SI units), and says which of them is
which shipped recording and how far the two differ. A recording is recognised by its positions. Nothing is filtered.

How sure each conversion is (the shipped files were converted before this script was written, and the sources could not
be downloaded where it was written, so it has never run on a whole checkout):

`omega3`: the last rows of omega3_3 (user_study/01/*_vsds_1) were compared with the text of the source.
`ochoa_polish`: the last rows of both recordings (mold_data/pattern and pattern_x) were.
`stroke_iiwa_teleop`: the columns are those that the source's ImpedanceLearning/Binary2Text.py documents; the sign of
    the force is unverified.
`panda_comanip`: the fields are those of the source's README. That a lost sample repeats the position before it, and so
    is left out, is a guess from the shipped times.
`tue`: the fields are those that the source's plotLog.m reads. How the constant offset of the force was found is not
    known; here it is the median. The .mat files are binary and were never seen.
"""

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.master.trace import COLUMNS
from weberlink.studies.recordings.catalogue import SOURCES, load, names

Array = NDArray[np.float64]
LONGEST = 15_000
"""Samples of an omega3 recording at 1 kHz; longer ones were cut."""
STROKE_COLUMNS = (21, 45)
"""Numbers of columns of the source's binary files; the first ten are time, force, torque and position."""
FAR_M = 10.0
"""No hand or arm is this far away; the last numbers of some files of omega3 are uninitialised memory."""
ALIKE_M = 1e-6
"""Difference of the positions up to which a converted file is a shipped recording."""


class Converted(NamedTuple):
    """A file of a source and its table: time [s], position [m], force [N], shape (n, 7)."""

    file: Path
    table: Array


def converted(source: str, checkout: Path) -> Iterator[Converted]:
    """The recordings of a checkout.

    Raises:
        KeyError: there is no such source.
    """
    return CONVERSIONS[source](checkout)


def _omega3(checkout: Path) -> Iterator[Converted]:
    """Position and commanded force at 500 Hz as text; the force has two components, in y and z."""
    for file in sorted(checkout.glob("Data_Analysis/01_Implementation/user_study/*/*_hd_real.txt")):
        position = np.array(file.read_text().split(), float)
        position = position[: len(position) // 3 * 3].reshape(-1, 3)
        real = (np.abs(position) < FAR_M).all(axis=1) & (position != 0.0).any(axis=1)
        commanded = np.loadtxt(file.with_name(file.name.replace("_hd_real", "_control_force")), ndmin=2)
        count = min(len(commanded), int(np.argmin(real)) if not real.all() else len(real))
        force = np.column_stack((np.zeros(count), commanded[:count]))
        both = np.hstack((position[:count], force))
        between = np.empty((2 * count - 2, 6))
        between[0::2], between[1::2] = both[:-1], (both[:-1] + both[1:]) / 2.0
        yield Converted(file, _timed(between[:LONGEST], 1e-3))


def _ochoa_polish(checkout: Path) -> Iterator[Converted]:
    """Text with two header rows: t, position, quaternion, force in the tool's frame, force in the base frame."""
    for file in sorted(checkout.glob("franka_polishing/mold_data/pattern*")):
        rows = np.loadtxt(file, skiprows=2, ndmin=2)
        yield Converted(file, np.column_stack((rows[:, 0] - rows[0, 0], rows[:, 1:4], -rows[:, 11:14])))


def _stroke(checkout: Path) -> Iterator[Converted]:
    """Binary rows of time, force, torque, position and more, every 5 ms."""
    for file in sorted(checkout.glob("Data/Parkour/**/RobotData_*.bin")):
        numbers = np.fromfile(file, "<f8")
        for columns in STROKE_COLUMNS:
            if len(numbers) % columns == 0:
                rows = numbers.reshape(-1, columns)
                if (np.diff(rows[:, 0]) > 0.0).all():
                    yield Converted(file, _timed(np.hstack((rows[:, 7:10], rows[:, 1:4])), 5e-3))
                    break


def _panda(checkout: Path) -> Iterator[Converted]:
    """Six recordings in each file, on a grid of 1 ms."""
    for file in sorted(checkout.glob("Panda_CoManipulation_Data/*/symbol_data.mat")):
        for one in _matlab(file)["symbol_data"].ravel():
            position, force = np.asarray(one.pos, float).T, np.asarray(one.F, float).T
            table = _timed(np.hstack((position, force)), 1e-3)
            arrived = np.append(True, (np.diff(position, axis=0) != 0.0).any(axis=1))
            yield Converted(file, table[arrived])


def _tue(checkout: Path) -> Iterator[Converted]:
    """A scope at 2 kHz: position of the robot in signal 1, its force in signal 3."""
    for file in sorted(checkout.glob("m[12]_question1/*.mat")):
        scope = _matlab(file)["scope"]
        signals = np.ravel(scope.signals)
        position, force = (np.atleast_2d(np.asarray(signals[place].values, float).T)[0] for place in (0, 2))
        pairs = len(position) // 2
        means = [one[: 2 * pairs].reshape(pairs, 2).mean(axis=1) for one in (position, force)]
        along = np.zeros((pairs, 6))
        along[:, 2], along[:, 5] = means[0], np.median(means[1]) - means[1]
        yield Converted(file, _timed(along, 1e-3))


CONVERSIONS: dict[str, Callable[[Path], Iterator[Converted]]] = {
    "tue": _tue,
    "omega3": _omega3,
    "ochoa_polish": _ochoa_polish,
    "panda_comanip": _panda,
    "stroke_iiwa_teleop": _stroke,
}


def recognised(table: Array, candidates: Iterable[str]) -> str | None:
    """The shipped recording that has the positions of a table, as far as both go; None if none has."""
    for name in candidates:
        shipped = load(name)
        count = min(len(table), len(shipped.time_s))
        if count > 1 and np.abs(table[:count, 1:4] - shipped.position_m[:count]).max() < ALIKE_M:
            return name
    return None


def difference_n(table: Array, name: str) -> float:
    """Largest difference of the forces of a table and of a shipped recording [N]."""
    force = load(name).force_n
    count = min(len(table), len(force))
    return float(np.abs(table[:count, 4:7] - force[:count]).max())


def main(arguments: list[str] | None = None) -> int:
    """Convert a checkout; the exit status says whether every shipped recording of the source was found."""
    parser = argparse.ArgumentParser(prog="python -m weberlink.studies.recordings.convert")
    parser.add_argument("source", choices=tuple(SOURCES))
    parser.add_argument("checkout", type=Path, help="a checkout of the source's repository")
    parser.add_argument("--out", type=Path, help="folder of the CSV files")
    given = parser.parse_args(arguments)
    missing = list(names(given.source))
    for number, (file, table) in enumerate(converted(given.source, given.checkout), start=1):
        name = recognised(table, missing)
        path = file.relative_to(given.checkout)
        if name is None:
            sys.stdout.write(f"{path}: {len(table)} samples, not shipped\n")
        else:
            missing.remove(name)
            sys.stdout.write(f"{path}: {name}, forces differ by up to {difference_n(table, name):.3g} N\n")
        if given.out is not None:
            given.out.mkdir(parents=True, exist_ok=True)
            stem = name or f"{given.source}_file_{number}"
            np.savetxt(given.out / f"{stem}.csv", table, "%.10g", ",", header=",".join(COLUMNS), comments="")
    if missing:
        sys.stderr.write(f"not found in {given.checkout}: {', '.join(missing)}\n")
    return 1 if missing else 0


def _timed(table: Array, period_s: float) -> Array:
    """The table with a regular time in front."""
    return np.column_stack((np.arange(len(table)) * period_s, table))


def _matlab(file: Path) -> dict[str, Any]:
    from scipy.io import loadmat  # noqa: PLC0415 - an extra

    found: dict[str, Any] = loadmat(file, squeeze_me=True, struct_as_record=False)
    return found


if __name__ == "__main__":
    sys.exit(main())
