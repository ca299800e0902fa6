"""Recorded signals for the studies: the shipped one, and files, each with a name of its own."""

from collections import Counter
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from weberlink.master.trace import Trace, TraceError, read_trace
from weberlink.system.configuration import ConfigurationError

SHIPPED = Path(str(files("weberlink.configs") / "traces" / "operator.csv"))
"""The recording that is part of the package."""


class NamedTrace(NamedTuple):
    """A trace and its name in the rows."""

    name: str
    trace: Trace


def read_traces(paths: Sequence[Path]) -> list[NamedTrace]:
    """Read traces and give each a different name.

    Raises:
        ConfigurationError: a trace cannot be used, or is listed twice.
    """
    seen: set[Path] = set()
    for path in paths:
        if path.resolve() in seen:
            raise ConfigurationError(f"{path}: listed twice, and would count twice in every mean")
        seen.add(path.resolve())
    try:
        return [NamedTrace(name, read_trace(path)) for name, path in zip(names(paths), paths, strict=True)]
    except TraceError as error:
        raise ConfigurationError(str(error)) from None


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
