"""A learned path: displacements from the newest sample at a few moments, straight in between, held after the last.

The sender learns what follows a sample (`weberlink.codec.predictors.learning`), and the receiver only plays it:

    f(t) = f_1 + path(t - t_1)                          path
    f(t) = f_1 + path(t - t_1) + K_1 d + K_2 u (u d)    elastic

d is the motion of the hand since the sample and u the direction of f_1. `elastic` is for signals that follow the
position, as in a contact; it is a contact surface too, and does not pull.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import frexp, ldexp
from typing import Any

from weberlink.codec.parameters import Float, pack, unpack
from weberlink.codec.predictors.contract import Candidate, EncodeContext, Predictor, Signal
from weberlink.codec.predictors.learning import HORIZONS, PathLearner, horizons_of
from weberlink.codec.predictors.model import EXTRAPOLATION, FitLimits, Model, ModelRecord
from weberlink.codec.predictors.surface import SurfacePatch
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.geometry.vector import ZERO, Vector, add, distance, norm, scale
from weberlink.update import MOST_PARAMETER_BYTES, ModelParameters

FINENESS = 8.0
"""A displacement has steps of the largest power of two of the wire step that is at most this part of the deadband."""
LEAST_CHANGE = 0.25
"""The path ends before a last part that changes it by less [deadbands]."""
_HEAD = (3, 4, 6)
"""Bits of the number of knots, of the width of a component and of the exponent of its step."""
_HEAD_BYTES = 2
_LARGEST_EXPONENT = (1 << _HEAD[2]) - 1
_LARGEST = (1 << (1 << _HEAD[1]) - 2) - 1
"""Largest level of a component."""
_STIFFNESS = Float(2.0**-6, 4, 6, signed=True)
"""Of K, in wire steps of the value per wire step of the position."""


@dataclass(slots=True)
class Path(Model):
    newest: Sample
    knots: tuple[int, ...]
    """Ticks after the sample, increasing."""
    displacements: tuple[Vector, ...]
    """At the knots, from the sample."""
    exponent: int = 0
    """A displacement is a multiple of two to this power, in wire steps."""
    stiffness: tuple[float, float] = (0.0, 0.0)
    """K_1 and K_2 [N/m]; negative where the force opposes the motion."""

    def at(self, tick: float, position: Vector) -> Vector:
        newest_tick, value, place = self.newest
        x, y, z = value
        ahead = tick - newest_tick
        before, start = 0, ZERO
        for knot, end in zip(self.knots, self.displacements, strict=True):
            if ahead < knot:
                share = max(0.0, (ahead - before) / (knot - before))
                x += start[0] + (end[0] - start[0]) * share
                y += start[1] + (end[1] - start[1]) * share
                z += start[2] + (end[2] - start[2]) * share
                break
            before, start = knot, end
        else:
            x, y, z = x + start[0], y + start[1], z + start[2]
        along, normal = self.stiffness
        if along == normal == 0.0:
            return (x, y, z)
        a, b, c = position[0] - place[0], position[1] - place[1], position[2] - place[2]
        square = value[0] * value[0] + value[1] * value[1] + value[2] * value[2]
        pressed = normal * (a * value[0] + b * value[1] + c * value[2]) / square
        x += along * a + pressed * value[0]
        y += along * b + pressed * value[1]
        z += along * c + pressed * value[2]
        pull = (x * value[0] + y * value[1] + z * value[2]) / square
        if pull < 0.0:
            return (x - pull * value[0], y - pull * value[1], z - pull * value[2])
        return (x, y, z)

    def surface(self) -> SurfacePatch | None:
        """The plane through the sample, across its force; None if the force does not grow with the depth."""
        tick, value, place = self.newest
        stiffness, size = -sum(self.stiffness), norm(value)
        if not (stiffness > 0.0 and size > 0.0):
            return None
        point = add(place, scale(value, 1.0 / stiffness))
        return SurfacePatch(scale(value, 1.0 / size), point, tick, stiffness)

    def record(self) -> ModelRecord:
        surface = self.surface()
        return EXTRAPOLATION if surface is None else surface.record()


class LearnedCandidate:
    """Makes the path that is expected, rounded as it travels."""

    def __init__(self, signal: Signal, *, elastic: bool) -> None:
        self._learner = signal.estimator(PathLearner)
        self._elastic = elastic
        self._limits = signal.limits
        self._grid = signal.grid
        self._horizons = horizons_of(signal.grid.period)

    def model(self, context: EncodeContext) -> Path | None:
        newest, bound, grid = context.newest, context.bound, self._grid
        learned = self._learner.learned()[self._elastic]
        stiffness = (0.0, 0.0)
        if self._elastic:
            stiffness = _stiffness(grid, _stiffness_levels(grid, learned.stiffness))
            if newest.value == ZERO or not _is_accepted(stiffness, self._limits):
                return None
        exponent = _exponent(bound / (FINENESS * grid.value.step))
        digit = ldexp(grid.value.step, exponent)
        path = [_rounded(each, digit) for each in learned.displacements]
        while path and distance(path[-1], path[-2] if len(path) > 1 else ZERO) <= LEAST_CHANGE * bound:
            del path[-1]
        if not path and not self._elastic:
            return None
        return Path(newest, self._horizons[: len(path)], tuple(path), exponent, stiffness)


class PathPredictor(Predictor):
    name = "path"
    estimated = True

    def candidates(self, signal: Signal) -> Sequence[Candidate]:
        return [LearnedCandidate(signal, elastic=self.geometric)]

    def packed(self, model: Any, newest: Sample, grid: SampleGrid) -> ModelParameters:  # noqa: ARG002
        digit = ldexp(grid.value.step, model.exponent)
        levels = [round(each / digit) for vector in model.displacements for each in grid.value.components(vector)]
        width = max([each.bit_length() for each in levels], default=0) + 1
        fields = [len(model.displacements), width, model.exponent, *(each + (1 << width - 1) for each in levels)]
        widths = [*_HEAD, *[width] * len(levels)]
        if self.geometric:
            fields += _stiffness_levels(grid, model.stiffness)
            widths += [_STIFFNESS.width] * 2
        return ModelParameters(pack(fields, widths))

    def unpacked(self, data: bytes, newest: Sample, grid: SampleGrid, limits: FitLimits) -> Path | None:
        count, width, exponent = unpack(data[:_HEAD_BYTES], _HEAD)
        numbers = count * grid.value.size
        widths = [*_HEAD, *[width] * numbers, *[_STIFFNESS.width] * (2 * self.geometric)]
        if count > len(HORIZONS) or width == 0 or sum(widths) > 8 * MOST_PARAMETER_BYTES:
            return None
        _, _, _, *fields = unpack(data, widths)
        middle, digit = 1 << width - 1, ldexp(grid.value.step, exponent)
        path = [(level - middle) * digit for level in fields[:numbers]]
        stiffness = (0.0, 0.0)
        if self.geometric:
            stiffness = _stiffness(grid, fields[numbers:])
            if newest.value == ZERO or not _is_accepted(stiffness, limits):
                return None
        size, vector = grid.value.size, grid.value.vector
        displacements = tuple(vector(path[start : start + size]) for start in range(0, numbers, size))
        return Path(newest, horizons_of(grid.period)[:count], displacements, exponent, stiffness)


class ElasticPredictor(PathPredictor):
    name = "elastic"
    geometric = True


PATH = PathPredictor()
ELASTIC = ElasticPredictor()


def _exponent(ratio: float) -> int:
    """The largest power of two that is at most a ratio, as an exponent from 0 to what its field holds."""
    return max(0, min(_LARGEST_EXPONENT, frexp(ratio)[1] - 1)) if ratio < 1e300 else _LARGEST_EXPONENT


def _rounded(displacement: Vector, digit: float) -> Vector:
    x, y, z = (digit * max(-_LARGEST, min(_LARGEST, round(each / digit))) for each in displacement)
    return (x, y, z)


def _unit(grid: SampleGrid) -> float:
    assert grid.position is not None
    return grid.value.step / grid.position.step


def _stiffness_levels(grid: SampleGrid, stiffness: Sequence[float]) -> list[int]:
    return [_STIFFNESS.level(each / _unit(grid)) for each in stiffness]


def _stiffness(grid: SampleGrid, levels: Sequence[int]) -> tuple[float, float]:
    along, normal = (_STIFFNESS.number(each) * _unit(grid) for each in levels)
    return along, normal


def _is_accepted(stiffness: tuple[float, float], limits: FitLimits) -> bool:
    """Whether K is not 0, and no stiffer in any direction than a contact may be."""
    along, normal = stiffness
    return stiffness != (0.0, 0.0) and max(abs(along), abs(along + normal)) <= limits.stiffness[1]
