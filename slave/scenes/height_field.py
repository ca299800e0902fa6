"""A surface given by heights over a regular grid, interpolated so that its normal has no steps."""

from collections.abc import Sequence
from itertools import pairwise
from math import cos, floor, hypot, pi, sqrt
from typing import TypeVar

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.shape import Tangent

T = TypeVar("T")

Grid = Sequence[Sequence[float]]
"""Heights [m]: rows run along y, columns along x."""

WAVE_SAMPLES = 16


class HeightField:
    """Solid below z = h(x, y), bicubic (Catmull-Rom) between the samples, hence with a continuous normal.

    Beyond the grid the heights of its border go on for ever. Distances are to first order, (z - h) / sqrt(1 + |grad
    h|^2): exact at the surface, where it matters, and corrected by the iteration of the proxy elsewhere.

    Args:
        heights: Grid of at least 2 x 2 finite samples [m], relative to the z of `origin`.
        spacing: Distance between neighbouring samples [m], above 0.
        origin: Scene position of the sample in the first row and column.
    """

    __slots__ = ("_columns", "_origin", "_rows", "_safety", "_scale", "_shape")

    flat = False

    def __init__(self, heights: Grid, spacing: float, origin: Vector) -> None:
        rows = [tuple(map(float, row)) for row in heights]
        if len(rows) < 2 or len(rows[0]) < 2 or any(len(row) != len(rows[0]) for row in rows):
            raise ValueError("heights: expected at least 2 rows and 2 columns, every row of the same length")
        if not all(height - height == 0.0 for row in rows for height in row):
            raise ValueError("heights: expected finite numbers")
        if not spacing > 0.0:
            raise ValueError(f"spacing: expected more than 0 m, got {spacing}")
        self._shape = (len(rows), len(rows[0]))
        self._rows = [padded(row) for row in padded(rows)]
        self._origin = origin
        self._scale = 1.0 / spacing
        self._safety = 1.0 / sqrt(1.0 + steepest_slope(rows, spacing) ** 2)

    def clearance(self, point: Vector) -> float:
        above = point[2] - self._surface(point)[0]
        return above * self._safety if above > 0.0 else above

    def linearise(self, point: Vector) -> tuple[Tangent, ...]:
        height, slope_x, slope_y = self._surface(point)
        cosine = 1.0 / sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        return (((point[2] - height) * cosine, (-slope_x * cosine, -slope_y * cosine, cosine)),)

    def _surface(self, point: Vector) -> tuple[float, float, float]:
        """Height [m] and the two slopes above (x, y) of `point`."""
        origin, scale, (rows, columns) = self._origin, self._scale, self._shape
        # Two cells beyond the border the padded surface is level, so that is as far as one has to look.
        u = min(max((point[0] - origin[0]) * scale, -2.0), columns + 1.0)
        v = min(max((point[1] - origin[1]) * scale, -2.0), rows + 1.0)
        i, j = min(floor(u), columns), min(floor(v), rows)
        a0, a1, a2, a3, da0, da1, da2, da3 = cubic_weights(u - i)
        b0, b1, b2, b3, db0, db1, db2, db3 = cubic_weights(v - j)
        p, q, r, s = self._rows[j + 2 : j + 6]
        i += 2
        p0, p1, p2, p3 = p[i : i + 4]
        q0, q1, q2, q3 = q[i : i + 4]
        r0, r1, r2, r3 = r[i : i + 4]
        s0, s1, s2, s3 = s[i : i + 4]
        c0 = b0 * p0 + b1 * q0 + b2 * r0 + b3 * s0
        c1 = b0 * p1 + b1 * q1 + b2 * r1 + b3 * s1
        c2 = b0 * p2 + b1 * q2 + b2 * r2 + b3 * s2
        c3 = b0 * p3 + b1 * q3 + b2 * r3 + b3 * s3
        slope_y = (
            a0 * (db0 * p0 + db1 * q0 + db2 * r0 + db3 * s0)
            + a1 * (db0 * p1 + db1 * q1 + db2 * r1 + db3 * s1)
            + a2 * (db0 * p2 + db1 * q2 + db2 * r2 + db3 * s2)
            + a3 * (db0 * p3 + db1 * q3 + db2 * r3 + db3 * s3)
        )
        height = a0 * c0 + a1 * c1 + a2 * c2 + a3 * c3
        slope_x = da0 * c0 + da1 * c1 + da2 * c2 + da3 * c3
        return origin[2] + height, slope_x * scale, slope_y * scale


def cubic_weights(t: float) -> tuple[float, float, float, float, float, float, float, float]:
    """Catmull-Rom weights of the samples at -1, 0, 1, 2 for 0 <= t <= 1, then their derivatives."""
    s = t * t
    c = s * t
    return (
        -0.5 * c + s - 0.5 * t,
        1.5 * c - 2.5 * s + 1.0,
        -1.5 * c + 2.0 * s + 0.5 * t,
        0.5 * c - 0.5 * s,
        -1.5 * s + 2.0 * t - 0.5,
        4.5 * s - 5.0 * t,
        -4.5 * s + 4.0 * t + 0.5,
        1.5 * s - t,
    )


def padded(row: Sequence[T]) -> list[T]:
    """Three copies of the first and last sample on either side, so that the hot path needs no test for the border."""
    return [row[0]] * 3 + list(row) + [row[-1]] * 3


def steepest_slope(rows: Grid, spacing: float) -> float:
    """Upper bound of |grad h|.

    The Catmull-Rom derivative is a sum of three neighbouring differences whose weights add up to at most 1.5 in
    absolute value, and interpolating across adds at most a factor 1.25.
    """
    along_x = max(abs(b - a) for row in rows for a, b in pairwise(row))
    along_y = max(abs(b - a) for low, high in pairwise(rows) for a, b in zip(low, high, strict=True))
    return 1.5 * 1.25 * hypot(along_x, along_y) / spacing


def bumps(amplitude: float, wavelength: float, size: float) -> tuple[list[list[float]], float]:
    """A square field of round bumps, h = a (1 - cos kx)(1 - cos ky) / 4, level with its surroundings along the border.

    Args:
        amplitude: Height of a crest above the border [m].
        wavelength: From crest to crest [m].
        size: Edge of the square [m], rounded to whole wavelengths, at least one.

    Returns:
        Heights (rows along y) and their spacing [m].
    """
    count = max(1, round(size / wavelength)) * WAVE_SAMPLES + 1
    wave = [(1.0 - cos(2.0 * pi * i / WAVE_SAMPLES)) / 2.0 for i in range(count)]
    return [[amplitude * x * y for x in wave] for y in wave], wavelength / WAVE_SAMPLES
