"""What a trace is called in its rows: short, and never as another."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path


def names(paths: Sequence[Path]) -> list[str]:
    """A name for each of several different files, all different: the stem, or where that is not enough, more of it.

    Of files that share a stem it is as many folders before it as tell them apart, and the suffix where only that does.
    """
    absolute = [path.resolve() for path in paths]
    stems = Counter(path.stem for path in absolute)
    found = [path.stem if stems[path.stem] == 1 else _among(path, absolute) for path in absolute]
    # A stem may look like another file's name with suffix.
    return found if len(set(found)) == len(found) else [str(path) for path in absolute]


def _among(path: Path, others: Sequence[Path]) -> str:
    alike = [other for other in others if other.stem == path.stem]
    for depth in range(1, max(len(other.parts) for other in alike) + 1):
        for of in (_without_suffix, _whole):
            candidates = [of(other, depth) for other in alike]
            if len(set(candidates)) == len(candidates):
                return of(path, depth)
    return str(path)


def _without_suffix(path: Path, depth: int) -> str:
    return "/".join(path.with_suffix("").parts[-depth:])


def _whole(path: Path, depth: int) -> str:
    return "/".join(path.parts[-depth:])
