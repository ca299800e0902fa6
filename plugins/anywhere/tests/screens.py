"""What a camera sees of a terminal: a picture of its lines, and the QR code in it as another library reads it."""

import numpy as np
import pytest

HALVES = {" ": (0, 0), "▀": (1, 0), "▄": (0, 1), "█": (1, 1)}
"""Which halves of a cell are light."""
CELL = (6, 12)
"""Width and height of a cell [pixels]."""


def qr_codes(lines: list[str], *, ground: int = 0) -> list[str]:
    """Texts of the QR codes in lines of light characters, on a screen whose other cells are `ground` (0 dark to 255).

    Read by zxing-cpp, which shares no code with the library that draws them.
    """
    zxingcpp = pytest.importorskip("zxingcpp")
    width, height = CELL
    picture = np.full((height * (len(lines) + 2), width * (max(map(len, lines)) + 2)), ground, np.uint8)
    for row, line in enumerate(lines, 1):
        for column, letter in enumerate(line, 1):
            for half, is_light in enumerate(HALVES.get(letter, (0, 0))):
                top, left = row * height + half * height // 2, column * width
                picture[top : top + height // 2, left : left + width] = 255 * is_light
    return [found.text for found in zxingcpp.read_barcodes(picture)]
