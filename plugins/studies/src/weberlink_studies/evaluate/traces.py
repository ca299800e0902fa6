"""Recorded signals for the studies: files and shipped recordings, each with a name of its own and a source."""

from collections import Counter
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from weberlink.config import ConfigurationError
from weberlink.master.trace import Trace, TraceError, read_trace
from weberlink_studies import recordings
from weberlink_studies.evaluate.units import FORCE_UNITS, LENGTH_UNITS, SI, TIME_UNITS, Units, unlikely_units

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
            candidates = {other: _tail(other, depth, with_suffix=with_suffix) for other in alike}
            if len(set(candidates.values())) == len(alike):
                return candidates[path]
    return str(path)


def _tail(path: Path, depth: int, *, with_suffix: bool) -> str:
    return "/".join((path if with_suffix else path.with_suffix("")).parts[-depth:])
