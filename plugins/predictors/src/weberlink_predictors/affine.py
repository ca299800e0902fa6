"""A locally affine force field, estimated by the sender: f_1 + K (p - p_1) + g (t - t_1).

K is the stiffness matrix of any environment: a wall, a spring, a field, several surfaces at once. A contact pushes and
does not pull: a prediction that points against the newest force is replaced by zero. The estimate is ridge least
squares. The ridge keeps K small if the hand hardly moves and the changes of force are noise, and g small if motion
explains the force as well as time does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from weberlink.codec.predictors.contract import FitLimits, Model
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.geometry.vector import ZERO, Vector, add, is_finite, norm, scale, subtract
from weberlink.update import ModelParameters
from weberlink_predictors.estimation import Candidate, CandidatePredictor, EncodeContext, Signal
from weberlink_predictors.parameters import Block, components, pack, unpack, vector_of

WINDOW_S = 0.014  # Length of the regression window [s]
STEP_S = 0.001  # Time from one sample of the window to the next, where the ticks allow [s]
LEAST_STEPS = 4  # Smallest length of the window, in samples
RIDGE_PLACE = 1e-5  # Ridge on K [m]: it halves the estimate if the motion in the window is this large (rms)
RIDGE_TIME = 0.2  # Ridge on g: a share of the number of samples, where time is in units of the window
SIZE = 4  # Unknowns per axis of the force: three elements of K and one of g

Matrix = tuple[Vector, Vector, Vector]  # Rows

_WIDTHS = {1: (12, 12), 2: (10, 10), 3: (8, 9)}  # Bits of an element of K and of g, by the number of axes that are sent
SOFTEST = 2.0**-10  # Value of the last bit of K, in wire steps of force per wire step of position
SLOWEST = 2.0**-12  # Value of the last bit of g, in wire steps per tick
WIDEST = 2.0  # Tangent of the angle from the newest force to a prediction: no sideways jump of a returning force
_MOST_SQUARE = 1.0 + WIDEST * WIDEST  # Square of 1 / cosine of that angle
Rows = list[list[float]]


@dataclass(slots=True)
class Affine(Model):
    value: Vector
    position: Vector
    tick: int
    stiffness: Matrix  # K [N/m], the derivative of the force on the probe by position; negative along a wall's normal
    slope: Vector  # g [N/tick]

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
        if (a * a + b * b + c * c) * own > _MOST_SQUARE * along * along:
            # Moved back into the cone about the newest force; the part along that is unchanged.
            straight = scale(value, along / own)
            across = subtract((a, b, c), straight)
            return add(straight, scale(across, WIDEST * norm(straight) / norm(across)))
        return (a, b, c)


class LocalAffine:
    """Ridge least squares over the latest samples that are known, each axis separately.

    f_i - f_1 = K (p_i - p_1) + g (t_i - t_1).
    """

    def __init__(self, signal: Signal) -> None:
        self._step = max(1, round(STEP_S / signal.grid.period))
        self._steps = max(LEAST_STEPS, round(WINDOW_S / (self._step * signal.grid.period)))

    def model(self, context: EncodeContext) -> Affine | None:
        history, newest, ahead, step = context.history, context.newest, context.ahead, self._step
        longest = self._steps * step + 1
        values = [*history.values[-longest:], *ahead.values]
        places = [*history.places[-longest:], *ahead.places]
        count = min(self._steps, (len(values) - 1) // step)
        if count < 2:
            return None
        window = slice(-count * step - 1, None, step)
        solution = _solve(*_system(values[window], places[window]))
        if solution is None:
            return None
        *by_place, (a, b, c) = solution
        length = count * step
        slope = (a / length, b / length, c / length)
        x, y, z = zip(*by_place, strict=True)
        rows = (x, y, z)
        if not (all(map(is_finite, rows)) and is_finite(slope)):
            return None
        return Affine(newest.value, newest.position, newest.tick, rows, slope)


class AffinePredictor(CandidatePredictor):
    name: ClassVar[str] = "affine"
    geometric: ClassVar[bool] = True
    looks_ahead: ClassVar[bool] = True
    doubt: ClassVar[float] = 1.1

    def candidates(self, signal: Signal) -> Sequence[Candidate]:
        return [LocalAffine(signal)]

    def packed(self, model: Affine, newest: Sample, grid: SampleGrid) -> ModelParameters:  # noqa: ARG002
        stiffness, slope = _blocks(grid)
        sent = grid.value
        elements = [element for axis in sent.used for element in components(model.stiffness[axis], sent)]
        levels = stiffness.levels(elements) + slope.levels(components(model.slope, sent))
        return ModelParameters(pack(levels, stiffness.widths + slope.widths))

    def unpacked(self, data: bytes, newest: Sample, grid: SampleGrid, limits: FitLimits) -> Affine | None:
        stiffness, slope = _blocks(grid)
        fields = unpack(data, stiffness.widths + slope.widths)
        first = len(stiffness.widths)
        sent = grid.value
        elements = stiffness.numbers(fields[:first])
        starts = range(0, sent.size * sent.size, sent.size)
        rows = iter([vector_of(elements[start : start + sent.size], sent) for start in starts])
        x, y, z = (next(rows) if axis in sent.used else ZERO for axis in range(3))
        if norm((norm(x), norm(y), norm(z))) > limits.stiffness[1]:
            return None
        return Affine(
            newest.value, newest.position, newest.tick, (x, y, z), vector_of(slope.numbers(fields[first:]), sent)
        )


AFFINE = AffinePredictor()


def _blocks(grid: SampleGrid) -> tuple[Block, Block]:
    assert grid.position is not None
    size = grid.value.size
    of_stiffness, of_slope = _WIDTHS[size]
    unit = SOFTEST * grid.value.step / grid.position.step
    return Block(unit, of_stiffness, size * size), Block(SLOWEST * grid.value.step, of_slope, size)


def _system(values: list[Vector], places: list[Vector]) -> tuple[Rows, Rows]:
    """Normal equations in position and time, for the three axes of the force; the window has length 1."""
    count = len(values) - 1
    (u, v, w), (px, py, pz) = values[-1], places[-1]
    xx = yy = zz = RIDGE_PLACE * RIDGE_PLACE * count
    tt = RIDGE_TIME * count
    xy = xz = xt = yz = yt = zt = 0.0
    xu = xv = xw = yu = yv = yw = zu = zv = zw = tu = tv = tw = 0.0
    step = 1.0 / count
    time = -1.0
    for index in range(count):
        (a, b, c), (x, y, z) = values[index], places[index]
        x, y, z = x - px, y - py, z - pz
        a, b, c = a - u, b - v, c - w
        xx += x * x
        xy += x * y
        xz += x * z
        xt += x * time
        yy += y * y
        yz += y * z
        yt += y * time
        zz += z * z
        zt += z * time
        tt += time * time
        xu += x * a
        xv += x * b
        xw += x * c
        yu += y * a
        yv += y * b
        yw += y * c
        zu += z * a
        zv += z * b
        zw += z * c
        tu += time * a
        tv += time * b
        tw += time * c
        time += step
    left = [[xx, xy, xz, xt], [xy, yy, yz, yt], [xz, yz, zz, zt], [xt, yt, zt, tt]]
    return left, [[xu, xv, xw], [yu, yv, yw], [zu, zv, zw], [tu, tv, tw]]


def _solve(left: Rows, right: Rows) -> Rows | None:
    """Gaussian elimination without pivoting of a positive definite matrix; None if rounding made it singular."""
    for row in range(SIZE):
        pivot = left[row][row]
        if not pivot > 0.0:
            return None
        for lower in range(row + 1, SIZE):
            factor = left[lower][row] / pivot
            if factor == 0.0:
                continue
            for column in range(row + 1, SIZE):
                left[lower][column] -= factor * left[row][column]
            for column in range(3):
                right[lower][column] -= factor * right[row][column]
    for row in range(SIZE - 1, -1, -1):
        for column in range(3):
            rest = right[row][column]
            for later in range(row + 1, SIZE):
                rest -= left[row][later] * right[later][column]
            right[row][column] = rest / left[row][row]
    return right
