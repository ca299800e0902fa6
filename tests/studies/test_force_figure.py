"""Forces over time: the drawn lines, marks and files hold the numbers of the runs."""

import csv
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs matplotlib (extra: studies)")

from matplotlib.figure import Figure
from matplotlib.text import Text

from tests.studies.coded import pressed, run
from tests.studies.printed import assert_legible
from weberlink.codec import force_channel
from weberlink.studies.coded_trace import CodedTrace, TickWindow
from weberlink.studies.force_figure import draw_force, force_figure, quantity

CAPTION = "some machine; commit abc"
WINDOW = TickWindow(5050, 5650)


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


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


@pytest.mark.parametrize("caption", [CAPTION, CAPTION + "\nmore\nand more\nand more"])
def test_text_is_legible(caption: str) -> None:
    assert_legible(force_figure([run("zoh"), run("hybrid")], WINDOW, "a title", caption))
