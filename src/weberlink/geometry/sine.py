"""Sine and cosine by sums and products only, which every host rounds in the same way; `math.sin` gives no guarantee."""

from math import pi

_TURN = 2.0 * pi
_HALF, _QUARTER = pi, 0.5 * pi


def sine(angle: float) -> float:
    """The sine of a finite angle [rad]; within 1e-9 for magnitudes up to 1e6."""
    x = angle % _TURN
    if x > _HALF:
        x -= _TURN
    if x > _QUARTER:
        x = _HALF - x
    elif x < -_QUARTER:
        x = -_HALF - x
    y = x * x
    # The series to x^13; its next term is below 1e-9 on a quarter turn.
    tail = 1.0 - y / 72.0 * (1.0 - y / 110.0 * (1.0 - y / 156.0))
    return x * (1.0 - y / 6.0 * (1.0 - y / 20.0 * (1.0 - y / 42.0 * tail)))


def cosine(angle: float) -> float:
    """The cosine of a finite angle [rad]; as exact as `sine`."""
    return sine(angle + _QUARTER)
