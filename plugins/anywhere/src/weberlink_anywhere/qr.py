"""QR codes for a terminal (ISO/IEC 18004)."""

import segno

QUIET = (4, 2)
"""Widths of the light frame [modules], best first: 4 is that of the standard, and readers take 2."""
_BLOCKS = {(False, False): " ", (True, False): "▀", (False, True): "▄", (True, True): "█"}
"""Two modules above each other, by which of them are light: for light characters on dark ground."""


def drawing(text: str, columns: int, rows: int) -> list[str] | None:
    """The lines that show a text, to be printed in white on black.

    Args:
        text: to be read from it.
        columns, rows: of the terminal that may be used.

    Returns:
        None if it does not fit.
    """
    code = segno.make(text, error="l", micro=False)
    for quiet in QUIET:
        light = [[not dark for dark in row] for row in code.matrix_iter(border=quiet)]
        light += [[True] * len(light[0])] * (len(light) % 2)
        if len(light[0]) <= columns and len(light) // 2 <= rows:
            pairs = zip(light[::2], light[1::2], strict=True)
            return ["".join(map(_BLOCKS.__getitem__, zip(*pair, strict=True))) for pair in pairs]
    return None
