"""The figures of a moment: what is drawn is what the run did, and the files say what they must."""

import csv
from functools import cache
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs matplotlib (extra: plots)")

from matplotlib.figure import Figure
from matplotlib.text import Text

from tests.studies.printed import assert_legible
from weberlink.codec import force_channel
from weberlink.codec.predictors.plane import Plane
from weberlink.codec.predictors.sphere import Sphere
from weberlink.master.trace import Trace, read_trace
from weberlink.slave.scenes import plane, sphere
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.studies.moments.model_figure import model_figure
from weberlink.studies.moments.moment_figures import draw_force, draw_model, force_figure, quantity
from weberlink.studies.moments.moments import Coded, Window, fits, follow, longest
from weberlink.studies.moments.portrait import Portrait, portrait

OWN = Path(__file__).parents[3] / "configs" / "traces" / "operator.csv"
CAPTION = "some machine; commit abc"
WINDOW = Window(5050, 5650)
CHANNEL = force_channel(position_step=2e-6)


@cache
def own() -> Trace:
    return read_trace(OWN)


@cache
def run(predictor: str) -> Coded:
    return follow(own(), force_channel(predictor=predictor))


def scene() -> Scene:
    """The parts of the trace's scene that its probe reaches."""
    parts = plane.PlaneShape((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), sphere.SphereShape((-0.035, 0.015, -0.01), 0.025)
    return Scene([SceneObject(part, 500.0) for part in parts])


@cache
def drawn(kind: type[Plane | Sphere]) -> Portrait:
    fit = longest(fits(own(), CHANNEL), kind)
    assert fit is not None
    return portrait(own(), fit, (fit.newest.tick + fit.until) // 2, scene())


def alone(axis: int, sign: float) -> Coded:
    """A run whose force lies on one axis."""
    time = np.arange(500) * 1e-3
    forces = np.zeros((500, 3))
    forces[:, axis] = sign * (2.0 + np.sin(20.0 * time))
    return follow(Trace(time, -forces / 500.0, forces, np.empty((0, 2))), force_channel(predictor="zoh"))


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


def test_forces_are_drawn_as_they_were_and_sends_where_they_were() -> None:
    runs = [run("zoh"), run("linear"), run("hybrid")]
    figure = force_figure(runs, WINDOW, "a title", CAPTION)
    assert len(figure.axes) == 3
    for axes, coded in zip(figure.axes, runs, strict=True):
        part = slice(*WINDOW)
        lines = {str(line.get_label()): line for line in axes.get_lines()}
        assert lines["actual"].get_xdata() == pytest.approx(coded.time_s[part])
        assert lines["actual"].get_ydata() == pytest.approx(np.linalg.norm(coded.force_n[part], axis=1))
        shown = np.asarray(lines["displayed"].get_ydata())
        assert shown[0::2] == pytest.approx(np.linalg.norm(coded.predicted_n[part], axis=1))
        assert shown[1::2] == pytest.approx(np.linalg.norm(coded.displayed_n[part], axis=1))
        sends = coded.time_s[part][coded.sent[part]]
        assert lines["ticks"].get_xdata() == pytest.approx(sends)
        marked = np.concatenate([np.asarray(lines[f"sent {name}"].get_xdata()) for name in coded.bank])
        assert np.sort(marked) == pytest.approx(sends)
        assert axes.get_title(loc="left") == f"{coded.predictor}: {len(sends)} sends in 0.6 s"
        (band,) = axes.collections
        corners = band.get_paths()[0].vertices[:, 1]
        force = np.linalg.norm(coded.force_n[part], axis=1)
        assert corners.max() == pytest.approx((force + coded.bound_n[part]).max())
        assert corners.min() == pytest.approx((force - coded.bound_n[part]).min())


def test_a_hybrid_shows_its_choices() -> None:
    figure = force_figure([run("hybrid")], WINDOW, "a title", CAPTION)
    coded, lines = run("hybrid"), {str(line.get_label()): line for line in figure.axes[0].get_lines()}
    part = slice(*WINDOW)
    for index, name in enumerate(coded.bank):
        mine = coded.time_s[part][coded.sent[part] & (coded.selected[part] == index)]
        assert lines[f"sent {name}"].get_xdata() == pytest.approx(mine)
        assert f"hybrid: {name}" in texts(figure)
    assert "sent" not in texts(figure)
    assert "sent" in texts(force_figure([run("zoh")], WINDOW, "a title", CAPTION))


@pytest.mark.parametrize(("axis", "sign"), [(0, 1.0), (2, -1.0)])
def test_a_force_on_one_axis_is_drawn_with_its_sign(axis: int, sign: float) -> None:
    coded = alone(axis, sign)
    label, (actual, predicted, displayed) = quantity(coded, Window(10, 400))
    assert label == f"force along {'xyz'[axis]} [N]"
    assert actual == pytest.approx(coded.force_n[10:400, axis])
    assert predicted == pytest.approx(coded.predicted_n[10:400, axis])
    assert displayed == pytest.approx(coded.displayed_n[10:400, axis])
    remark = "The deadband is a ball"
    assert not any(remark in text for text in texts(force_figure([coded], Window(10, 400), "a title", CAPTION)))
    assert any(remark in text for text in texts(force_figure([run("zoh")], WINDOW, "a title", CAPTION)))


def test_the_surfaces_samples_and_path_are_drawn_in_millimetres() -> None:
    shown = drawn(Sphere)
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
    assert path_line.get_xdata() == pytest.approx(path[:, 0])
    assert path_line.get_ydata() == pytest.approx(path[:, 2])
    assert path[:, 2].max() < np.nanmax(1e3 * true)


def test_the_parameters_stand_beside_those_of_the_scene() -> None:
    (table,) = [text for text in texts(model_figure(drawn(Sphere), "a title", CAPTION)) if "stiffness" in text]
    rows = {line.split()[0]: line.split()[-2:] for line in table.splitlines()}
    assert rows["fitted"] == ["fitted", "scene"]
    assert float(rows["stiffness"][0]) == pytest.approx(500.0, rel=0.02)
    assert rows["stiffness"][1] == "500.0"
    assert rows["radius"] == ["25.1", "25.0"]


@pytest.mark.parametrize("kind", [Plane, Sphere])
@pytest.mark.parametrize("caption", [CAPTION, CAPTION + "\nmore\nand more\nand more"])
def test_text_is_large_enough_and_does_not_overlap(kind: type[Plane | Sphere], caption: str) -> None:
    model = model_figure(drawn(kind), "a title", caption)
    assert_legible(model, model.axes[0])
    assert_legible(force_figure([run("zoh"), run("hybrid")], WINDOW, "a title", caption))


def test_force_files_are_equal_and_the_table_is_what_was_drawn(tmp_path: Path) -> None:
    runs = [run("zoh"), run("linear")]
    for name in ("k=0.10", "again"):
        draw_force(runs, tmp_path / name, title="a title", caption=CAPTION, window=WINDOW)
    for ending in (".png", ".svg", ".csv"):
        content = (tmp_path / f"k=0.10{ending}").read_bytes()
        assert content == (tmp_path / f"again{ending}").read_bytes()
        assert len(content) > 10_000
    svg = (tmp_path / "k=0.10.svg").read_text(encoding="utf-8")
    for text in ("a title", CAPTION, "actual", "displayed", "deadband", "sent", "|force| [N]"):
        assert f">{text}<" in svg
    with (tmp_path / "k=0.10.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["predictor"] == "linear"]
    part = slice(*WINDOW)
    assert [int(row["sent"]) for row in rows] == run("linear").sent[part].astype(int).tolist()
    actual = np.linalg.norm(run("linear").force_n[part], axis=1)
    assert [float(row["actual_n"]) for row in rows] == pytest.approx(actual.tolist())
    assert {row["selected"] for row in rows} == {"linear"}


def test_without_a_window_the_first_run_chooses_one(tmp_path: Path) -> None:
    draw_force([run("zoh")], tmp_path / "force", title="a title", caption=CAPTION, seconds=0.25)
    with (tmp_path / "force.csv").open(newline="", encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 250


def test_model_files_are_equal_and_complete(tmp_path: Path) -> None:
    tick = drawn(Sphere).tick
    for name in ("one", "two"):
        draw_model(own(), CHANNEL, tick, tmp_path / name, scene(), title="a title", caption=CAPTION)
    for ending, least in ((".png", 50_000), (".svg", 50_000), (".csv", 10_000), ("_parameters.csv", 200)):
        content = (tmp_path / f"one{ending}").read_bytes()
        assert content == (tmp_path / f"two{ending}").read_bytes()
        assert len(content) > least
    svg = (tmp_path / "one.svg").read_text(encoding="utf-8")
    for text in ("a title", CAPTION, "fitted sphere", "surface of the scene", f"the moment, tick {tick}"):
        assert f">{text}<" in svg


def test_without_a_scene_the_figure_does_not_speak_of_one(tmp_path: Path) -> None:
    draw_model(own(), CHANNEL, drawn(Plane).tick, tmp_path / "model", title="a title", caption=CAPTION)
    svg = (tmp_path / "model.svg").read_text(encoding="utf-8")
    assert ">fitted plane<" in svg
    assert "scene" not in svg


def test_a_moment_without_a_surface_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="a Hold is in force"):
        draw_model(own(), force_channel(predictor="zoh"), 3000, tmp_path / "model", title="a title", caption=CAPTION)
    assert list(tmp_path.iterdir()) == []
