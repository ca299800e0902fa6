"""QR codes in a terminal, as another library reads them."""

import pytest

from plugins.anywhere.tests.screens import qr_codes
from weberlink_anywhere.invitation import Invitation

pytest.importorskip("segno")
from weberlink_anywhere.qr import drawing

TEXT = str(Invitation("7-confidence-ribcage", "ws://relay.example:4000/v1"))
LONG = str(Invitation("123-microscope-yesteryear", "wss://relay.robotics.university.example/v1"))


@pytest.mark.parametrize("ground", [0, 255], ids=["dark", "light"])
@pytest.mark.parametrize("text", [TEXT, LONG], ids=["short", "long"])
def test_a_terminal_of_80_by_24_shows_a_readable_code(text: str, ground: int) -> None:
    lines = drawing(text, 80, 19)
    assert lines is not None
    assert len(lines) <= 19
    assert all(len(line) == len(lines[0]) <= 80 for line in lines)
    assert qr_codes(lines, ground=ground) == [text]


@pytest.mark.parametrize(("columns", "rows"), [(20, 50), (80, 10)])
def test_a_screen_too_small_has_none(columns: int, rows: int) -> None:
    assert drawing(TEXT, columns, rows) is None
