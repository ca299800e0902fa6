"""What can be read on a figure, for tests that nothing covers anything else."""

from itertools import combinations

from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import BboxBase

from weberlink.studies.sheet import SMALLEST_PT


def printed(figure: Figure) -> dict[Text, BboxBase]:
    """Every text that is drawn, and where; a figure also holds labels of ticks outside the view."""
    figure.draw_without_rendering()
    left_out: set[Text] = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]:
                if not low <= tick.get_loc() <= high:
                    left_out |= {tick.label1, tick.label2}
    texts = [text for text in figure.findobj(Text) if text.get_text().strip() and text.get_visible()]
    return {text: text.get_window_extent() for text in texts if text not in left_out}


def assert_legible(figure: Figure) -> None:
    """Large enough, on the page, and no text on another."""
    shown = printed(figure)
    assert len(shown) > 12
    for text, box in shown.items():
        assert text.get_fontsize() >= SMALLEST_PT, text.get_text()
        assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1, text.get_text()
        assert figure.bbox.y0 <= box.y0 < box.y1 <= figure.bbox.y1, text.get_text()
    for (one, box), (other, second) in combinations(shown.items(), 2):
        assert not box.overlaps(second), (one.get_text(), other.get_text())
