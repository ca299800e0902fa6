"""Where a signal will be on the whole in the next ticks: a fixed linear filter of the latest samples.

Of a force that a person makes, noise and tremor are about as large as the deadband. A model through the newest sample,
which is sent because it is an extreme one, leaves the deadband again soon; one through where the signal will be does
not. The filters are the least-squares regression of the next 20 (or 40) samples of recorded signals on differences of
the latest ones, weighted by one over the deadband; docs/adaptive/ says of which recordings, and how it is made again.
"""

from weberlink.codec.adaptive.candidate import Occasion
from weberlink.codec.adaptive.history import History
from weberlink.codec.predictors.linear import Line
from weberlink.geometry.vector import Vector, add, distance, norm, scale

LAGS = (1, 2, 4, 8, 16, 32)
"""Ticks; the filters read the newest sample less those so long before."""
NEAREST = 0.8
"""Share of the deadband within which a line begins: the rest is for rounding and for what comes."""

Filter = tuple[float, float, float, float, float, float]


class Trend:
    """A line by a filter for its value and one for its slope.

    Args:
        value: weights of the differences, for the offset from the newest sample.
        slope: likewise per tick; None for a line that holds.
    """

    __slots__ = ("_slope", "_value")

    def __init__(self, value: Filter, slope: Filter | None = None) -> None:
        self._value = value
        self._slope = slope

    def model(self, occasion: Occasion) -> Line | None:
        newest, history = occasion.newest, occasion.history
        if len(history) <= LAGS[0]:
            return None
        differences = _differences(history)
        offset, slope = _filtered(self._value, differences), (0.0, 0.0, 0.0)
        if self._slope is not None:
            slope = _filtered(self._slope, differences)
        # The sample is off by the wire's rounding already, which a deadband of a few steps has no room for.
        rounding = distance(newest.value, history.values[-1])
        longest, length = max(0.0, min(NEAREST * occasion.bound, occasion.bound - rounding)), norm(offset)
        if length > longest:
            offset = scale(offset, longest / length)
        return Line(add(newest.value, offset), slope, newest.tick)


def _differences(history: History) -> list[Vector]:
    """Of the newest sample and earlier ones; the earliest there is stands for those before it."""
    values = history.values
    x, y, z = values[-1]
    last = len(values) - 1
    chosen = [values[-1 - min(lag, last)] for lag in LAGS]
    return [(x - a, y - b, z - c) for a, b, c in chosen]


def _filtered(weights: Filter, differences: list[Vector]) -> Vector:
    x = y = z = 0.0
    for weight, (a, b, c) in zip(weights, differences, strict=True):
        x += weight * a
        y += weight * b
        z += weight * c
    return (x, y, z)


HOLD_20 = Trend((1.046715, -0.543725, 0.386702, 0.046513, -0.036738, 0.095743))
"""The mean of the next 20 samples."""
LINE_40 = Trend(
    (0.882514, -0.504821, 0.283134, 0.011596, -0.045712, 0.024697),
    (0.002182, -0.000879, 0.002855, 0.001140, 0.001674, 0.003865),
)
"""A line through the next 40."""
