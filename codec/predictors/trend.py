"""A straight line in time, estimated by the sender: f_0 + g (t - t_1).

Noise and tremor of a person's force are about as large as the deadband. The sample that is sent is an extreme one, so
a model through it soon leaves the deadband again. Here f_0 is the value that a fixed linear filter of the latest
samples expects, limited to the deadband around the newest sample. The filters are least-squares regressions of the next
20 (or 40) samples of recorded signals on differences of the latest ones, weighted by one over the deadband.
docs/adaptive/ names the recordings and the module that repeats the regression.
"""

from collections.abc import Sequence

from weberlink.codec.parameters import Block
from weberlink.codec.predictors.contract import Candidates, EncodeContext, History, Predictor
from weberlink.codec.predictors.model import FitLimits, Line
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.geometry.vector import Vector, add, distance, norm, scale, subtract

FINEST = 2.0**-4
"""Value of the last bit of an offset, in wire steps."""
SLOWEST = 2.0**-12
"""Value of the last bit of a slope, in wire steps per tick."""
WIDTH = 9
"""Bits of a component: 8 bytes in all for three axes."""
LAGS = (1, 2, 4, 8, 16, 32)
"""The filters read the differences of the newest sample and those that many ticks earlier."""
NEAREST = 0.8
"""Largest distance of the line from its sample, as a share of the deadband; the rest is for rounding and new errors."""

Filter = tuple[float, float, float, float, float, float]


class TrendFilter:
    """Makes a line with one filter for its offset and one for its slope.

    Args:
        value: weights of the differences that give the offset from the newest sample.
        slope: weights of the differences that give the slope per tick; None for a constant.
    """

    def __init__(self, value: Filter, slope: Filter | None = None) -> None:
        self._value = value
        self._slope = slope

    def model(self, context: EncodeContext) -> Line | None:
        newest, history = context.newest, context.history
        if len(history) <= LAGS[0]:
            return None
        differences = _differences(history)
        offset, slope = _filtered(self._value, differences), (0.0, 0.0, 0.0)
        if self._slope is not None:
            slope = _filtered(self._slope, differences)
        # If the deadband is only a few wire steps, rounding takes part of it.
        rounding = distance(newest.value, history.values[-1])
        longest, length = max(0.0, min(NEAREST * context.bound, context.bound - rounding)), norm(offset)
        if length > longest:
            offset = scale(offset, longest / length)
        return Line(add(newest.value, offset), slope, newest.tick)


HOLD_20 = TrendFilter((1.046715, -0.543725, 0.386702, 0.046513, -0.036738, 0.095743))
"""Predicts the mean of the next 20 samples."""
LINE_40 = TrendFilter(
    (0.882514, -0.504821, 0.283134, 0.011596, -0.045712, 0.024697),
    (0.002182, -0.000879, 0.002855, 0.001140, 0.001674, 0.003865),
)
"""Predicts a line through the next 40 samples."""


class Trend(Predictor):
    name = "trend"
    estimated = True
    doubt = 1.1

    def candidates(self, limits: FitLimits, least_force: float) -> Candidates:  # noqa: ARG002
        return Candidates([HOLD_20, LINE_40])

    def widths(self, grid: SampleGrid) -> tuple[int, ...]:
        offset, slope = _blocks(grid)
        return offset.widths + slope.widths

    def levels(self, model: Line, newest: Sample, grid: SampleGrid) -> list[int]:
        offset, slope = _blocks(grid)
        components = grid.value.components
        return offset.levels(components(subtract(model.value, newest.value))) + slope.levels(components(model.slope))

    def build(self, fields: Sequence[int], newest: Sample, grid: SampleGrid, limits: FitLimits) -> Line:  # noqa: ARG002
        offset, slope = _blocks(grid)
        half = len(offset.widths)
        vector = grid.value.vector
        start = add(newest.value, vector(offset.numbers(fields[:half])))
        return Line(start, vector(slope.numbers(fields[half:])), newest.tick)


TREND = Trend()


def _differences(history: History) -> list[Vector]:
    """Differences of the newest sample and those `LAGS` ticks earlier; the oldest sample stands for missing ones."""
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


def _blocks(grid: SampleGrid) -> tuple[Block, Block]:
    value = grid.value
    return Block(FINEST * value.step, WIDTH, value.size), Block(SLOWEST * value.step, WIDTH, value.size)
