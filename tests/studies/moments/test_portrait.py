"""What a drawing of a fitted model shows, against scenes that are known."""

import csv
from math import inf
from pathlib import Path

import numpy as np
import pytest

from weberlink.codec import force_channel
from weberlink.codec.predictors.plane import Plane
from weberlink.codec.predictors.sphere import Sphere
from weberlink.geometry.vector import Vector
from weberlink.master.trace import Trace
from weberlink.slave.scenes import plane, sphere
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.shape import Shape
from weberlink.studies.moments.moments import Fit, fits, longest
from weberlink.studies.moments.portrait import Portrait, portrait

FINE = {"force_step": 1e-6, "position_step": 1e-9, "saturates": False}
TABLE = plane.PlaneShape((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
BALL = sphere.SphereShape((0.0, 0.0, -0.03), 0.03)
BOWL = sphere.SphereShape((0.0, 0.0, 0.03), 0.03, inside=True)


def scene(*shapes: Shape) -> Scene:
    return Scene([SceneObject(shape, 500.0) for shape in shapes])


def slide(touched: Scene, bend: float, leave: bool = False) -> Trace:
    """A curved path of 0.8 s over the surface at z = 0, pressed in ever deeper; then, if wanted, 0.2 s in the air."""
    s = np.linspace(-1.0, 1.0, 800)
    positions = np.column_stack([0.012 * s, 0.003 * np.sin(2.0 * s), bend * (0.012 * s) ** 2 - 0.003 - 0.001 * s])
    if leave:
        positions = np.vstack([positions, np.full((200, 3), 0.05)])
    forces = np.array([touched.force((x, y, z), 1e-3) for x, y, z in positions.tolist()])
    return Trace(np.arange(len(positions)) * 1e-3, positions, forces, np.empty((0, 2)))


def taken(trace: Trace, predictor: str, kind: type[Plane | Sphere], touched: Scene | None) -> tuple[Fit, Portrait]:
    fit = longest(fits(trace, force_channel(predictor=predictor, weber=0.02, **FINE)), kind)  # type: ignore[arg-type]
    assert fit is not None
    return fit, portrait(trace, fit, fit.newest.tick + 1, touched)


def parameters(drawn: Portrait) -> dict[str, tuple[float, float | None]]:
    return {one.name: (one.fitted, one.scene) for one in drawn.parameters}


def test_a_plane_and_its_parameters() -> None:
    touched = scene(TABLE)
    fit, drawn = taken(slide(touched, 0.0), "plane", Plane, touched)
    numbers = parameters(drawn)
    assert numbers["stiffness"] == pytest.approx((500.0, 500.0), rel=1e-3)
    assert numbers["normal z"] == pytest.approx((1.0, 1.0))
    assert numbers["normal off by"][0] == pytest.approx(0.0, abs=1e-3)
    assert numbers["surface off by"][0] == pytest.approx(0.0, abs=1e-3)
    assert "radius" not in numbers
    assert drawn.patch_m[..., 2] == pytest.approx(0.0, abs=1e-6)
    assert drawn.scene_patch_m is not None
    assert drawn.scene_patch_m[..., 2] == pytest.approx(0.0, abs=1e-6)
    for axis in range(2):  # the patch reaches beyond the path, and the scene beyond the patch
        path, patch, wide = drawn.positions_m[:, axis], drawn.patch_m[..., axis], drawn.scene_patch_m[..., axis]
        assert wide.min() < patch.min() < path.min()
        assert path.max() < patch.max() < wide.max()
    assert [sample.tick for sample in drawn.samples] == [fit.previous.tick, fit.newest.tick]  # type: ignore[union-attr]


@pytest.mark.parametrize(("shape", "radius", "bend"), [(BALL, 30.0, -16.0), (BOWL, -30.0, 16.0)])
def test_a_sphere_and_its_parameters(shape: Shape, radius: float, bend: float) -> None:
    touched = scene(shape)
    _, drawn = taken(slide(touched, bend), "sphere", Sphere, touched)
    numbers = parameters(drawn)
    assert numbers["radius"][0] == pytest.approx(radius, rel=0.05)
    assert numbers["radius"][1] == pytest.approx(radius, rel=1e-4)
    centre: Vector = (0.0, 0.0, -radius)
    for axis, name in enumerate("xyz"):
        fitted, true = numbers[f"centre {name}"]
        assert fitted == pytest.approx(centre[axis], abs=1.0)
        assert true == pytest.approx(centre[axis], abs=1e-2)
    ring = drawn.patch_m.reshape(-1, 3) - np.array(drawn.model.centre)  # type: ignore[union-attr]
    assert np.linalg.norm(ring, axis=1) == pytest.approx(abs(drawn.model.radius))  # type: ignore[union-attr]
    assert drawn.scene_patch_m is not None
    points = drawn.scene_patch_m.reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    assert len(points) > 100
    assert np.linalg.norm(points - np.array([0.0, 0.0, -1e-3 * radius]), axis=1) == pytest.approx(0.03, abs=1e-6)


def test_a_plane_fitted_on_a_ball_is_told_from_it() -> None:
    touched = scene(BALL)
    _, drawn = taken(slide(touched, -16.0), "plane", Plane, touched)
    along = np.linspace(-0.005, 0.005, 11)
    fitted, true = drawn.fitted_section(along), drawn.scene_section(along)
    assert true is not None
    assert np.diff(fitted, 2) == pytest.approx(0.0, abs=1e-9)
    assert (np.diff(true, 2) < -1e-6).all()


def test_a_flat_scene_has_no_radius_nor_centre() -> None:
    touched = scene(BALL)
    trace = slide(touched, -16.0)
    numbers = parameters(taken(trace, "sphere", Sphere, scene(TABLE))[1])
    assert numbers["radius"][1] == inf
    assert numbers["centre x"][1] is None


def test_the_path_ends_where_the_probe_leaves_the_surface() -> None:
    touched = scene(TABLE)
    trace = slide(touched, 0.0, leave=True)
    fit = fits(trace, force_channel(predictor="plane", weber=0.02, **FINE))[-1]  # type: ignore[arg-type]
    assert isinstance(fit.model, Plane)
    assert fit.until == 1000
    drawn = portrait(trace, fit, fit.newest.tick, touched)
    assert drawn.ticks[-1] == 799
    assert fit.previous is not None
    assert drawn.ticks[0] == fit.previous.tick
    assert drawn.positions_m == pytest.approx(trace.position_m[drawn.ticks])
    assert drawn.ticks[drawn.place] == drawn.tick


def test_without_a_scene_only_the_fit_is_shown() -> None:
    for unknown in (None, scene()):
        _, drawn = taken(slide(scene(TABLE), 0.0), "plane", Plane, unknown)
        assert drawn.scene_patch_m is None
        assert all(one.scene is None for one in drawn.parameters)
    assert [one.name for one in drawn.parameters] == ["stiffness", "normal x", "normal y", "normal z"]


def test_a_hold_has_no_surface() -> None:
    trace = slide(scene(TABLE), 0.0)
    fit = fits(trace, force_channel(predictor="zoh"))[0]
    with pytest.raises(ValueError, match=r"tick 0: a Hold is in force; expected a Plane or a Sphere"):
        portrait(trace, fit, 0, None)


def test_the_tables_hold_what_is_drawn(tmp_path: Path) -> None:
    touched = scene(TABLE)
    _, drawn = taken(slide(touched, 0.0), "plane", Plane, touched)
    drawn.write_csv(tmp_path / "points.csv", tmp_path / "parameters.csv")
    with (tmp_path / "points.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    path = [row for row in rows if row["kind"] == "trajectory"]
    assert [int(row["tick"]) for row in path] == drawn.ticks.tolist()
    forces = [[float(row[name]) for name in ("fx_n", "fy_n", "fz_n")] for row in path]
    assert np.array(forces) == pytest.approx(drawn.forces_n)
    for kind, count in (("sample", 2), ("fitted_surface", 625), ("scene_surface", 625)):
        assert sum(row["kind"] == kind for row in rows) == count
    with (tmp_path / "parameters.csv").open(newline="", encoding="utf-8") as file:
        table = {row["parameter"]: row for row in csv.DictReader(file)}
    assert table["stiffness"]["unit"] == "N/m"
    assert float(table["stiffness"]["fitted"]) == pytest.approx(drawn.model.stiffness)
    assert table["normal off by"]["scene"] == ""
