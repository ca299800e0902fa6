"""Whether something grows: a straight line through samples, by least squares, and how sure its slope is.

Samples of several lives of a process share one slope, each life has its own level. Memory changes in steps, so samples
close in time say the same thing twice: they are averaged over blocks, and the uncertainty comes from the blocks.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt

WARM_UP_S = 20.0
"""Of each life: caches fill and are no growth [s]."""
BLOCK_S = 30.0
SURE = 2.0
"""Standard deviations by which a slope must exceed its bound."""
_FEWEST_BLOCKS = 6
_HOUR = 3600.0


@dataclass(frozen=True)
class Growth:
    """A slope per hour and its standard deviation, in the unit of the samples."""

    per_hour: float
    uncertainty: float
    samples: int

    def exceeds(self, bound: float) -> bool:
        """Whether the slope is above the bound beyond doubt."""
        return self.per_hour - SURE * self.uncertainty > bound


def fit(lives: Sequence[Sequence[tuple[float, float]]], *, warm_up: float = WARM_UP_S) -> Growth | None:
    """The common slope of several lives; None where there is too little to tell.

    Args:
        lives: (time [s], value) of each, in order of time; the first sample of a life is its beginning.
    """
    square = product = 0.0
    centred: list[tuple[float, float]] = []
    groups = 0
    for life in lives:
        blocks = _blocks(life, warm_up)
        if len(blocks) < 2:
            continue
        groups += 1
        at, level = (sum(column) / len(blocks) for column in zip(*blocks, strict=True))
        centred += [(when - at, value - level) for when, value in blocks]
    freedom = len(centred) - groups - 1
    if len(centred) < _FEWEST_BLOCKS or freedom < 1:
        return None
    for when, value in centred:
        square += when * when
        product += when * value
    slope = product / square
    residual = sum((value - slope * when) ** 2 for when, value in centred)
    return Growth(slope * _HOUR, sqrt(residual / freedom / square) * _HOUR, len(centred))


def _blocks(life: Sequence[tuple[float, float]], warm_up: float) -> list[tuple[float, float]]:
    """Means of time and value of each `BLOCK_S` after the warm-up."""
    began = life[0][0] if life else inf
    gathered: dict[int, list[tuple[float, float]]] = {}
    for when, value in life:
        if when >= began + warm_up:
            gathered.setdefault(int((when - began - warm_up) / BLOCK_S), []).append((when, value))
    return [
        (sum(when for when, _ in block) / len(block), sum(value for _, value in block) / len(block))
        for block in gathered.values()
    ]
