"""Sine and cosine by sums and products alone, which every host rounds alike; libraries of mathematics need not."""

from math import pi

_TURN = 2.0 * pi
_HALF, _QUARTER = pi, 0.5 * pi


def sine(angle: float) -> float:
    """Of a finite angle [rad]; within 1e-9 for angles below 1e6."""
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
    """Of a finite angle [rad]."""
    return sine(angle + _QUARTER)
