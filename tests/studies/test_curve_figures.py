"""The figures over Weber factors: what is drawn is what was given, and the files say what they must."""

from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs matplotlib (extra: plots)")

from matplotlib.figure import Figure
from matplotlib.text import Text

from tests.studies.printed import assert_legible
from weberlink.studies.curve_figures import CurveFigures, QualityAxis, draw_curves
from weberlink.studies.curves import Curves, Observation, Point, curves

PREDICTORS = ("zoh", "linear", "plane", "sphere", "hybrid")
WEBERS = (0.025, 0.05, 0.10, 0.15, 0.20, 0.30)
RATING = QualityAxis("rating", "higher", (0.0, 5.0), "rating")
ERROR = QualityAxis("error, RMS [JND]", "lower", column="error_rms_jnd")
NAMES = ("packet_rate", "quality", "quality_over_rate")


def study(units: int = 6, predictors: tuple[str, ...] = PREDICTORS, idle: bool = False) -> Curves:
    random = Random(2)
    return curves(
        [
            Observation(
                f"s{unit}", predictor, weber, 0.0 if idle else random.uniform(5, 9) / weber, random.uniform(0, 5)
            )
            for unit in range(units)
            for predictor in predictors
            for weber in WEBERS
        ]
    )


def figures(found: Curves, quality: QualityAxis = RATING, mark: str | None = None) -> CurveFigures:
    return CurveFigures(found, quality, "some machine; commit abc", "a study", mark, "subjects")


def drawn(figure: Figure, predictor: str) -> tuple[list[float], list[float]]:
    (line,) = [line for line in figure.axes[0].get_lines() if line.get_label() == predictor]
    return list(line.get_xdata()), list(line.get_ydata())  # type: ignore[arg-type]


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


def means(points: list[Point], name: str) -> list[float]:
    return [getattr(point, name).mean for point in points]


def band(figure: Figure, predictor: str) -> Any:
    (filled,) = [one for one in figure.axes[0].collections if one.get_label() == f"_{predictor}"]
    return filled.get_paths()[0].vertices


@pytest.mark.parametrize("name", ["packets_per_s", "quality"])
def test_curves_over_weber_show_means_and_bands(name: str) -> None:
    found = study()
    made = figures(found)
    figure = made.packet_rate() if name == "packets_per_s" else made.quality_over_weber()
    for predictor, points in found.items():
        across, up = drawn(figure, predictor)
        assert across == pytest.approx([2.5, 5.0, 10.0, 15.0, 20.0, 30.0])
        assert up == means(points, name)
        corners = {(round(x, 6), y) for x, y in band(figure, predictor)}
        for point in points:
            for end in (getattr(point, name).low, getattr(point, name).high):
                assert (round(100.0 * point.weber, 6), end) in corners
    assert list(figure.axes[0].get_xticks()) == pytest.approx([2.5, 5.0, 10.0, 15.0, 20.0, 30.0])


def test_quality_over_rate_shows_means_and_bars_both_ways() -> None:
    found = study()
    figure = figures(found).quality_over_rate()
    bars = {container.get_label(): container for container in figure.axes[0].containers}
    for predictor, points in found.items():
        assert drawn(figure, predictor) == (means(points, "packets_per_s"), means(points, "quality"))
        _, _, (across, up) = bars[f"_{predictor}"]  # type: ignore[misc]
        for point, one, other in zip(points, across.get_segments(), up.get_segments(), strict=True):
            assert one[:, 0] == pytest.approx([point.packets_per_s.low, point.packets_per_s.high])
            assert other[:, 1] == pytest.approx([point.quality.low, point.quality.high])
    assert any("from k = 2.5 % (most packets) to 30 %" in text.replace("\n", " ") for text in texts(figure))


def test_better_is_up_and_said_so() -> None:
    rating, error = figures(study()).quality_over_weber().axes[0], figures(study(), ERROR).quality_over_rate().axes[0]
    low, high = rating.get_ylim()
    assert low < 0.0
    assert high > 5.0
    assert "(up is better)" in rating.get_ylabel()
    bottom, top = error.get_ylim()
    assert bottom > top == 0.0
    assert "(up is better: axis reversed)" in error.get_ylabel()


def test_rates_are_logarithmic_unless_there_is_none() -> None:
    assert figures(study()).packet_rate().axes[0].get_yscale() == "log"
    idle = figures(study(idle=True)).packet_rate().axes[0]
    assert idle.get_yscale() == "linear"
    assert idle.get_ylim()[0] == 0.0
    assert figures(study(idle=True)).quality_over_rate().axes[0].get_xlim()[0] == 0.0


def test_one_unit_is_said_to_have_no_interval() -> None:
    caption = " ".join(texts(figures(study(units=1)).packet_rate()))
    assert "One of subjects: no confidence interval." in caption
    assert "6 subjects and its 95 % confidence interval" in " ".join(texts(figures(study()).packet_rate()))


@pytest.mark.parametrize("mark", [None, "SIMULATED RATINGS"])
def test_the_mark_is_on_every_figure_in_title_and_across(mark: str | None) -> None:
    made = figures(study(), mark=mark)
    for figure in (made.packet_rate(), made.quality_over_weber(), made.quality_over_rate()):
        marks = [text for text in figure.findobj(Text) if "SIMULATED" in text.get_text()]
        assert len(marks) == (0 if mark is None else 2)
        assert not marks or max(text.get_fontsize() for text in marks) > 30.0


def test_text_is_large_enough_and_does_not_overlap() -> None:
    made = figures(study(), ERROR)
    for figure in (made.packet_rate(), made.quality_over_weber(), made.quality_over_rate()):
        assert_legible(figure)


def test_files_are_written_and_two_runs_give_equal_ones(tmp_path: Path) -> None:
    for run in ("one", "two"):
        (tmp_path / run).mkdir()
        draw_curves(
            study(), tmp_path / run, quality=RATING, caption="some machine; commit abc", title="a study",
            mark="SIMULATED RATINGS", units="subjects",
        )  # fmt: skip
    written = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert written == sorted([*(f"{name}{ending}" for name in NAMES for ending in (".png", ".svg")), "curves.csv"])
    for name in written:
        content = (tmp_path / "one" / name).read_bytes()
        assert content == (tmp_path / "two" / name).read_bytes()
        assert len(content) > (1000 if name == "curves.csv" else 10_000)
    for name in NAMES:
        svg = (tmp_path / "one" / f"{name}.svg").read_text(encoding="utf-8")
        for text in ("SIMULATED RATINGS", "some machine; commit abc", *PREDICTORS):
            assert f">{text}<" in svg
    assert (tmp_path / "one" / "curves.csv").read_text(encoding="utf-8").count("SIMULATED RATINGS") == 30


def test_ticks_too_near_to_each_other_are_left_out() -> None:
    found = curves([Observation("a", "zoh", weber, 9.0, 1.0) for weber in (0.1, 0.101, 0.2, 0.3)])
    assert np.allclose(figures(found).packet_rate().axes[0].get_xticks(), [10.0, 20.0, 30.0])
