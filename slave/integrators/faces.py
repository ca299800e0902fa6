"""Which of several planes hold a probe, in coordinates that do not know of each other. Pure geometry.

The probe is pushed to the nearest point in front of all planes, its proxy: probe = proxy - sum lambda_i n_i over the
active planes, with lambda_i > 0 the depths. With the dual vectors g_i (g_i . n_j = 1 if i = j, else 0, in the span of
the active normals) lambda_i = -(g_i x + q_i). Under a control that is alike in every direction and a force sum F_i n_i,
where F_i depends on lambda_i and its rate only, each lambda_i is an oscillator of its own, at right angles or not, and
the proxy moves as if there were no contact.
"""

from collections.abc import Sequence
from typing import NamedTuple

from weberlink.geometry.vector import ZERO, Vector, add, dot, scale, subtract
from weberlink.slave.scenes.active_set import PARALLEL, pair, single, smallest_push, triple

UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
SOLVERS = (single, pair, triple)


class Coordinate(NamedTuple):
    """coordinate(x) = vector . x + offset of `plane`: its depth lambda, or its gap seen from the proxy."""

    plane: int
    vector: Vector
    offset: float

    def of(self, x: Vector) -> float:
        vector = self.vector
        return vector[0] * x[0] + vector[1] * x[1] + vector[2] * x[2] + self.offset


class Face(NamedTuple):
    """The depths of the active planes, and the gaps of those that the proxy can still reach."""

    depths: tuple[Coordinate, ...]
    gaps: tuple[Coordinate, ...]


class Faces:
    """All faces of the planes n_i x + o_i = 0, each worked out when it is first asked for.

    Args:
        normals: Unit vectors out of the solids.
        offsets: Gap of each plane at the origin [m].
    """

    __slots__ = ("_known", "_normals", "_offsets")

    def __init__(self, normals: Sequence[Vector], offsets: Sequence[float]) -> None:
        self._normals = normals
        self._offsets = offsets
        self._known: dict[frozenset[int], Face | None] = {}

    def active(self, position: Vector) -> frozenset[int]:
        """The planes that hold a probe at `position`."""
        x, y, z = position
        violations = [
            -(n[0] * x + n[1] * y + n[2] * z + offset) for n, offset in zip(self._normals, self._offsets, strict=True)
        ]
        if max(violations, default=0.0) <= 0.0:
            return frozenset()
        return frozenset([index for index, depth in smallest_push(violations, self._normals) if depth > 0.0])

    def face(self, active: frozenset[int]) -> Face | None:
        """The coordinates while `active` hold the probe; None if more than three do or their normals are dependent."""
        if active not in self._known:
            self._known[active] = self._worked_out(sorted(active))
        return self._known[active]

    def _worked_out(self, active: list[int]) -> Face | None:
        if len(active) > len(SOLVERS):
            return None
        normals = [self._normals[i] for i in active]
        duals: list[Vector] = []
        offsets: list[float] = []
        if active:
            solve = SOLVERS[len(active) - 1]
            columns = [solve([dot(n, unit) for n in normals], normals) for unit in UNITS]
            solved = solve([self._offsets[i] for i in active], normals)
            x, y, z = columns
            if x is None or y is None or z is None or solved is None:
                return None
            duals = list(zip(x, y, z, strict=True))
            offsets = list(solved)
        depths = [Coordinate(i, scale(g, -1.0), -q) for i, g, q in zip(active, duals, offsets, strict=True)]
        gaps = []
        for j, n in enumerate(self._normals):
            if j in active:
                continue
            shares = [dot(n, normal) for normal in normals]
            along, offset = ZERO, self._offsets[j]
            for share, g, q in zip(shares, duals, offsets, strict=True):
                along, offset = add(along, scale(g, share)), offset - share * q
            across = subtract(n, along)
            if dot(across, across) > PARALLEL:
                gaps.append(Coordinate(j, across, offset))
        return Face(tuple(depths), tuple(gaps))
