"""Captions of figures: printed below or not, always in the metadata; formats."""

from pathlib import Path

import pytest

pytest.importorskip("matplotlib")

from weberlink.studies.drawing import Drawing, current, drawn_as, formats_of
from weberlink.studies.sheet import footer_cm, save, sheet
from weberlink.system.configuration import ConfigurationError

CAPTION = "AMD EPYC; numpy 2.4"


def files(folder: Path, drawing: Drawing) -> dict[str, bytes]:
    with drawn_as(drawing):
        figure = sheet(3.0, "A title", CAPTION)
        figure.subplots().plot([0.0, 1.0])
        save(figure, folder / "k=0.10")
    return {path.suffix: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("footer", [True, False])
def test_metadata_have_the_caption_with_or_without_footer(footer: bool, tmp_path: Path) -> None:
    found = files(tmp_path, Drawing(footer, ("png", "svg", "pdf")))
    assert b"Description\x00" + CAPTION.encode() in found[".png"]
    metadata, _, body = found[".svg"].decode().partition("</metadata>")
    assert CAPTION in metadata
    assert (CAPTION in body) is footer
    assert f"/Subject ({CAPTION})".encode() in found[".pdf"]
    assert b"CreationDate" not in found[".pdf"]


def test_footer_makes_the_figure_higher() -> None:
    with_footer = footer_cm(CAPTION)
    with drawn_as(Drawing(footer=False)):
        assert footer_cm(CAPTION) == 0.0 < with_footer
        without = sheet(3.0, "A title", CAPTION).get_figheight()
    assert sheet(3.0, "A title", CAPTION).get_figheight() - without == pytest.approx(with_footer / 2.54)


def test_equal_figures_give_equal_files_in_every_format(tmp_path: Path) -> None:
    drawing = Drawing(formats=("png", "pdf", "svg"))
    first, second = tmp_path / "first", tmp_path / "second"
    for folder in (first, second):
        folder.mkdir()
    assert files(first, drawing) == files(second, drawing)


def test_drawing_ends_with_its_block(tmp_path: Path) -> None:
    assert set(files(tmp_path, Drawing(formats=("pdf",)))) == {".pdf"}
    assert current() == Drawing()


def test_formats_are_named_once_each() -> None:
    assert formats_of("PDF, svg,pdf") == ("pdf", "svg")
    assert formats_of(None) is None
    with pytest.raises(ConfigurationError, match="--format: 'jpg' is none of png, pdf, svg"):
        formats_of("png,jpg")
