"""Everything that a figure of one fitted model shows: trajectory, samples, patches of both surfaces, parameters."""

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import isinf
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.predictors.model import ModelKind
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, dot, scale, subtract
from weberlink.master.trace import Trace
from weberlink.slave.scenes.scene import Scene
from weberlink.studies.moments.moments import ModelFit
from weberlink.studies.moments.surfaces import (
    DrawnSurface,
    FittedSurface,
    SceneSurface,
    SurfaceFrame,
    SurfacePoint,
    angle_deg,
    frame_at,
)

LEAST_HALF_M = 2e-3
MARGIN = 1.25
SCENE_MARGIN = 1.4
"""Size of the patch of the scene over the fitted patch."""
GRID = 25
RINGS = 13
SPOKES = 37

Array = NDArray[np.float64]


class ModelParameter(NamedTuple):
    """One number of a model, and that of the scene."""

    name: str
    unit: str
    fitted: float
    scene: float | None


@dataclass(frozen=True)
class Portrait:
    """One model in use.

    Args:
        fit: the model.
        surface: of the model.
        tick: the moment, within the fit.
        frame: at the newest sample, with `along` the main direction of the trajectory.
        ticks: of the trajectory, shape (n,): from the older sample until the probe leaves the surface or the model
            changes.
        positions_m: shape (n, 3).
        forces_n: shape (n, 3).
        patch_m: the fitted surface, a grid of points, shape (i, j, 3); NaN where there is none.
        scene_patch_m: that of the scene, a wider grid; None if unknown.
        parameters: to compare.
        scene: None if unknown.
    """

    fit: ModelFit
    surface: FittedSurface
    tick: int
    frame: SurfaceFrame
    ticks: NDArray[np.int64]
    positions_m: Array
    forces_n: Array
    patch_m: Array
    scene_patch_m: Array | None
    parameters: tuple[ModelParameter, ...]
    scene: SceneSurface | None

    @property
    def samples(self) -> list[Sample]:
        """The samples of the fit, the older first."""
        return [sample for sample in (self.fit.previous, self.fit.newest) if sample is not None]

    @property
    def place(self) -> int:
        """Index of the moment in the trajectory."""
        return int(np.searchsorted(self.ticks, self.tick))

    def fitted_section(self, along: Array) -> Array:
        """Heights of the fitted surface over the `along` axis of the frame [m]."""
        return self._section(self.surface, along)

    def scene_section(self, along: Array) -> Array | None:
        """The same of the scene."""
        return None if self.scene is None else self._section(self.scene, along)

    def _section(self, surface: DrawnSurface, along: Array) -> Array:
        farthest = 4.0 * float(np.ptp(along))
        return np.array([surface.height(self.frame, u, 0.0, farthest) for u in along.tolist()])

    def write_csv(self, geometry: Path, parameters: Path) -> None:
        """Write the points [m] with their forces [N], and the parameters."""
        with geometry.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["kind", "tick", "x_m", "y_m", "z_m", "fx_n", "fy_n", "fz_n"])
            writer.writerows(self._rows())
        with parameters.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["parameter", "unit", "fitted", "scene"])
            for one in self.parameters:
                writer.writerow([one.name, one.unit, _cell(one.fitted), "" if one.scene is None else _cell(one.scene)])

    def _rows(self) -> Iterator[list[object]]:
        for tick, position, force in zip(self.ticks, self.positions_m, self.forces_n, strict=True):
            yield ["trajectory", tick, *map(_cell, position), *map(_cell, force)]
        for sample in self.samples:
            yield ["sample", sample.tick, *map(_cell, sample.position), *map(_cell, sample.value)]
        for kind, patch in (("fitted_surface", self.patch_m), ("scene_surface", self.scene_patch_m)):
            if patch is not None:
                for point in patch.reshape(-1, 3):
                    if np.isfinite(point).all():
                        yield [kind, "", *map(_cell, point), "", "", ""]


def portrait(trace: Trace, fit: ModelFit, tick: int, scene: Scene | None) -> Portrait:
    """Gather what is shown of a fit that is in use at `tick`.

    Raises:
        ValueError: the model has no surface.
    """
    surface = fit.surface
    if surface is None:
        raise ValueError(f"tick {tick}: the model in use is a {type(fit.model).__name__}, which has no surface")
    began = fit.previous.tick if fit.previous is not None else fit.newest.tick
    until = _leaves(trace, fit, tick)
    ticks = np.arange(began, until)
    positions, forces = trace.position_m[began:until], trace.force_n[began:until]
    frame = frame_at(fit.newest, _main_direction(positions))
    grid_of = _grid_of(surface, frame.coordinates(positions)[:, :2])
    patch = _patch(grid_of(1.0), frame, surface)
    known = None if scene is None else SceneSurface(scene)
    true = None if known is None else known.nearest(fit.newest.position)
    scene_patch = _patch(grid_of(SCENE_MARGIN), frame, known) if known is not None and true is not None else None
    parameters = _parameters(surface, surface.nearest(fit.newest.position), true)
    return Portrait(fit, surface, tick, frame, ticks, positions, forces, patch, scene_patch, parameters, known)


def _parameters(surface: FittedSurface, fitted: SurfacePoint, true: SurfacePoint | None) -> tuple[ModelParameter, ...]:
    """Of both surfaces where they are nearest to the newest sample."""
    rows = [ModelParameter("stiffness", "N/m", surface.stiffness, true.stiffness_n_m if true else None)]
    if surface.kind is ModelKind.SPHERE:
        rows.append(ModelParameter("radius", "mm", 1e3 * surface.radius, 1e3 * true.radius_m if true else None))
        centre = _centre(true) if true else None
        for axis, name in enumerate("xyz"):
            of_scene = 1e3 * centre[axis] if centre else None
            rows.append(ModelParameter(f"centre {name}", "mm", 1e3 * surface.centre[axis], of_scene))
    for axis, name in enumerate("xyz"):
        rows.append(ModelParameter(f"normal {name}", "", fitted.normal[axis], true.normal[axis] if true else None))
    if true is not None:
        rows.append(ModelParameter("normal off by", "deg", angle_deg(fitted.normal, true.normal), None))
        height = dot(true.normal, subtract(fitted.point, true.point))
        rows.append(ModelParameter("surface off by", "mm", 1e3 * height, None))
    return tuple(rows)


def _centre(surface: SurfacePoint) -> Vector | None:
    radius = surface.radius_m
    return None if isinf(radius) else subtract(surface.point, scale(surface.normal, radius))


def _leaves(trace: Trace, fit: ModelFit, tick: int) -> int:
    """The first tick after `tick` at which the probe has left the fitted surface or the model has changed."""
    for later in range(tick + 1, fit.until):
        x, y, z = trace.position_m[later].tolist()
        if fit.model.at(later, (x, y, z)) == ZERO:
            return later
    return fit.until


def _main_direction(positions: Array) -> Vector:
    """The direction of the largest extent."""
    _, _, directions = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)
    x, y, z = directions[0].tolist()
    return (x, y, z)


def _grid_of(surface: FittedSurface, shown: Array) -> Callable[[float], Array]:
    """Grids of patches that contain the points `shown`, shape (n, 2), as a function of a factor on their size.

    On a plane a square around the path; on a sphere a cap around the newest sample, at most nearly half a ball.
    """
    if surface.kind is ModelKind.PLANE:
        middle = 0.5 * (shown.min(axis=0) + shown.max(axis=0))
        half = max(LEAST_HALF_M, 0.5 * MARGIN * float(np.ptp(shown, axis=0).max()))
        return lambda margin: _square(margin * half) + middle
    radius = min(0.9 * abs(surface.radius), max(LEAST_HALF_M, MARGIN * float(np.hypot(*shown.T).max())))
    return lambda margin: _disc(margin * radius)


def _square(half: float) -> Array:
    """Shape (GRID, GRID, 2)."""
    steps = np.linspace(-half, half, GRID)
    return np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1)


def _disc(radius: float) -> Array:
    """Rings and spokes, shape (RINGS, SPOKES, 2)."""
    rings, angles = np.linspace(0.0, radius, RINGS), np.linspace(0.0, 2.0 * np.pi, SPOKES)
    return np.stack([np.outer(rings, np.cos(angles)), np.outer(rings, np.sin(angles))], axis=-1)


def _patch(grid: Array, frame: SurfaceFrame, surface: DrawnSurface) -> Array:
    farthest = float(np.abs(grid).max())
    points = [frame.point(u, v, surface.height(frame, u, v, farthest)) for u, v in grid.reshape(-1, 2).tolist()]
    return np.array(points).reshape(*grid.shape[:2], 3)


def _cell(number: float) -> str:
    return f"{number:.9g}"
