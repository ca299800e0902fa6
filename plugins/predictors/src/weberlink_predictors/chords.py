"""A path of straight parts through a signal that is known for a while, and on to where it is expected then.

For given knots the vertices come from weighted least squares over the known samples and the expected ones. The weights
of known samples rise where the path is far from them (Lawson's algorithm), which leads towards the smallest largest
error. Knots are added one by one, each at its best place, until the path stays within the deadband at every known tick.
C. L. Lawson, "Contributions to the theory of linear least maximum approximation", thesis, UCLA, 1961.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from weberlink.geometry.vector import Vector

MARGIN = 0.8  # Largest error at a known tick, as a share of the deadband; the rest is for rounding
ROUNDS = 5  # Solutions of a least-squares problem with weights that change
MOST_INNER = 6  # Largest number of knots that are added
PLACES = 16  # Number of places that are tried for a knot, the nearest ones to the largest error
EXPECTED = 4.0  # Weight of an expected value beside that of a known one
END = 2.0  # The same at the end of the known samples, if the path has a knot there

Array = NDArray[np.float64]


class Chords:
    """The problem of one known stretch.

    Args:
        values: the known samples, tick by tick, the first one that of tick 0; at least two.
        bounds: the deadband of each, >= 0.
        tail: displacements that are expected after the last known sample, `horizons` ticks after it.
    """

    def __init__(
        self, values: Sequence[Vector], bounds: Sequence[float], tail: Sequence[Vector], horizons: Sequence[int]
    ) -> None:
        self._end = end = len(values) - 1
        self._known = np.array(values)
        self._limits = np.maximum(bounds, 1e-12)
        self._ticks = np.arange(end + 1)
        self._tail = [end + ahead for ahead in horizons]
        self._expected = self._known[-1] + np.array([(0.0, 0.0, 0.0), *tail])
        self._weights = np.array([END, *[EXPECTED] * len(tail)]) / self._limits[-1] ** 2

    def path(self) -> tuple[list[int], list[Vector]]:
        """Knots, the first one at tick 0, and vertices; the fewest knots found, and the best path if none fits."""
        outer = [[0, *self._tail], [0, self._end, *self._tail]]
        best, knots, vertices = np.inf, outer[0], self._expected
        for each in outer:
            worst, solution, far = self._fit([each])
            if worst[0] < best:
                best, knots, vertices = worst[0], each, solution[0]
            if best <= MARGIN:
                break
        inner: list[int] = []
        where = int(far[0])
        while best > MARGIN and len(inner) < min(MOST_INNER, self._end - 1):
            free = [tick for tick in range(1, self._end) if tick not in inner]
            places = sorted(free, key=lambda tick: abs(tick - where))[:PLACES]
            tried = [[0, *sorted([*inner, place]), self._end, *self._tail] for place in places]
            worst, solution, far = self._fit(tried)
            index = int(worst.argmin())
            where = int(far[index])
            inner.append(places[index])
            if worst[index] < best:
                best, knots, vertices = worst[index], tried[index], solution[index]
        return knots, [(x, y, z) for x, y, z in vertices.tolist()]

    def _fit(self, tried: Sequence[Sequence[int]]) -> tuple[Array, Array, NDArray[np.intp]]:
        """For several lists of knots, all of one length: the largest error [deadbands], the vertices, and its tick."""
        knots = np.array(tried)
        count, size = knots.shape
        if size == 1:
            hats = np.ones((count, self._end + 1, 1))
        else:
            before = (knots[:, None, 1:-1] <= self._ticks[None, :, None]).sum(axis=2)
            low = np.take_along_axis(knots, before, axis=1)
            share = (self._ticks - low) / (np.take_along_axis(knots, before + 1, axis=1) - low)
            hats = np.zeros((count, self._end + 1, size))
            np.put_along_axis(hats, before[:, :, None], 1.0 - share[:, :, None], axis=2)
            np.put_along_axis(hats, before[:, :, None] + 1, share[:, :, None], axis=2)
        ends = sum(tick >= self._end for tick in tried[0])
        prior, expected = np.zeros(size), np.zeros((size, 3))
        if ends:
            prior[size - ends :], expected[size - ends :] = self._weights[-ends:], self._expected[-ends:]
        left, right = np.diag(prior + 1e-12 * self._weights[0]), prior[:, None] * expected
        weights = np.repeat(self._limits[None] ** -2, count, axis=0)
        best, vertices, far = np.full(count, np.inf), np.zeros((count, size, 3)), np.zeros(count, np.intp)
        for _ in range(ROUNDS):
            weighted = (hats * weights[:, :, None]).transpose(0, 2, 1)
            try:
                solution = np.linalg.solve(weighted @ hats + left, weighted @ self._known + right)
            except np.linalg.LinAlgError:  # deadbands of 0: weights so far apart that rounding makes it singular
                break
            errors = np.sqrt(((hats @ solution - self._known) ** 2).sum(axis=2)) / self._limits
            worst = errors.max(axis=1)
            better = worst < best
            best[better], vertices[better], far[better] = worst[better], solution[better], errors.argmax(axis=1)[better]
            if best.min() <= MARGIN:
                break
            weights *= np.where(errors > 0.7 * MARGIN, (0.3 + errors / MARGIN) ** 2, 1.0)
        return best, vertices, far
