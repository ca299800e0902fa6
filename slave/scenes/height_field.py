"""A surface given by heights over a regular grid, interpolated with a continuous normal."""

from collections.abc import Sequence
from itertools import pairwise
from math import cos, floor, hypot, isfinite, pi, sqrt
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from weberlink.geometry.vector import Vector
from weberlink.options import Options
from weberlink.slave.scenes.shape import CarvedShape, PlaneShape, SceneShapeSettings, Shape, Tangent

WAVE_SAMPLES = 16


class HeightFieldShape:
    """Solid below z = h(x, y), bicubic (Catmull-Rom) between the samples, hence with a continuous normal.

    Heights, at least 2 x 2 and finite [m], are relative to the z of `origin`, the place of the sample in the first row
    and column; rows run along y, columns along x, `spacing` [m] apart. Beyond the grid the heights of its border
    continue. Distances are to first order, (z - h) / sqrt(1 + |grad h|^2): exact at the surface, and corrected by the
    iteration of the proxy elsewhere.
    """

    flat = False

    def __init__(self, heights: Sequence[Sequence[float]], spacing: float, origin: Vector) -> None:
        rows = [tuple(map(float, row)) for row in heights]
        self._shape = (len(rows), len(rows[0]))
        # Three more copies of the first and of the last sample: `_surface` needs no test for the border.
        wide = [[row[0]] * 3 + list(row) + [row[-1]] * 3 for row in rows]
        self._rows = [wide[0]] * 3 + wide + [wide[-1]] * 3
        self._origin = origin
        self._scale = 1.0 / spacing
        # A Catmull-Rom derivative is a sum of three neighbouring differences whose weights add up to at most 1.5 in
        # absolute value, and interpolating across adds at most a factor 1.25.
        along_x = max(abs(b - a) for row in rows for a, b in pairwise(row))
        along_y = max(abs(b - a) for low, high in pairwise(rows) for a, b in zip(low, high, strict=True))
        steepest = 1.5 * 1.25 * hypot(along_x, along_y) / spacing
        self._safety = 1.0 / sqrt(1.0 + steepest**2)

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
        # The padded surface is level from two cells beyond the border.
        u = min(max((point[0] - origin[0]) * scale, -2.0), columns + 1.0)
        v = min(max((point[1] - origin[1]) * scale, -2.0), rows + 1.0)
        i, j = min(floor(u), columns), min(floor(v), rows)
        a, b, c, d, da, db, dc, dd = cubic_weights(v - j)
        e, f, g, h, de, df, dg, dh = cubic_weights(u - i)
        i += 2
        p, q, r, s = self._rows[j + 2 : j + 6]
        p0, p1, p2, p3 = p[i : i + 4]
        q0, q1, q2, q3 = q[i : i + 4]
        r0, r1, r2, r3 = r[i : i + 4]
        s0, s1, s2, s3 = s[i : i + 4]
        h0, slope0 = a * p0 + b * q0 + c * r0 + d * s0, da * p0 + db * q0 + dc * r0 + dd * s0
        h1, slope1 = a * p1 + b * q1 + c * r1 + d * s1, da * p1 + db * q1 + dc * r1 + dd * s1
        h2, slope2 = a * p2 + b * q2 + c * r2 + d * s2, da * p2 + db * q2 + dc * r2 + dd * s2
        h3, slope3 = a * p3 + b * q3 + c * r3 + d * s3, da * p3 + db * q3 + dc * r3 + dd * s3
        height, slope_y = e * h0 + f * h1 + g * h2 + h * h3, e * slope0 + f * slope1 + g * slope2 + h * slope3
        slope_x = de * h0 + df * h1 + dg * h2 + dh * h3
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


def bumps(amplitude: float, wavelength: float, size: float) -> tuple[list[list[float]], float]:
    """A square field of round bumps, h = a (1 - cos kx)(1 - cos ky) / 4, level with its surroundings along the border.

    `size` is the edge [m], rounded to whole wavelengths, at least one. Returns heights (rows along y) and their spacing
    [m].
    """
    count = max(1, round(size / wavelength)) * WAVE_SAMPLES + 1
    wave = [(1.0 - cos(2.0 * pi * i / WAVE_SAMPLES)) / 2.0 for i in range(count)]
    return [[amplitude * x * y for x in wave] for y in wave], wavelength / WAVE_SAMPLES


class BumpSettings(Options):
    """A square of round bumps, level with its surroundings at the border."""

    amplitude_m: float = Field(gt=0.0, description="height of a crest")
    wavelength_m: float = Field(gt=0.0, description="from crest to crest")
    size_m: float = Field(default=0.12, gt=0.0, description="edge of the square, rounded to whole wavelengths")

    @model_validator(mode="after")
    def check_waves(self) -> Self:
        if self.size_m > 64.0 * self.wavelength_m:
            raise ValueError("size_m: expected at most 64 wavelengths")
        return self


class HeightFieldSettings(SceneShapeSettings):
    """Heights over a grid, smoothly interpolated: exactly one of `heights_m`, `csv` or `bumps`."""

    shape: Literal["height_field"]
    center_m: Vector = Field(default=(0.0, 0.0, 0.0), description="middle of the grid; heights count from its z")
    heights_m: tuple[tuple[float, ...], ...] | None = Field(default=None, description="rows along y, columns along x")
    csv: Path | None = Field(default=None, description="file of the heights: numbers with commas, no header")
    bumps: BumpSettings | None = None
    spacing_m: float | None = Field(default=None, gt=0.0, description="between samples; not with `bumps`")
    bounded: bool = Field(default=False, description="solid under the grid only; otherwise its border continues")

    @model_validator(mode="after")
    def check_source(self) -> Self:
        if sum(source is not None for source in (self.heights_m, self.csv, self.bumps)) != 1:
            raise ValueError("expected exactly one of heights_m, csv, bumps")
        if (self.spacing_m is None) != (self.bumps is not None):
            raise ValueError("spacing_m: expected with heights_m or csv, and only with them")
        if self.heights_m is not None and (
            len(self.heights_m) < 2 or len(self.heights_m[0]) < 2 or len(set(map(len, self.heights_m))) != 1
        ):
            raise ValueError("heights_m: expected at least 2 rows and 2 columns, every row of the same length")
        return self

    def solid(self) -> Shape:
        if self.bumps is not None:
            heights, spacing = bumps(self.bumps.amplitude_m, self.bumps.wavelength_m, self.bumps.size_m)
        else:
            assert self.spacing_m is not None
            spacing = self.spacing_m
            heights = list(map(list, self.heights_m or ())) if self.csv is None else read_heights(self.csv)
        x, y, z = self.center_m
        east, north = (len(heights[0]) - 1) * spacing / 2.0, (len(heights) - 1) * spacing / 2.0
        field = HeightFieldShape(heights, spacing, (x - east, y - north, z))
        if not self.bounded:
            return field
        walls = [
            PlaneShape((x + east, y, z), (1.0, 0.0, 0.0)),
            PlaneShape((x - east, y, z), (-1.0, 0.0, 0.0)),
            PlaneShape((x, y + north, z), (0.0, 1.0, 0.0)),
            PlaneShape((x, y - north, z), (0.0, -1.0, 0.0)),
        ]
        return CarvedShape(field, walls)


def read_heights(path: Path) -> list[list[float]]:
    """Rows of heights [m] from a CSV file without a header; raises ValueError with the file, and the row where one is
    at fault.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"csv: {path}: expected a readable text file ({error})") from error
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            row = [float(cell) for cell in line.split(",")]
        except ValueError as error:
            raise ValueError(f"csv: {path}: row {number}: expected numbers with commas between them") from error
        if not all(map(isfinite, row)):
            raise ValueError(f"csv: {path}: row {number}: expected finite numbers")
        if rows and len(row) != len(rows[0]):
            raise ValueError(f"csv: {path}: row {number}: expected {len(rows[0])} values, found {len(row)}")
        rows.append(row)
    if len(rows) < 2 or len(rows[0]) < 2:
        raise ValueError(f"csv: {path}: expected at least 2 rows and 2 columns")
    return rows
