"""Recorded signals for the studies: files in their units and shipped recordings, each with a name and a source."""

from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.config import ConfigurationError
from weberlink.master.trace import Trace, TraceError, read_trace
from weberlink_studies import recordings

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
LENGTH_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
FORCE_UNITS = {"N": 1.0, "mN": 1e-3, "kN": 1e3}
FARTHEST_M = 5.0  # positions beyond this are more likely in another unit: hands and arms reach less
SLOWEST_S = 0.5  # A period of sampling beyond this is more likely in another unit: nobody feels at 2 Hz
STRONGEST_N = 2000.0


class Units(NamedTuple):
    """Units of the columns of a CSV file, by their symbols."""

    position: str = "m"
    time: str = "s"
    force: str = "N"

    @property
    def factors(self) -> NDArray[np.float64]:
        """What turns a row of `weberlink.master.trace.COLUMNS` into SI units."""
        time, position, force = TIME_UNITS[self.time], LENGTH_UNITS[self.position], FORCE_UNITS[self.force]
        return np.array([time, *[position] * 3, *[force] * 3])


SI = Units()


def unlikely_units(trace: Trace) -> tuple[str, Units] | None:
    """What in a trace cannot be in SI units, in words, and the units in which it would be plausible; None if all can.

    Where even the smallest unit would not do, that one is named.
    """
    reach, strongest = float(np.abs(trace.position_m).max()), float(np.linalg.norm(trace.force_n, axis=1).max())
    seen, units = [], SI
    if reach > FARTHEST_M:
        seen.append(f"positions reach {reach:.4g} m")
        units = units._replace(position=_fitting(reach, FARTHEST_M, ("mm", "um"), LENGTH_UNITS))
    if trace.period_s > SLOWEST_S:
        seen.append(f"samples are {trace.period_s:.4g} s apart")
        units = units._replace(time=_fitting(trace.period_s, SLOWEST_S, ("ms", "us", "ns"), TIME_UNITS))
    if strongest > STRONGEST_N:
        seen.append(f"forces reach {strongest:.4g} N")
        units = units._replace(force="mN")
    return (" and ".join(seen), units) if seen else None


def _fitting(value: float, most: float, symbols: Sequence[str], factors: Mapping[str, float]) -> str:
    return next((symbol for symbol in symbols if value * factors[symbol] <= most), symbols[-1])


SHIPPED = Path(str(files("weberlink.configs") / "traces" / "operator.npz"))
"""The recording that is part of the configurations."""
ALL = "recordings"  # stands for every shipped recording
FILES = "files"  # source of what was read from files


class NamedTrace(NamedTuple):
    """A trace, its name in the rows, and where it comes from: a source of shipped recordings, or `FILES`."""

    name: str
    trace: Trace
    source: str = FILES


def units_of(text: str) -> Units:
    """Units from their symbols with commas between them, such as "mm,ms"; SI units for what is not named."""
    tables = {"time": TIME_UNITS, "position": LENGTH_UNITS, "force": FORCE_UNITS}
    found: dict[str, str] = {}
    for symbol in (part.strip() for part in text.split(",")):
        quantity = next((name for name, table in tables.items() if symbol in table), None)
        if quantity is None:
            known = ", ".join(symbol for table in tables.values() for symbol in table)
            raise ConfigurationError(f"--units: {symbol!r} is none of {known}")
        if quantity in found:
            raise ConfigurationError(f"--units: {found[quantity]} and {symbol} are both units of {quantity}")
        found[quantity] = symbol
    return Units(**found)


def read_traces(given: Sequence[Path], units: Units | None = None) -> list[NamedTrace]:
    """Read traces and give each a different name.

    Args:
        units: of the CSV files; None for SI units, which are checked for plausibility then.
        given: files; or, where there is no such file, names of shipped recordings, the first words of such names
            (`tue_rigid` for `tue_rigid_1` and others, `tue` for all of that source), or `ALL`.
    """
    paths: list[Path] = []
    seen: set[Path | str] = set()
    for path in given:
        listed = _shipped(path)
        for each in (path.resolve(),) if listed is None else listed:
            if each in seen:
                told = path if listed is None else each
                raise ConfigurationError(f"{told}: listed twice, and would count twice in every mean")
            seen.add(each)
        if listed is None:
            paths.append(path)
    try:
        read = {path: _read(path, units) for path in paths}
    except TraceError as error:
        known = f"; shipped recordings: {ALL}, {', '.join(recordings.SOURCES)}" if "not found" in str(error) else ""
        raise ConfigurationError(f"{error}{known}") from None
    named = {
        path: str(path.resolve()) if name in seen else name for name, path in zip(names(paths), paths, strict=True)
    }
    found = []
    for path in given:
        listed = _shipped(path)
        if listed is None:
            found.append(NamedTrace(named[path], read[path]))
        else:
            found += [NamedTrace(name, recordings.load(name), recordings.source_of(name).name) for name in listed]
    return found


def _read(path: Path, units: Units | None) -> Trace:
    trace = read_trace(path, (units or SI).factors)
    doubt = None if units is not None else unlikely_units(trace)
    if doubt is not None:
        seen, others = doubt
        meant = ",".join(other for other, si in zip(others, SI, strict=True) if other != si)
        stated = ",".join(si for other, si in zip(others, SI, strict=True) if other != si)
        raise ConfigurationError(
            f"{path}: {seen}: in which units is it? Add --units {meant}, or --units {stated} if it is so"
        )
    return trace


def _shipped(path: Path) -> Sequence[str] | None:
    """The shipped recordings that an argument stands for; None if it is a file, or neither."""
    text = str(path)
    if path.exists():
        return None
    if text == ALL:
        return recordings.names()
    return [name for name in recordings.names() if name == text or name.startswith(f"{text}_")] or None


def names(paths: Sequence[Path]) -> list[str]:
    """A different name for each of several different files: the stem, or more where that is not enough.

    Files of one stem get as many parent folders as needed to tell them apart, and the suffix where only that differs.
    """
    absolute = [path.resolve() for path in paths]
    stems = Counter(path.stem for path in absolute)
    found = [path.stem if stems[path.stem] == 1 else _name_among(path, absolute) for path in absolute]
    # A stem may equal the name of another file with its suffix.
    return found if len(set(found)) == len(found) else [str(path) for path in absolute]


def _name_among(path: Path, others: Sequence[Path]) -> str:
    alike = [other for other in others if other.stem == path.stem]
    for depth in range(1, max(len(other.parts) for other in alike) + 1):
        for with_suffix in (False, True):
            candidates = {
                other: "/".join((other if with_suffix else other.with_suffix("")).parts[-depth:]) for other in alike
            }
            if len(set(candidates.values())) == len(alike):
                return candidates[path]
    return str(path)
