"""The stiffness matrix and the drift of whatever is touched, by ridge least squares over the latest samples.

f_i - f_1 = K (p_i - p_1) + g (t_i - t_1), each axis of the force by itself. The ridge holds K small against the noise
of a hand that hardly moves, and g small where motion explains as much as time does.
"""

from weberlink.codec.adaptive.candidate import Occasion
from weberlink.codec.predictors.affine import Affine
from weberlink.geometry.vector import Vector, is_finite

WINDOW = 14
"""Ticks back."""
RIDGE_PLACE = 1e-5
"""[m]: a motion of this size (rms) halves the estimate of K."""
RIDGE_TIME = 0.2
"""Weight of the ridge on g, as a share of the samples, in units of the window."""
SIZE = 4

Matrix = list[list[float]]


class LocalAffine:
    """Keeps nothing: the history has all it needs."""

    __slots__ = ()

    def model(self, occasion: Occasion) -> Affine | None:
        history, newest = occasion.history, occasion.newest
        count = min(WINDOW, len(history) - 1)
        if count < 2:
            return None
        solution = _solve(*_system(history.values[-count - 1 :], history.places[-count - 1 :]))
        if solution is None:
            return None
        by_x, by_y, by_z, by_time = solution
        slope = (by_time[0] / count, by_time[1] / count, by_time[2] / count)
        rows = (
            (by_x[0], by_y[0], by_z[0]),
            (by_x[1], by_y[1], by_z[1]),
            (by_x[2], by_y[2], by_z[2]),
        )
        if not (all(map(is_finite, rows)) and is_finite(slope)):
            return None
        return Affine(newest.value, newest.position, newest.tick, rows, slope)


def _system(values: list[Vector], places: list[Vector]) -> tuple[Matrix, list[list[float]]]:
    """Normal equations over position and time in windows, for the three axes of the force at once."""
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


def _solve(left: Matrix, right: list[list[float]]) -> list[list[float]] | None:
    """By elimination; positive definite but for rounding, so no pivot is looked for. None where one is lost."""
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
