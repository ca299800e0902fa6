"""The page that figures share, and the figures over Weber factors."""

from functools import cache
from pathlib import Path
from random import Random

import pytest

pytest.importorskip("matplotlib", reason="needs matplotlib (extra: studies)")

from matplotlib.figure import Figure
from matplotlib.text import Text
from pandas import DataFrame, read_csv

from tests.studies.printed import assert_legible
from weberlink.codec.predictors import BANKS, PREDICTORS
from weberlink.studies.curve_figures import CurveFigures, QualityAxis
from weberlink.studies.curves import curves
from weberlink.studies.experiment.plan import SCALE
from weberlink.studies.sheet import LINE, SMALLEST_PT, STYLES, beside, footer, save, sheet, styles, watermark

PAPER = ("zoh", "linear", "plane", "sphere", "hybrid")
WEBERS = (0.025, 0.05, 0.10, 0.15, 0.20, 0.30)
RATING = QualityAxis("quality", "rating", "higher", (0.0, 5.0), SCALE)
ERROR = QualityAxis("quality", "error, RMS [JND]", "lower")
MARK = "SIMULATED RATINGS"


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
def study(units: int = 6, idle: bool = False, webers: tuple[float, ...] = WEBERS) -> DataFrame:
    random = Random(2)
    rows = [
        (f"s{unit}", predictor, weber, 0.0 if idle else random.uniform(5, 9) / weber, random.uniform(0, 5))
        for unit in range(units)
        for predictor in PAPER
        for weber in webers
    ]
    return curves(DataFrame(rows, columns=["unit", "predictor", "weber", "packets_per_s", "quality"]), "quality")


def draw(name: str, found: DataFrame | None = None, quality: QualityAxis = RATING, mark: str | None = None) -> Figure:
    shown = study() if found is None else found
    return CurveFigures(shown, quality, "some machine; commit abc", "a study", mark, "subjects").figure(name)


def drawn(figure: Figure, predictor: str) -> tuple[list[float], list[float]]:
    (line,) = [line for line in figure.axes[0].get_lines() if line.get_label() == predictor]
    return list(line.get_xdata()), list(line.get_ydata())  # type: ignore[arg-type]


@pytest.mark.parametrize(("figure", "name"), [("packet_rate", "packets_per_s"), ("quality", "quality")])
def test_curves_over_weber_show_means_and_bands(figure: str, name: str) -> None:
    made = draw(figure)
    for predictor, points in study().groupby("predictor"):
        across, up = drawn(made, predictor)
        assert across == pytest.approx([2.5, 5.0, 10.0, 15.0, 20.0, 30.0])
        assert up == points[f"{name}_mean"].to_list()
        (filled,) = [one for one in made.axes[0].collections if one.get_label() == f"_{predictor}"]
        corners = {(round(x, 6), y) for x, y in filled.get_paths()[0].vertices}  # type: ignore[misc]
        for end in ("low", "high"):
            assert {*zip((100.0 * points.weber).round(6), points[f"{name}_{end}"], strict=True)} <= corners


@pytest.mark.parametrize("name", ["quality", "quality_over_rate"])
def test_the_axis_of_ratings_has_the_words_of_the_scale(name: str) -> None:
    axes = draw(name).axes[0]
    labels = zip(axes.get_yticks(), axes.get_yticklabels(), strict=True)
    assert {int(level): " ".join(text.get_text().split()) for level, text in labels} == {
        level: f"{words} {level}" for level, words in SCALE.items()
    }


def test_quality_over_rate_shows_means_and_bars_both_ways() -> None:
    figure = draw("quality_over_rate")
    bars = {container.get_label(): container for container in figure.axes[0].containers}
    for predictor, points in study().groupby("predictor"):
        assert drawn(figure, predictor) == (points.packets_per_s_mean.to_list(), points.quality_mean.to_list())
        _, _, (across, up) = bars[f"_{predictor}"]  # type: ignore[misc]
        for point, one, other in zip(points.itertuples(), across.get_segments(), up.get_segments(), strict=True):
            assert one[:, 0] == pytest.approx([point.packets_per_s_low, point.packets_per_s_high])
            assert other[:, 1] == pytest.approx([point.quality_low, point.quality_high])


def test_axes_show_better_up_and_rates_logarithmically() -> None:
    low, high = draw("quality").axes[0].get_ylim()
    assert low < 0.0
    assert high > 5.0
    error = draw("quality_over_rate", quality=ERROR).axes[0]
    bottom, top = error.get_ylim()
    assert bottom > top == 0.0
    assert error.get_xscale() == "log"
    idle = draw("packet_rate", study(idle=True)).axes[0]
    assert (idle.get_yscale(), idle.get_ylim()[0]) == ("linear", 0.0)


def test_close_weber_ticks_are_left_out() -> None:
    figure = draw("packet_rate", study(1, webers=(0.1, 0.101, 0.2, 0.3)))
    assert list(figure.axes[0].get_xticks()) == pytest.approx([10.0, 20.0, 30.0])


@pytest.mark.parametrize("name", ["packet_rate", "quality", "quality_over_rate"])
def test_every_figure_is_legible_and_marked(name: str) -> None:
    assert_legible(draw(name, quality=ERROR))
    marks = [text for text in draw(name, mark=MARK).findobj(Text) if "SIMULATED" in text.get_text()]
    assert len(marks) == 2
    assert max(text.get_fontsize() for text in marks) > 30.0


def test_all_files_are_written(tmp_path: Path) -> None:
    CurveFigures(study(), RATING, "some machine; commit abc", "a study", MARK).write(tmp_path)
    for name in ("packet_rate", "quality", "quality_over_rate"):
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000
        svg = (tmp_path / f"{name}.svg").read_text(encoding="utf-8")
        for text in (MARK, "some machine; commit abc", *PAPER):
            assert f">{text}<" in svg
    table = read_csv(tmp_path / "curves.csv")
    assert set(table.pop("mark")) == {MARK}
    assert table.equals(study())
