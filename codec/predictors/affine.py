"""What a force field looks like from close by: f_1 + K (p - p_1) + g (t - t_1), K and g worked out by the sender.

K is the stiffness matrix of whatever is there: a wall, a spring, a field, several surfaces at once. A contact pushes
and does not pull: where the prediction has turned against the newest force, there is none.
"""

from collections.abc import Sequence
from typing import NamedTuple

from weberlink.codec.parameters import Block
from weberlink.codec.predictors.contract import Parametric, Trust
from weberlink.codec.quantizer import Grids
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, add, norm, scale, subtract

Matrix = tuple[Vector, Vector, Vector]
"""Rows."""

_WIDTHS = {1: (12, 12), 2: (10, 10), 3: (8, 9)}
"""Bits of an element of K and of g, by the axes that travel."""
SOFTEST = 2.0**-10
"""Last digit of K, in wire steps of force per wire step of position."""
SLOWEST = 2.0**-12
"""Last digit of g, in wire steps per tick."""
WIDEST = 2.0
"""Tangent of the angle to the newest force up to which a prediction is believed: 63 degrees. Without it a force that
comes back with the probe would come all at once, and sideways.
"""
NARROWEST = 1.0 + WIDEST * WIDEST


class Affine(NamedTuple):
    value: Vector
    position: Vector
    tick: int
    stiffness: Matrix
    """K [N/m], the derivative of the force on the probe: negative definite in front of a wall."""
    slope: Vector
    """g per tick."""

    def at(self, tick: float, position: Vector) -> Vector:
        value, place, slope = self.value, self.position, self.slope
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self.stiffness
        x, y, z = position[0] - place[0], position[1] - place[1], position[2] - place[2]
        ahead = tick - self.tick
        a = value[0] + slope[0] * ahead + xx * x + xy * y + xz * z
        b = value[1] + slope[1] * ahead + yx * x + yy * y + yz * z
        c = value[2] + slope[2] * ahead + zx * x + zy * y + zz * z
        u, v, w = value
        along, own = a * u + b * v + c * w, u * u + v * v + w * w
        if own == 0.0:
            return (a, b, c)
        if not along > 0.0:
            return ZERO
        if (a * a + b * b + c * c) * own > NARROWEST * along * along:
            return _turned_back((a, b, c), value, along / own)
        return (a, b, c)

    def wall(self) -> None:
        return None


def _turned_back(force: Vector, newest: Vector, share: float) -> Vector:
    """A force brought back into the cone about the newest one, its part along that kept."""
    straight = scale(newest, share)
    across = subtract(force, straight)
    return add(straight, scale(across, WIDEST * norm(straight) / norm(across)))


def widths(grids: Grids) -> tuple[int, ...]:
    stiffness, slope = _blocks(grids)
    return stiffness.widths + slope.widths


def levels(model: Affine, newest: Sample, grids: Grids) -> list[int]:  # noqa: ARG001
    stiffness, slope = _blocks(grids)
    components = grids.value.components
    rows = components(model.stiffness)  # type: ignore[arg-type]
    elements = [element for row in rows for element in components(row)]  # type: ignore[arg-type]
    return stiffness.levels(elements) + slope.levels(components(model.slope))


def build(fields: Sequence[int], newest: Sample, grids: Grids, trust: Trust) -> Affine | None:
    """None where the stiffness is more than is trusted."""
    stiffness, slope = _blocks(grids)
    first = len(stiffness.widths)
    size, vector = grids.value.size, grids.value.vector
    elements = stiffness.numbers(fields[:first])
    rows = [vector(elements[start : start + size]) for start in range(0, size * size, size)]
    placed = iter(rows)
    used = grids.value.used
    x, y, z = (next(placed) if axis in used else ZERO for axis in range(3))
    if norm((norm(x), norm(y), norm(z))) > trust.stiffness[1]:
        return None
    return Affine(newest.value, newest.position, newest.tick, (x, y, z), vector(slope.numbers(fields[first:])))


def _blocks(grids: Grids) -> tuple[Block, Block]:
    assert grids.position is not None
    size = grids.value.size
    of_stiffness, of_slope = _WIDTHS[size]
    unit = SOFTEST * grids.value.step / grids.position.step
    return Block(unit, of_stiffness, size * size), Block(SLOWEST * grids.value.step, of_slope, size)


AFFINE = Parametric(widths, levels, build, geometric=True)
