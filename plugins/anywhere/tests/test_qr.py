"""QR codes in a terminal, as another library reads them from a picture of its lines."""

import numpy as np
import pytest

from weberlink_anywhere.invitation import Invitation
from weberlink_anywhere.qr import drawing

TEXT = str(Invitation("7-confidence-ribcage", "ws://relay.example:4000/v1"))
LONG = str(Invitation("123-microscope-yesteryear", "wss://relay.robotics.university.example/v1"))
HALVES = {" ": (0, 0), "▀": (1, 0), "▄": (0, 1), "█": (1, 1)}
"""Which halves of a cell are light."""


def qr_codes(lines: list[str], ground: int) -> list[str]:
    """Texts of the codes in lines of light characters, on a screen whose other cells are `ground` (0 dark to 255)."""
    zxingcpp = pytest.importorskip("zxingcpp")
    halves = np.array([[HALVES[letter][half] for letter in line] for line in lines for half in (0, 1)], np.uint8)
    picture = np.pad(255 * halves.repeat(6, axis=0).repeat(6, axis=1), 6, constant_values=ground)
    return [found.text for found in zxingcpp.read_barcodes(picture)]


@pytest.mark.parametrize("ground", [0, 255], ids=["dark", "light"])
@pytest.mark.parametrize("text", [TEXT, LONG], ids=["short", "long"])
def test_a_terminal_of_80_by_24_shows_a_readable_code(text: str, ground: int) -> None:
    lines = drawing(text, 80, 19)
    assert lines is not None and len(lines) <= 19
    assert all(len(line) == len(lines[0]) <= 80 for line in lines)
    assert qr_codes(lines, ground) == [text]


@pytest.mark.parametrize(("columns", "rows"), [(20, 50), (80, 10)])
def test_a_screen_too_small_has_none(columns: int, rows: int) -> None:
    assert drawing(TEXT, columns, rows) is None
