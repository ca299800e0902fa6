"""The page that figures share: looks that differ, a footer within the width, files that can be compared."""

from pathlib import Path

import pytest

pytest.importorskip("matplotlib", reason="needs matplotlib (extra: plots)")

from matplotlib.colors import to_rgb
from matplotlib.text import Text

from weberlink.codec.predictors import BANKS, PREDICTORS
from weberlink.studies.sheet import LINE, LOOKS, SMALLEST_PT, beside, footer, looks, save, sheet, watermark


def test_predictors_differ_without_colour_and_in_colour() -> None:
    assert set(LOOKS) == {*PREDICTORS, *BANKS}
    found = looks([*LOOKS, "cubic", "neural"])
    for part in range(3):
        assert len({str(look[part]) for look in found.values()}) == len(found)
    assert found["hybrid"] == LOOKS["hybrid"]
    assert all(len(to_rgb(look.colour)) == 3 for look in found.values())
    sizes = [look.size for look in LOOKS.values()]
    assert sizes == sorted(sizes, reverse=True)


def test_the_footer_is_wrapped_line_by_line() -> None:
    text = footer("short\n" + "word " * 60)
    assert text.startswith("short\n")
    assert max(map(len, text.splitlines())) <= LINE


def test_a_long_caption_takes_nothing_from_what_is_drawn() -> None:
    heights = []
    for caption in ("short", "long " * 200):
        figure = sheet(9.0, "a title", caption)
        axes = figure.add_subplot()
        figure.draw_without_rendering()
        heights.append(axes.get_window_extent().height)
    assert heights[1] == pytest.approx(heights[0], rel=0.05)


def test_nothing_leaves_the_page_nor_is_too_small() -> None:
    """A dollar sign is a dollar sign, and the longest footer line fits."""
    figure = sheet(
        9.0, "costs $5 and $6, " + "long " * 30, "x" * 40 + " " + "machine, versions; " * 20, "SIMULATED RATINGS"
    )
    axes = figure.add_subplot()
    watermark(axes, "SIMULATED RATINGS")
    figure.draw_without_rendering()
    texts = [text for text in figure.findobj(Text) if text.get_text()]
    assert any("costs $5 and $6" in text.get_text().replace("\n", " ") for text in texts)
    assert min(text.get_fontsize() for text in texts) >= SMALLEST_PT
    for text in texts:
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
