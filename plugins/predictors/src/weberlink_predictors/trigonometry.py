"""Sine and cosine that are the same on every host: those of the library depend on it."""

from math import pi


def sine(angle: float) -> float:
    """The sine of a finite angle [rad]; within 1e-9 for magnitudes up to 1e6."""
    x = angle % (2.0 * pi)
    if x > pi:
        x -= 2.0 * pi
    if x > 0.5 * pi:
        x = pi - x
    elif x < -0.5 * pi:
        x = -pi - x
    y = x * x
    # The series to x^13; its next term is below 1e-9 on a quarter turn.
    tail = 1.0 - y / 72.0 * (1.0 - y / 110.0 * (1.0 - y / 156.0))
    return x * (1.0 - y / 6.0 * (1.0 - y / 20.0 * (1.0 - y / 42.0 * tail)))


def cosine(angle: float) -> float:
    """The cosine of a finite angle [rad]; as exact as `sine`."""
    return sine(angle + 0.5 * pi)
