"""All numbers of a drawing of one fitted model: trajectory, samples, patches of both surfaces, parameters.

Owns what is shown and the tables of it, not how it looks.
"""

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import isinf
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.predictors.plane import Plane
from weberlink.codec.predictors.sphere import Sphere
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, dot, scale, subtract
from weberlink.master.trace import Trace
from weberlink.slave.scenes.scene import Scene
from weberlink.studies.moments.fitted_surface import (
    Frame,
    Surface,
    angle_deg,
    fitted_height,
    fitted_surface,
    frame_at,
    scene_height,
    scene_surface,
)  # fmt: skip
from weberlink.studies.moments.moments import Fit

LEAST_HALF_M = 2e-3
MARGIN = 1.25
SCENE_MARGIN = 1.4
"""Of the scene over the fitted patch, so that the scene is seen to go on."""
GRID = 25
RINGS = 13
SPOKES = 37

Array = NDArray[np.float64]


class Parameter(NamedTuple):
    """One number of a model beside that of the scene."""

    name: str
    unit: str
    fitted: float
    scene: float | None


@dataclass(frozen=True)
class Portrait:
    """One model as it was in force.

    Args:
        fit: the model.
        model: the same, known to have a surface.
        tick: the moment, within the fit.
        frame: at the newest sample, `along` the way that the probe took.
        ticks: of the trajectory, shape (n,): from the older sample to where the probe leaves
            the surface or the model changes.
        positions_m: shape (n, 3). forces_n: shape (n, 3).
        patch_m: the fitted surface, a grid of points, shape (i, j, 3); NaN where there is none.
        scene_patch_m: that of the scene, a wider grid; None where it is not known.
        parameters: to compare.
        scene: None where it is not known.
    """

    fit: Fit
    model: Plane | Sphere
    tick: int
    frame: Frame
    ticks: NDArray[np.int64]
    positions_m: Array
    forces_n: Array
    patch_m: Array
    scene_patch_m: Array | None
    parameters: tuple[Parameter, ...]
    scene: Scene | None

    @property
    def samples(self) -> list[Sample]:
        """What the model was fitted to, the older first."""
        return [sample for sample in (self.fit.previous, self.fit.newest) if sample is not None]

    @property
    def place(self) -> int:
        """Index of the moment in the trajectory."""
        return int(np.searchsorted(self.ticks, self.tick))

    def fitted_section(self, along: Array) -> Array:
        """Heights of the fitted surface in the frame, straight over its `along` axis [m]."""
        return np.array([fitted_height(self.model, self.frame, u, 0.0) for u in along.tolist()])

    def scene_section(self, along: Array) -> Array | None:
        """The same of the scene."""
        if self.scene is None:
            return None
        farthest = 4.0 * float(np.ptp(along))
        return np.array([scene_height(self.scene, self.frame, u, 0.0, farthest) for u in along.tolist()])

    def write_csv(self, geometry: Path, parameters: Path) -> None:
        """What is drawn, a row for each point [m] and its force [N] where it has one, and the parameters."""
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


def portrait(trace: Trace, fit: Fit, tick: int, scene: Scene | None) -> Portrait:
    """Gather what is to be shown of a fit.

    Args:
        trace: of which the fit is.
        fit: in force at `tick`.
        tick: the moment.
        scene: in which the trace was made, in its frame; None where it is not known.

    Raises:
        ValueError: if the model has no surface.
    """
    began = fit.previous.tick if fit.previous is not None else fit.newest.tick
    model = fit.model
    if not isinstance(model, Plane | Sphere):
        raise ValueError(f"tick {tick}: a {type(model).__name__} is in force; expected a Plane or a Sphere")  # noqa: TRY004
    until = _leaves(trace, fit, tick)
    ticks = np.arange(began, until)
    positions, forces = trace.position_m[began:until], trace.force_n[began:until]
    frame = frame_at(fit.newest, _main_direction(positions))
    grid_of = _grid_of(model, frame.coordinates(positions)[:, :2])
    patch = _patch(grid_of(1.0), frame, lambda u, v: fitted_height(model, frame, u, v))
    scene_patch = None
    if scene is not None and scene_surface(scene, fit.newest.position) is not None:
        grid = grid_of(SCENE_MARGIN)
        farthest = float(np.abs(grid).max())
        scene_patch = _patch(grid, frame, lambda u, v: scene_height(scene, frame, u, v, farthest))
    parameters = _parameters(fit, model, scene)
    return Portrait(fit, model, tick, frame, ticks, positions, forces, patch, scene_patch, parameters, scene)


def _parameters(fit: Fit, model: Plane | Sphere, scene: Scene | None) -> tuple[Parameter, ...]:
    """Of both surfaces where they are nearest to the newest sample."""
    near = fit.newest.position
    fitted = fitted_surface(model, near)
    true = scene_surface(scene, near) if scene is not None else None
    rows = [Parameter("stiffness", "N/m", model.stiffness, true.stiffness_n_m if true else None)]
    if isinstance(model, Sphere):
        rows.append(Parameter("radius", "mm", 1e3 * model.radius, 1e3 * _round(true) if true else None))
        centre = _centre(true) if true else None
        for axis, name in enumerate("xyz"):
            rows.append(
                Parameter(f"centre {name}", "mm", 1e3 * model.centre[axis], 1e3 * centre[axis] if centre else None)
            )
    for axis, name in enumerate("xyz"):
        rows.append(Parameter(f"normal {name}", "", fitted.normal[axis], true.normal[axis] if true else None))
    if true is not None:
        rows.append(Parameter("normal off by", "deg", angle_deg(fitted.normal, true.normal), None))
        height = dot(true.normal, subtract(fitted.point, true.point))
        rows.append(Parameter("surface off by", "mm", 1e3 * height, None))
    return tuple(rows)


def _round(surface: Surface) -> float:
    """Radius of the sphere that fits best [m], from the mean curvature."""
    first, second = surface.curvatures_per_m
    mean = Surface(surface.point, surface.normal, surface.stiffness_n_m, (0.5 * (first + second),) * 2)
    return mean.radii_m[0]


def _centre(surface: Surface) -> Vector | None:
    radius = _round(surface)
    return None if isinf(radius) else subtract(surface.point, scale(surface.normal, radius))


def _leaves(trace: Trace, fit: Fit, tick: int) -> int:
    """The first tick after `tick` at which the probe has left the fitted surface, or the model is another."""
    for later in range(tick + 1, fit.until):
        x, y, z = trace.position_m[later].tolist()
        if fit.model.at(later, (x, y, z)) == ZERO:
            return later
    return fit.until


def _main_direction(positions: Array) -> Vector:
    """In which the positions reach farthest."""
    _, _, directions = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)
    x, y, z = directions[0].tolist()
    return (x, y, z)


def _grid_of(model: Plane | Sphere, shown: Array) -> Callable[[float], Array]:
    """Grids for a patch that shows the points `shown`, shape (n, 2), and for a patch so many times as wide.

    On a plane a square about the path; on a sphere a cap about the newest sample, at most nearly half a ball.
    """
    if isinstance(model, Plane):
        middle = 0.5 * (shown.min(axis=0) + shown.max(axis=0))
        half = max(LEAST_HALF_M, 0.5 * MARGIN * float(np.ptp(shown, axis=0).max()))
        return lambda margin: _square(margin * half) + middle
    radius = min(0.9 * abs(model.radius), max(LEAST_HALF_M, MARGIN * float(np.hypot(*shown.T).max())))
    return lambda margin: _disc(margin * radius)


def _square(half: float) -> Array:
    """Shape (GRID, GRID, 2)."""
    steps = np.linspace(-half, half, GRID)
    return np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1)


def _disc(radius: float) -> Array:
    """Rings and spokes, shape (RINGS, SPOKES, 2)."""
    rings, angles = np.linspace(0.0, radius, RINGS), np.linspace(0.0, 2.0 * np.pi, SPOKES)
    return np.stack([np.outer(rings, np.cos(angles)), np.outer(rings, np.sin(angles))], axis=-1)


def _patch(grid: Array, frame: Frame, height: Callable[[float, float], float]) -> Array:
    points = [frame.point(u, v, height(u, v)) for u, v in grid.reshape(-1, 2).tolist()]
    return np.array(points).reshape(*grid.shape[:2], 3)


def _cell(number: float) -> str:
    return f"{number:.9g}"
