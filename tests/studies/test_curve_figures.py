"""The page that figures share, and the figures over Weber factors."""

from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import pytest

pytest.importorskip("matplotlib", reason="needs matplotlib (extra: studies)")

from matplotlib.figure import Figure
from matplotlib.text import Text

from tests.studies.printed import assert_legible
from weberlink.codec.predictors import BANKS, PREDICTORS
from weberlink.studies.curve_figures import CurveFigures, QualityAxis
from weberlink.studies.curves import Curves, Observation, curves
from weberlink.studies.experiment.plan import SCALE
from weberlink.studies.sheet import LINE, SMALLEST_PT, STYLES, beside, footer, save, sheet, styles, watermark

PAPER = ("zoh", "linear", "plane", "sphere", "hybrid")
WEBERS = (0.025, 0.05, 0.10, 0.15, 0.20, 0.30)
RATING = QualityAxis("rating", "higher", (0.0, 5.0), "rating", SCALE)
ERROR = QualityAxis("error, RMS [JND]", "lower", column="error_rms_jnd")
MARK = "SIMULATED RATINGS"


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


# --- the page


def test_predictors_differ_in_colour_line_and_marker() -> None:
    assert set(STYLES) == {*PREDICTORS, *BANKS}
    found = styles([*STYLES, "cubic", "neural"])
    for part in range(3):
        assert len({str(style[part]) for style in found.values()}) == len(found)
    sizes = [style.size for style in STYLES.values()]
    assert sizes == sorted(sizes, reverse=True)


def test_a_long_footer_leaves_the_figure_its_size() -> None:
    text = footer("short\n" + "word " * 60)
    assert text.startswith("short\n")
    assert max(map(len, text.splitlines())) <= LINE
    heights = []
    for caption in ("short", "long " * 200):
        figure = sheet(9.0, "a title", caption)
        axes = figure.add_subplot()
        figure.draw_without_rendering()
        heights.append(axes.get_window_extent().height)
    assert heights[1] == pytest.approx(heights[0], rel=0.05)


def test_nothing_leaves_the_page_nor_is_too_small() -> None:
    figure = sheet(9.0, "costs $5 and $6, " + "long " * 30, "x" * 40 + " " + "machine, versions; " * 20, MARK)
    watermark(figure.add_subplot(), MARK)
    figure.draw_without_rendering()
    shown = [text for text in figure.findobj(Text) if text.get_text()]
    assert any("costs $5 and $6" in text.get_text().replace("\n", " ") for text in shown)
    for text in shown:
        assert text.get_fontsize() >= SMALLEST_PT
        box = text.get_window_extent()
        assert figure.bbox.x0 <= box.x0
        assert box.x1 <= figure.bbox.x1


def test_equal_figures_give_equal_files_with_text_as_text(tmp_path: Path) -> None:
    for name in ("k=0.10", "again"):
        figure = sheet(8.0, "a title", "a caption")
        figure.add_subplot().plot([1.0, 2.0], [1.0, 3.0], marker="o")
        save(figure, tmp_path / name)
    for ending in (".png", ".svg"):
        first, second = (beside(tmp_path / name, ending).read_bytes() for name in ("k=0.10", "again"))
        assert first == second
    svg = (tmp_path / "k=0.10.svg").read_text(encoding="utf-8")
    assert ">a title</text>" in svg
    assert "<dc:date>" not in svg


# --- curves


@cache
def study(units: int = 6, idle: bool = False) -> Curves:
    random = Random(2)
    return curves(
        [
            Observation(
                f"s{unit}", predictor, weber, 0.0 if idle else random.uniform(5, 9) / weber, random.uniform(0, 5)
            )
            for unit in range(units)
            for predictor in PAPER
            for weber in WEBERS
        ]
    )


def figures(found: Curves, quality: QualityAxis = RATING, mark: str | None = None) -> CurveFigures:
    return CurveFigures(found, quality, "some machine; commit abc", "a study", mark, "subjects")


def drawn(figure: Figure, predictor: str) -> tuple[list[float], list[float]]:
    (line,) = [line for line in figure.axes[0].get_lines() if line.get_label() == predictor]
    return list(line.get_xdata()), list(line.get_ydata())  # type: ignore[arg-type]


def band(figure: Figure, predictor: str) -> Any:
    (filled,) = [one for one in figure.axes[0].collections if one.get_label() == f"_{predictor}"]
    return filled.get_paths()[0].vertices


@pytest.mark.parametrize("name", ["packets_per_s", "quality"])
def test_curves_over_weber_show_means_and_bands(name: str) -> None:
    made = figures(study())
    figure = made.packet_rate() if name == "packets_per_s" else made.quality_over_weber()
    for predictor, points in study().items():
        across, up = drawn(figure, predictor)
        assert across == pytest.approx([2.5, 5.0, 10.0, 15.0, 20.0, 30.0])
        assert up == [getattr(point, name).mean for point in points]
        corners = {(round(x, 6), y) for x, y in band(figure, predictor)}
        for point in points:
            for end in (getattr(point, name).low, getattr(point, name).high):
                assert (round(100.0 * point.weber, 6), end) in corners


def test_the_axis_of_ratings_has_the_words_of_the_scale() -> None:
    for figure in (figures(study()).quality_over_weber(), figures(study()).quality_over_rate()):
        labels = {int(place): text.get_text() for place, text in zip(*figure_ticks(figure), strict=True)}
        assert {level: " ".join(text.split()) for level, text in labels.items()} == {
            level: f"{words} {level}" for level, words in SCALE.items()
        }


def figure_ticks(figure: Figure) -> tuple[Any, list[Text]]:
    axes = figure.axes[0]
    return axes.get_yticks(), list(axes.get_yticklabels())


def test_quality_over_rate_shows_means_and_bars_both_ways() -> None:
    figure = figures(study()).quality_over_rate()
    bars = {container.get_label(): container for container in figure.axes[0].containers}
    for predictor, points in study().items():
        assert drawn(figure, predictor) == (
            [point.packets_per_s.mean for point in points],
            [point.quality.mean for point in points],
        )
        _, _, (across, up) = bars[f"_{predictor}"]  # type: ignore[misc]
        for point, one, other in zip(points, across.get_segments(), up.get_segments(), strict=True):
            assert one[:, 0] == pytest.approx([point.packets_per_s.low, point.packets_per_s.high])
            assert other[:, 1] == pytest.approx([point.quality.low, point.quality.high])
    assert any("from k = 2.5 % (most packets) to 30 %" in text.replace("\n", " ") for text in texts(figure))


def test_axes_show_better_up_and_rates_logarithmically() -> None:
    rating, error = figures(study()).quality_over_weber().axes[0], figures(study(), ERROR).quality_over_rate().axes[0]
    low, high = rating.get_ylim()
    assert low < 0.0
    assert high > 5.0
    assert "(up is better)" in rating.get_ylabel()
    bottom, top = error.get_ylim()
    assert bottom > top == 0.0
    assert "(up is better: axis reversed)" in error.get_ylabel()
    assert error.get_xscale() == "log"
    idle = figures(study(idle=True)).packet_rate().axes[0]
    assert idle.get_yscale() == "linear"
    assert idle.get_ylim()[0] == 0.0


def test_close_weber_ticks_are_left_out() -> None:
    found = curves([Observation("a", "zoh", weber, 9.0, 1.0) for weber in (0.1, 0.101, 0.2, 0.3)])
    figure = figures(found).packet_rate()
    assert list(figure.axes[0].get_xticks()) == pytest.approx([10.0, 20.0, 30.0])
    assert "One of subjects: no confidence interval." in " ".join(texts(figure))


@pytest.mark.parametrize("mark", [None, MARK])
def test_every_figure_is_legible_and_marked(mark: str | None) -> None:
    made = figures(study(), ERROR, mark)
    for figure in (made.packet_rate(), made.quality_over_weber(), made.quality_over_rate()):
        marks = [text for text in figure.findobj(Text) if "SIMULATED" in text.get_text()]
        assert len(marks) == (0 if mark is None else 2)
        if mark is None:
            assert_legible(figure)
            assert "6 subjects and its 95 % confidence interval" in " ".join(texts(figure)).replace("\n", " ")
        else:
            assert max(text.get_fontsize() for text in marks) > 30.0


def test_all_files_are_written(tmp_path: Path) -> None:
    figures(study(), mark=MARK).write(tmp_path)
    for name in ("packet_rate", "quality", "quality_over_rate"):
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000
        svg = (tmp_path / f"{name}.svg").read_text(encoding="utf-8")
        for text in (MARK, "some machine; commit abc", *PAPER):
            assert f">{text}<" in svg
    assert (tmp_path / "curves.csv").read_text(encoding="utf-8").count(MARK) == 30
