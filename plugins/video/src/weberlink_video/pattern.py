"""A test picture that shows its own time, as cells that survive JPEG and scaling, so that a screen can be measured."""

from io import BytesIO
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

BITS: Final = 28  # of the time in ms, which wraps after 74 hours; a check of 4 bits follows
COLUMNS, ROWS = 8, 4
_CELLS: Final = COLUMNS * ROWS
HEIGHT_SHARE: Final = 0.5  # of the picture, from the top, that the cells take


def _check_bits(number: int) -> int:
    """Sum of the half bytes."""
    return sum(number >> shift & 0xF for shift in range(0, BITS, 4)) + 5 & 0xF


def jpeg_of(pixels: NDArray[np.uint8], quality: int) -> bytes:
    """A JPEG of an RGB or grey picture, shape (height, width[, 3])."""
    out = BytesIO()
    Image.fromarray(pixels).save(out, "JPEG", quality=quality)
    return out.getvalue()


class Pattern:
    """Draws the test picture: cells of the time above a bar that moves, on coloured noise as a real scene has it."""

    def __init__(self, size: tuple[int, int]) -> None:
        width, height = size
        noise = np.random.default_rng(0).integers(60, 190, (height // 8, width // 8, 3), np.uint8)
        self._ground = np.kron(noise, np.ones((8, 8, 1), np.uint8))
        self._cell = int(height * HEIGHT_SHARE) // ROWS, width // COLUMNS

    def draw(self, at: float) -> NDArray[np.uint8]:
        """The picture of a moment on the monotonic clock [s], shape (height, width, 3)."""
        number = round(at * 1e3) % (1 << BITS)
        word = number << 4 | _check_bits(number)
        bits = np.array([word >> _CELLS - 1 - place & 1 for place in range(_CELLS)], np.uint8)
        cells = np.kron(255 * bits.reshape(ROWS, COLUMNS), np.ones(self._cell, np.uint8))
        picture = self._ground.copy()
        picture[: cells.shape[0], : cells.shape[1]] = cells[:, :, None]
        x = int(at % 2.0 / 2.0 * picture.shape[1])
        picture[cells.shape[0] :, x : x + 16] = 255
        return picture


def time_in(grey: NDArray[Any]) -> float | None:
    """The time that a test picture shows [s], of its brightness, shape (height, width); None where there is none."""
    height, width = grey.shape
    rows = ((np.arange(ROWS) + 0.5) * (int(height * HEIGHT_SHARE) // ROWS)).astype(int)
    columns = ((np.arange(COLUMNS) + 0.5) * (width // COLUMNS)).astype(int)
    bits = (grey[np.ix_(rows, columns)] > 127).ravel()
    word = int("".join("1" if bit else "0" for bit in bits), 2)
    number = word >> 4
    return number * 1e-3 if _check_bits(number) == word & 0xF else None
