"""A straight line in time whose value and slope the sender works out from all of its samples: f_0 + g (t - t_1).

Unlike `linear` it need not pass through a sample: f_0 is where the signal is expected to be soon, within the deadband
of where it is (`weberlink.codec.adaptive.trend` says how).
"""

from collections.abc import Sequence

from weberlink.codec.parameters import EXPONENT_BITS, Block, room
from weberlink.codec.predictors.contract import Parametric, Trust
from weberlink.codec.predictors.linear import Line
from weberlink.codec.quantizer import Grids
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import add, subtract

FINEST = 2.0**-4
"""Last digit of an offset, in wire steps."""
SLOWEST = 2.0**-12
"""Last digit of a slope, in wire steps per tick."""
WIDEST = 12


def widths(grids: Grids) -> tuple[int, ...]:
    offset, slope = _blocks(grids)
    return offset.widths + slope.widths


def levels(model: Line, newest: Sample, grids: Grids) -> list[int]:
    """Offset from the sample, rounded towards it, and slope."""
    offset, slope = _blocks(grids)
    components = grids.value.components
    return offset.levels(components(subtract(model.value, newest.value))) + slope.levels(components(model.slope))


def build(fields: Sequence[int], newest: Sample, grids: Grids, trust: Trust) -> Line:  # noqa: ARG001
    offset, slope = _blocks(grids)
    half = len(offset.widths)
    vector = grids.value.vector
    start = add(newest.value, vector(offset.numbers(fields[:half])))
    return Line(start, vector(slope.numbers(fields[half:])), newest.tick)


def _blocks(grids: Grids) -> tuple[Block, Block]:
    value = grids.value
    width = min(WIDEST, (room(grids.size) // 2 - EXPONENT_BITS) // value.size)
    return Block(FINEST * value.step, width, value.size), Block(SLOWEST * value.step, width, value.size)


TREND = Parametric(widths, levels, build)
