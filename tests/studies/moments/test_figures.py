"""Figures of moments: the numbers of a fitted model against known scenes, and what is drawn of runs and models."""

import csv
from functools import cache
from math import inf
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs matplotlib (extra: plots)")

from matplotlib.figure import Figure
from matplotlib.text import Text

from tests.studies.moments.shipped import own, pressed, run
from tests.studies.printed import assert_legible
from weberlink.codec import force_channel
from weberlink.codec.predictors.model import ModelKind
from weberlink.master.trace import Trace
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.shape import Shape
from weberlink.slave.scenes.solids import PlaneShape, SphereShape
from weberlink.studies.moments.figures import draw_force, draw_model, force_figure, model_figure, quantity
from weberlink.studies.moments.moments import CodedTrace, ModelFit, TickWindow, longest
from weberlink.studies.moments.portrait import Portrait, portrait

CAPTION = "some machine; commit abc"
WINDOW = TickWindow(5050, 5650)
CHANNEL = force_channel(position_step=2e-6)
TABLE = PlaneShape((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
BALL = SphereShape((0.0, 0.0, -0.03), 0.03)
BOWL = SphereShape((0.0, 0.0, 0.03), 0.03, inside=True)
DOME = SphereShape((-0.035, 0.015, -0.01), 0.025)


def scene(*shapes: Shape) -> Scene:
    return Scene([SceneObject(shape, 500.0) for shape in shapes])


def slide(touched: Scene, bend: float, leave: bool = False) -> Trace:
    """A curved path of 0.8 s over the surface at z = 0, pressed in ever deeper; then optionally 0.2 s in the air."""
    s = np.linspace(-1.0, 1.0, 800)
    positions = np.column_stack([0.012 * s, 0.003 * np.sin(2.0 * s), bend * (0.012 * s) ** 2 - 0.003 - 0.001 * s])
    if leave:
        positions = np.vstack([positions, np.full((200, 3), 0.05)])
    forces = np.array([touched.force((x, y, z), 1e-3) for x, y, z in positions.tolist()])
    return Trace(np.arange(len(positions)) * 1e-3, positions, forces, np.empty((0, 2)))


def taken(trace: Trace, predictor: str, touched: Scene | None) -> tuple[ModelFit, Portrait]:
    channel = force_channel(predictor=predictor, weber=0.02, force_step=1e-6, position_step=1e-9, saturates=False)
    fit = longest(CodedTrace(trace, channel).fits)
    assert fit is not None
    return fit, portrait(trace, fit, fit.newest.tick + 1, touched)


def parameters(drawn: Portrait) -> dict[str, tuple[float, float | None]]:
    return {one.name: (one.fitted, one.scene) for one in drawn.parameters}


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


# --- the numbers of a fitted model


def test_a_plane_and_its_parameters() -> None:
    touched = scene(TABLE)
    fit, drawn = taken(slide(touched, 0.0), "plane", touched)
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
    assert fit.previous is not None
    assert [sample.tick for sample in drawn.samples] == [fit.previous.tick, fit.newest.tick]


@pytest.mark.parametrize(("shape", "radius", "bend"), [(BALL, 30.0, -16.0), (BOWL, -30.0, 16.0)])
def test_a_sphere_and_its_parameters(shape: Shape, radius: float, bend: float) -> None:
    touched = scene(shape)
    trace = slide(touched, bend)
    _, drawn = taken(trace, "sphere", touched)
    numbers = parameters(drawn)
    assert numbers["radius"][0] == pytest.approx(radius, rel=0.05)
    assert numbers["radius"][1] == pytest.approx(radius, rel=1e-4)
    for axis, name in enumerate("xyz"):
        fitted, true = numbers[f"centre {name}"]
        assert fitted == pytest.approx((0.0, 0.0, -radius)[axis], abs=1.0)
        assert true == pytest.approx((0.0, 0.0, -radius)[axis], abs=1e-2)
    ring = drawn.patch_m.reshape(-1, 3) - np.array(drawn.surface.centre)
    assert np.linalg.norm(ring, axis=1) == pytest.approx(abs(drawn.surface.radius))
    assert drawn.scene_patch_m is not None
    points = drawn.scene_patch_m.reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    assert len(points) > 100
    assert np.linalg.norm(points - np.array([0.0, 0.0, -1e-3 * radius]), axis=1) == pytest.approx(0.03, abs=1e-6)
    flat = parameters(taken(trace, "sphere", scene(TABLE))[1])
    assert (flat["radius"][1], flat["centre x"][1]) == (inf, None)


def test_a_plane_fitted_on_a_ball_is_flat() -> None:
    touched = scene(BALL)
    _, drawn = taken(slide(touched, -16.0), "plane", touched)
    along = np.linspace(-0.005, 0.005, 11)
    true = drawn.scene_section(along)
    assert true is not None
    assert np.diff(drawn.fitted_section(along), 2) == pytest.approx(0.0, abs=1e-9)
    assert (np.diff(true, 2) < -1e-6).all()


def test_the_path_ends_where_the_probe_leaves_the_surface() -> None:
    touched = scene(TABLE)
    trace = slide(touched, 0.0, leave=True)
    fit, drawn = taken(trace, "plane", touched)
    assert fit.until == 1000
    assert fit.previous is not None
    assert (drawn.ticks[0], drawn.ticks[-1]) == (fit.previous.tick, 799)
    assert drawn.positions_m == pytest.approx(trace.position_m[drawn.ticks])
    assert drawn.ticks[drawn.place] == drawn.tick


def test_without_a_scene_only_the_fit_is_shown() -> None:
    for unknown in (None, scene()):
        _, drawn = taken(slide(scene(TABLE), 0.0), "plane", unknown)
        assert drawn.scene_patch_m is None
        assert all(one.scene is None for one in drawn.parameters)
    assert [one.name for one in drawn.parameters] == ["stiffness", "normal x", "normal y", "normal z"]


# --- forces over time


def test_forces_and_sends_are_drawn() -> None:
    runs = [run("zoh"), run("hybrid")]
    figure = force_figure(runs, WINDOW, "a title", CAPTION)
    part = slice(*WINDOW)
    for axes, coded in zip(figure.axes, runs, strict=True):
        lines = {str(line.get_label()): line for line in axes.get_lines()}
        force = np.linalg.norm(coded.trace.force_n[part], axis=1)
        assert lines["actual"].get_xdata() == pytest.approx(coded.trace.time_s[part])
        assert lines["actual"].get_ydata() == pytest.approx(force)
        shown = np.asarray(lines["displayed"].get_ydata())
        assert shown[0::2] == pytest.approx(np.linalg.norm(coded.predicted_n[part], axis=1))
        assert shown[1::2] == pytest.approx(np.linalg.norm(coded.displayed_n[part], axis=1))
        sends = coded.trace.time_s[part][coded.sent[part]]
        assert lines["ticks"].get_xdata() == pytest.approx(sends)
        for index, name in enumerate(coded.bank):
            mine = coded.trace.time_s[part][coded.sent[part] & (coded.selected[part] == index)]
            assert lines[f"sent {name}"].get_xdata() == pytest.approx(mine)
        assert axes.get_title(loc="left") == f"{coded.predictor}: {len(sends)} sends in 0.6 s"
        corners = axes.collections[0].get_paths()[0].vertices[:, 1]
        assert corners.max() == pytest.approx((force + coded.bound_n[part]).max())
        assert corners.min() == pytest.approx((force - coded.bound_n[part]).min())
    assert {"sent", *(f"hybrid: {name}" for name in run("hybrid").bank)} <= set(texts(figure))
    assert any("The deadband is a ball" in text for text in texts(figure))


@pytest.mark.parametrize(("axis", "sign"), [(0, 1.0), (2, -1.0)])
def test_one_axis_is_drawn_with_its_sign(axis: int, sign: float) -> None:
    trace = pressed(lambda t: sign * (2.0 + float(np.sin(20.0 * t))), 0.5, axis)
    coded = CodedTrace(trace, force_channel(predictor="zoh"))
    label, (actual, predicted, displayed) = quantity(coded, TickWindow(10, 400))
    assert label == f"force along {'xyz'[axis]} [N]"
    assert actual == pytest.approx(coded.trace.force_n[10:400, axis])
    assert predicted == pytest.approx(coded.predicted_n[10:400, axis])
    assert displayed == pytest.approx(coded.displayed_n[10:400, axis])


def test_force_files_hold_the_drawn_numbers(tmp_path: Path) -> None:
    draw_force([run("zoh"), run("linear")], tmp_path / "k=0.10", title="a title", caption=CAPTION, seconds=0.25)
    assert (tmp_path / "k=0.10.png").stat().st_size > 10_000
    svg = (tmp_path / "k=0.10.svg").read_text(encoding="utf-8")
    for text in ("a title", CAPTION, "actual", "displayed", "deadband", "sent", "|force| [N]"):
        assert f">{text}<" in svg
    with (tmp_path / "k=0.10.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["predictor"] == "linear"]
    assert len(rows) == 250
    part = slice(first := round(1e3 * float(rows[0]["t_s"])), first + 250)
    assert [int(row["sent"]) for row in rows] == run("linear").sent[part].astype(int).tolist()
    actual = np.linalg.norm(run("linear").trace.force_n[part], axis=1)
    assert [float(row["actual_n"]) for row in rows] == pytest.approx(actual.tolist())
    assert {row["selected"] for row in rows} == {"linear"}


# --- the fitted model


@cache
def drawn(kind: ModelKind) -> Portrait:
    fit = longest(CodedTrace(own(), CHANNEL).fits, kind)
    assert fit is not None
    return portrait(own(), fit, (fit.newest.tick + fit.until) // 2, scene(TABLE, DOME))


def test_a_model_is_drawn_in_millimetres_beside_the_scene() -> None:
    shown = drawn(ModelKind.SPHERE)
    figure = model_figure(shown, "a title", CAPTION)
    space, section = figure.axes
    paths = [np.array(line.get_data_3d()).T for line in space.get_lines()]  # type: ignore[attr-defined]
    assert paths[0] == pytest.approx(1e3 * shown.positions_m)
    assert [path[0] for path in paths[1:3]] == [pytest.approx(1e3 * np.array(one.position)) for one in shown.samples]
    assert paths[3][0] == pytest.approx(1e3 * shown.positions_m[shown.place])
    scene_line, fitted_line, path_line = section.get_lines()[:3]
    across = 1e-3 * np.asarray(fitted_line.get_xdata())
    assert fitted_line.get_ydata() == pytest.approx(1e3 * shown.fitted_section(across), nan_ok=True)
    true = shown.scene_section(across)
    assert true is not None
    assert scene_line.get_ydata() == pytest.approx(1e3 * true, nan_ok=True)
    assert np.nanmax(np.abs(true - shown.fitted_section(across))) < 2e-4
    path = 1e3 * shown.frame.coordinates(shown.positions_m)
    assert path_line.get_ydata() == pytest.approx(path[:, 2])
    (table,) = [text for text in texts(figure) if "stiffness" in text]
    rows = {line.split()[0]: line.split()[-2:] for line in table.splitlines()}
    assert rows["fitted"] == ["fitted", "scene"]
    assert float(rows["stiffness"][0]) == pytest.approx(500.0, rel=0.02)
    assert rows["radius"] == ["25.1", "25.0"]


@pytest.mark.parametrize(
    ("kind", "caption"), [(ModelKind.PLANE, CAPTION), (ModelKind.SPHERE, CAPTION + "\nmore\nand more\nand more")]
)
def test_text_is_legible(kind: ModelKind, caption: str) -> None:
    model = model_figure(drawn(kind), "a title", caption)
    assert_legible(model, model.axes[0])
    assert_legible(force_figure([run("zoh"), run("hybrid")], WINDOW, "a title", caption))


def test_model_files_are_complete(tmp_path: Path) -> None:
    shown = drawn(ModelKind.SPHERE)
    draw_model(
        CodedTrace(own(), CHANNEL), shown.tick, tmp_path / "one", scene(TABLE, DOME), title="a title", caption=CAPTION
    )
    assert (tmp_path / "one.png").stat().st_size > 50_000
    svg = (tmp_path / "one.svg").read_text(encoding="utf-8")
    for text in ("a title", CAPTION, "fitted sphere", "surface of the scene", f"the moment, tick {shown.tick}"):
        assert f">{text}<" in svg
    with (tmp_path / "one.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    path = [row for row in rows if row["kind"] == "trajectory"]
    assert [int(row["tick"]) for row in path] == shown.ticks.tolist()
    forces = [[float(row[name]) for name in ("fx_n", "fy_n", "fz_n")] for row in path]
    assert np.array(forces) == pytest.approx(shown.forces_n)
    kinds = [row["kind"] for row in rows]
    assert kinds.count("sample") == 2
    assert min(kinds.count("fitted_surface"), kinds.count("scene_surface")) > 400
    with (tmp_path / "one_parameters.csv").open(newline="", encoding="utf-8") as file:
        table = {row["parameter"]: row for row in csv.DictReader(file)}
    assert table["stiffness"]["unit"] == "N/m"
    assert float(table["stiffness"]["fitted"]) == pytest.approx(shown.surface.stiffness)
    assert table["normal off by"]["scene"] == ""


def test_a_model_without_a_surface_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="tick 3000: the model in use is a Hold, which has no surface"):
        draw_model(run("zoh"), 3000, tmp_path / "model", title="a title", caption=CAPTION)
    assert list(tmp_path.iterdir()) == []
