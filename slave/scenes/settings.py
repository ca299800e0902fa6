"""The scene as a configuration file writes it, checked, and the way from there to a `Scene`."""

from collections.abc import Sequence
from math import isfinite, radians, sqrt
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.box import Box, BoxCavity
from weberlink.slave.scenes.carved import Carved
from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.height_field import HeightField, bumps
from weberlink.slave.scenes.plane import Plane
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.shape import Shape
from weberlink.slave.scenes.sphere import Sphere, SphereCavity
from weberlink.slave.scenes.sway import Sway, Wave
from weberlink.slave.scenes.turned import Turned

FASTEST_M_S = 10.0
"""Of an object that moves: a centimetre a tick, beyond any robot and any hand."""


def unit(vector: Vector) -> Vector:
    length = sqrt(sum(component * component for component in vector))
    if not 0.0 < length < float("inf"):
        raise ValueError("expected a vector longer than zero")
    return (vector[0] / length, vector[1] / length, vector[2] / length)


def edges(size: Vector) -> Vector:
    if not min(size) > 0.0:
        raise ValueError("expected three edges longer than 0 m")
    return size


UnitVector = Annotated[Vector, AfterValidator(unit)]
Edges = Annotated[Vector, AfterValidator(edges)]
Angles = Annotated[Vector, Field(description="roll, pitch, yaw [deg] about the centre: R = Rz(yaw) Ry(pitch) Rx(roll)")]


class Settings(BaseModel):
    """Unknown keys and non-finite numbers are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class FrictionSettings(Settings):
    """Coulomb friction: sticks within static x normal force, slides at dynamic x normal force."""

    static: float = Field(ge=0.0, le=2.0)
    dynamic: float = Field(ge=0.0, le=2.0)

    @model_validator(mode="after")
    def check_order(self) -> Self:
        if self.dynamic > self.static:
            raise ValueError(f"dynamic: expected at most static ({self.static}), got {self.dynamic}")
        return self


class MotionSettings(Settings):
    """The object moves to and fro about where it is written, whatever the probe does. Time is that of the robot."""

    direction: UnitVector = Field(default=(0.0, 0.0, 1.0), description="any length, it is normalised")
    amplitude_m: float = Field(gt=0.0, le=10.0, description="from the middle to either end")
    frequency_hz: float = Field(gt=0.0, le=50.0)
    phase_deg: float = Field(default=0.0, ge=-360.0, le=360.0, description="at 0 it begins in the middle, going along")
    wave: Wave = Field(
        default="sine",
        description="sine: at most 2 pi frequency amplitude fast; triangle: always 4 frequency amplitude",
    )

    @model_validator(mode="after")
    def check_speed(self) -> Self:
        speed = self.sway().speed
        if speed > FASTEST_M_S:
            raise ValueError(
                f"amplitude_m, frequency_hz: expected a peak speed of at most {FASTEST_M_S:g} m/s, got {speed:.3g} m/s"
            )
        return self

    def sway(self) -> Sway:
        return Sway(self.direction, self.amplitude_m, self.frequency_hz, self.phase_deg / 360.0, self.wave)


class PlaneShape(Settings):
    """A half-space, solid against the normal."""

    shape: Literal["plane"]
    point_m: Vector = (0.0, 0.0, 0.0)
    normal: UnitVector = Field(default=(0.0, 0.0, 1.0), description="outward; any length, it is normalised")

    def solid(self) -> Shape:
        return Plane(self.point_m, self.normal)

    def hollow(self) -> Shape:
        return Plane(self.point_m, (-self.normal[0], -self.normal[1], -self.normal[2]))


class SphereShape(Settings):
    """A ball; with `side: inside`, everything but the ball."""

    shape: Literal["sphere"]
    center_m: Vector
    radius_m: float = Field(gt=0.0)
    side: Literal["outside", "inside"] = Field(default="outside", description="where the operator is")

    def solid(self) -> Shape:
        return Sphere(self.center_m, self.radius_m) if self.side == "outside" else self.hollow()

    def hollow(self) -> Shape:
        return SphereCavity(self.center_m, self.radius_m)


class BoxShape(Settings):
    """A box with sharp edges; with `side: inside`, everything but the box."""

    shape: Literal["box"]
    center_m: Vector
    size_m: Edges
    side: Literal["outside", "inside"] = Field(default="outside", description="where the operator is")
    rotation_deg: Angles | None = None

    def solid(self) -> Shape:
        return self._turned(Box(self.center_m, self.size_m)) if self.side == "outside" else self.hollow()

    def hollow(self) -> Shape:
        return self._turned(BoxCavity(self.center_m, self.size_m))

    def _turned(self, shape: Shape) -> Shape:
        if self.rotation_deg is None:
            return shape
        roll, pitch, yaw = self.rotation_deg
        return Turned(shape, self.center_m, (radians(roll), radians(pitch), radians(yaw)))


class BumpSettings(Settings):
    """A square of round bumps, level with its surroundings at the border."""

    amplitude_m: float = Field(gt=0.0, description="height of a crest")
    wavelength_m: float = Field(gt=0.0, description="from crest to crest")
    size_m: float = Field(default=0.12, gt=0.0, description="edge of the square, rounded to whole wavelengths")

    @model_validator(mode="after")
    def check_waves(self) -> Self:
        if self.size_m > 64.0 * self.wavelength_m:
            raise ValueError("size_m: expected at most 64 wavelengths")
        return self


class HeightFieldShape(Settings):
    """Heights over a grid, smoothly interpolated: exactly one of `heights_m`, `csv` or `bumps`."""

    shape: Literal["height_field"]
    center_m: Vector = Field(default=(0.0, 0.0, 0.0), description="middle of the grid; heights count from its z")
    heights_m: tuple[tuple[float, ...], ...] | None = Field(default=None, description="rows along y, columns along x")
    csv: Path | None = Field(default=None, description="the same in a file: numbers with commas, no header")
    bumps: BumpSettings | None = None
    spacing_m: float | None = Field(default=None, gt=0.0, description="between samples; not with `bumps`")
    bounded: bool = Field(default=False, description="solid under the grid only; otherwise its border goes on for ever")

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
        heights, spacing = self._samples()
        x, y, z = self.center_m
        width, length = (len(heights[0]) - 1) * spacing, (len(heights) - 1) * spacing
        field = HeightField(heights, spacing, (x - width / 2.0, y - length / 2.0, z))
        if not self.bounded:
            return field
        return Carved(field, walls(self.center_m, width, length))

    def _samples(self) -> tuple[Sequence[Sequence[float]], float]:
        if self.bumps is not None:
            return bumps(self.bumps.amplitude_m, self.bumps.wavelength_m, self.bumps.size_m)
        assert self.spacing_m is not None
        if self.heights_m is not None:
            return self.heights_m, self.spacing_m
        assert self.csv is not None
        return read_heights(self.csv), self.spacing_m


class Surface(Settings):
    """What the surface of an object does. What is not given is neither computed nor remembered."""

    stiffness_n_m: float = Field(gt=0.0, le=1e7)
    friction: FrictionSettings | None = None
    damping_n_s_m: float | None = Field(default=None, ge=0.0, description="along the normal; never pulls")
    motion: MotionSettings | None = None
    carve: tuple[Annotated["PlaneShape | SphereShape | BoxShape", Field(discriminator="shape")], ...] = Field(
        default=(), description="shapes cut out of this one"
    )


class PlaneObject(PlaneShape, Surface):
    """A plane to touch."""


class SphereObject(SphereShape, Surface):
    """A sphere to touch."""


class BoxObject(BoxShape, Surface):
    """A box to touch."""


class HeightFieldObject(HeightFieldShape, Surface):
    """A height field to touch."""


ObjectSettings = Annotated[
    PlaneObject | SphereObject | BoxObject | HeightFieldObject,
    Field(discriminator="shape"),
]
SceneSettings = tuple[ObjectSettings, ...]
"""The `scene:` list of a configuration file."""


def build(objects: Sequence[ObjectSettings]) -> Scene:
    """The scene that the settings describe.

    Raises:
        ValueError: A height field file is missing, not numeric or not rectangular.
    """
    things = [scene_object(settings) for settings in objects]
    if all(settings.motion is None for settings in objects):
        return Scene(things)
    from weberlink.slave.scenes.moving import MovingScene  # noqa: PLC0415

    return MovingScene(things, [None if settings.motion is None else settings.motion.sway() for settings in objects])


def scene_object(settings: ObjectSettings) -> SceneObject:
    shape = settings.solid()
    if settings.carve:
        shape = Carved(shape, [cut.hollow() for cut in settings.carve])
    cone = settings.friction
    friction = None if cone is None else FrictionCone(cone.static, cone.dynamic)
    return SceneObject(shape, settings.stiffness_n_m, friction, settings.damping_n_s_m)


def walls(center: Vector, width: float, length: float) -> list[Shape]:
    """Four half-spaces that leave a column of `width` along x and `length` along y about `center`."""
    x, y, z = center
    return [
        Plane((x + width / 2.0, y, z), (1.0, 0.0, 0.0)),
        Plane((x - width / 2.0, y, z), (-1.0, 0.0, 0.0)),
        Plane((x, y + length / 2.0, z), (0.0, 1.0, 0.0)),
        Plane((x, y - length / 2.0, z), (0.0, -1.0, 0.0)),
    ]


def read_heights(path: Path) -> list[list[float]]:
    """Rows of heights [m] from a CSV file without a header.

    Raises:
        ValueError: With the file, and the row where one is at fault.
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
