"""The Weber factor at which a codec sends so many packets. Knows neither codec nor signal."""

from collections.abc import Callable
from math import exp, log, sqrt
from typing import NamedTuple, Protocol, TypeVar


class Counted(Protocol):
    """What a run leaves behind."""

    @property
    def packets(self) -> int: ...


Run = TypeVar("Run", bound=Counted)

TOLERANCE = 0.02
"""Of the number of packets, which counts as equal."""
RUNS = 8
"""At most, unless something else is said."""
UNFAIR = 2.0
"""A packet too many counts for so many too few: what is compared must not have more."""
LEAST, MOST = 1e-3, 0.8
"""Weber factors that are tried."""


class _Point(NamedTuple):
    weber: float
    packets: int


def equal_packets(target: int, run: Callable[[float], Run], first: float, runs: int = RUNS) -> tuple[float, Run]:
    """The run that sends most nearly `target` packets, and its Weber factor.

    Regula falsi in the logarithms of both, with a bisection every other time: packets fall with the Weber factor, but
    in steps and not everywhere. If that takes more than `runs` runs, the nearest of them counts, in doubt the one
    that sends less.

    Args:
        target: at least 0.
        run: what codes with a Weber factor.
        first: the factor to begin with.
        runs: at most.
    """
    more: _Point | None = None
    fewer: _Point | None = None
    weber = first
    best: tuple[float, float, Run] | None = None
    for count in range(runs):
        found = run(weber)
        away = abs(found.packets - target)
        doubt = UNFAIR * away if found.packets > target else away
        if best is None or doubt < best[0]:
            best = doubt, weber, found
        if away <= TOLERANCE * target:
            break
        if found.packets > target:
            more = _Point(weber, found.packets)
        else:
            fewer = _Point(weber, found.packets)
        tried, weber = weber, _next(more, fewer, target, bisect=count % 2 == 1)
        if weber == tried:
            break
    assert best is not None
    return best[1], best[2]


def _next(more: _Point | None, fewer: _Point | None, target: int, *, bisect: bool) -> float:
    if more is None or fewer is None:
        near = more or fewer
        assert near is not None
        # Packets fall about as one over the factor; a little further, so that the other side is found.
        ratio = float((max(near.packets, 1) / max(target, 1)) ** 1.2)
        return min(MOST, max(LEAST, near.weber * min(3.0, max(1.0 / 3.0, ratio))))
    if bisect or fewer.packets < 1 or target < 1 or more.packets <= fewer.packets:
        return sqrt(more.weber * fewer.weber)
    share = (log(more.packets) - log(target)) / (log(more.packets) - log(fewer.packets))
    return exp(log(more.weber) + min(0.9, max(0.1, share)) * (log(fewer.weber) - log(more.weber)))
