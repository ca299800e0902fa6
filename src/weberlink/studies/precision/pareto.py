"""The Pareto front of error against run time: what nothing else beats in both."""

from collections.abc import Sequence

Point = tuple[float, float]
"""Run time and error, the less the better; infinite where there is none."""


def front(points: Sequence[Point]) -> list[int]:
    """Indices of the points that no other point beats in one and equals or beats in the other, the cheapest first."""
    order = sorted(range(len(points)), key=lambda index: points[index])
    kept: list[int] = []
    for index in order:
        if points[index][1] == float("inf"):
            continue
        best = points[kept[-1]] if kept else None
        if best is None or points[index][1] < best[1] or points[index] == best:
            kept.append(index)
    return kept


def cheapest_as_good(points: Sequence[Point], error: float) -> int | None:
    """The index of the cheapest point whose error is no more than `error`."""
    good = [index for index, point in enumerate(points) if point[1] <= error]
    return min(good, key=lambda index: points[index][0], default=None)
