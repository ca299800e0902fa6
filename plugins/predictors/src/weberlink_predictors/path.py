"""A learned path: displacements from the newest sample at a few moments, straight in between, held after the last.

The sender learns what follows a sample (`weberlink_predictors.learning`), and the receiver only plays it:

    f(t) = f_1 + path(t - t_1)                          path
    f(t) = f_1 + path(t - t_1) + K_1 d + K_2 u (u d)    elastic

d is the motion of the hand since the sample and u the direction of f_1. `elastic` is for signals that follow the
position, as in a contact; it does not pull. It offers no contact surface to control schemes: the path takes part of the
change of the force, so K is softer than the contact, and a robot that is moved by it moves too far.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import frexp, ldexp
from typing import Any, ClassVar

from weberlink.codec.predictors.contract import FitLimits, Model
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.geometry.vector import ZERO, Vector, add, distance, subtract
from weberlink.update import MOST_PARAMETER_BYTES, ModelParameters
from weberlink_predictors.estimation import Candidate, CandidatePredictor, EncodeContext, Signal
from weberlink_predictors.parameters import Float, components, pack, unpack, vector_of

STEP_S = 0.004  # Time from one sample that is learned to the next [s]
HORIZONS = (1, 2, 4, 8, 16, 32)  # Moments of the knots, in steps after the sample
# A displacement has steps of the largest power of two of the wire step that is at most this part of the deadband.
FINENESS, FINENESS_AHEAD = 8.0, 16.0
LEAST_CHANGE, LEAST_CHANGE_AHEAD = 0.25, 0.1  # A last part that changes the path by less is left out [deadbands]
SOON = 2  # Number of horizons of the second candidate of `path`, which holds what it reaches then
_HEAD = (3, 4, 6)  # Bits of the number of knots, of the width of a component and of the exponent of its step
_HEAD_BYTES = 2
# In place of the number of knots, if the sender looked ahead. Then there follow the number of known ticks, the numbers
# of knots within them and beyond, and the ticks of the former. The path begins at a knot at 0.
_LOOKS_AHEAD = 7
_AHEAD = (7, 3, 3)
_AHEAD_BYTES = 2
_TICKS = 7
_LARGEST_EXPONENT = (1 << _HEAD[2]) - 1
_LARGEST = (1 << (1 << _HEAD[1]) - 2) - 1  # Largest level of a component
_STIFFNESS = Float(2.0**-6, 4, 6, signed=True)  # Of K, in wire steps of the value per wire step of the position


@dataclass(slots=True)
class Path(Model):
    newest: Sample
    knots: tuple[int, ...]  # Ticks after the sample, increasing; the first is 0 if the path begins beside the sample
    displacements: tuple[Vector, ...]  # At the knots, from the sample
    exponent: int = 0  # A displacement is a multiple of two to this power, in wire steps
    stiffness: tuple[float, float] = (0.0, 0.0)  # K_1 and K_2 [N/m]; negative where the force opposes the motion
    known: int = 0  # Ticks after the sample that were known: the horizons of what is expected count from there

    def first(self, newest: Sample) -> Vector:
        return add(newest.value, self.displacements[0]) if self.knots and self.knots[0] == 0 else newest.value

    def at(self, tick: float, position: Vector) -> Vector:
        newest_tick, value, _ = self.newest
        x, y, z = value
        ahead = max(0.0, tick - newest_tick)  # a peer's sample may be of a tick that is still to come
        before, start = 0, ZERO
        knots, displacements = self.knots, self.displacements
        for index in range(len(knots)):
            knot, end = knots[index], displacements[index]
            if ahead < knot:
                share = (ahead - before) / (knot - before)
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
        a, b, c = _yielded(self.newest, self.stiffness, position)
        x, y, z = x + a, y + b, z + c
        square = value[0] * value[0] + value[1] * value[1] + value[2] * value[2]
        pull = (x * value[0] + y * value[1] + z * value[2]) / square
        if pull < 0.0:
            return (x - pull * value[0], y - pull * value[1], z - pull * value[2])
        return (x, y, z)


class LearnedCandidate:
    """Makes the path that is expected, rounded as it travels."""

    def __init__(self, signal: Signal, *, elastic: bool, reach: int = len(HORIZONS)) -> None:
        from weberlink_predictors.learning import PathLearner  # noqa: PLC0415 - it imports this module

        self._learner = signal.estimator(PathLearner)
        self._elastic = elastic
        self._limits = signal.limits
        self._grid = signal.grid
        self._horizons = horizons_of(signal.grid.period)[:reach]

    def model(self, context: EncodeContext) -> Path | None:
        newest, bound, grid = context.newest, context.bound, self._grid
        learned = self._learner.learned()[self._elastic]
        stiffness = (0.0, 0.0)
        if self._elastic:
            stiffness = _stiffness(grid, _stiffness_levels(grid, learned.stiffness))
            if newest.value == ZERO or not _is_accepted(stiffness, self._limits):
                return None
        fineness, least = (FINENESS_AHEAD, LEAST_CHANGE_AHEAD) if context.ahead.values else (FINENESS, LEAST_CHANGE)
        ratio = bound / (fineness * grid.value.step)
        exponent = max(0, min(_LARGEST_EXPONENT, frexp(ratio)[1] - 1)) if ratio < 1e300 else _LARGEST_EXPONENT
        digit = ldexp(grid.value.step, exponent)
        tail = [_rounded(each, digit) for each in learned.displacements[: len(self._horizons)]]
        while tail and distance(tail[-1], tail[-2] if len(tail) > 1 else ZERO) <= least * bound:
            del tail[-1]
        if context.ahead.values:
            return self._through(context, stiffness, tail, exponent)
        if not tail and not self._elastic:
            return None
        return Path(newest, self._horizons[: len(tail)], tuple(tail), exponent, stiffness)

    def _through(
        self, context: EncodeContext, stiffness: tuple[float, float], tail: Sequence[Vector], exponent: int
    ) -> Path:
        """The path through the known samples to what is expected after them."""
        from weberlink_predictors.chords import Chords  # noqa: PLC0415

        newest, ahead = context.newest, context.ahead
        values = [subtract(context.history.values[-1], newest.value)]
        for value, place in zip(ahead.values, ahead.places, strict=True):
            values.append(subtract(subtract(value, newest.value), _yielded(newest, stiffness, place)))
        horizons = self._horizons[: len(tail)]
        knots, vertices = Chords(values, (context.bound, *ahead.bounds), tail, horizons).path()
        digit = ldexp(self._grid.value.step, exponent)
        rounded = tuple(_rounded(each, digit) for each in vertices)
        path = Path(newest, tuple(knots), rounded, exponent, stiffness, len(ahead.values))
        # An end that does not fit is held.
        while sum(_layout(path, self._grid)[1]) + 2 * _STIFFNESS.width > 8 * MOST_PARAMETER_BYTES:
            path = replace(path, knots=path.knots[:-1], displacements=path.displacements[:-1])
        return path


class PathPredictor(CandidatePredictor):
    name: ClassVar[str] = "path"
    looks_ahead: ClassVar[bool] = True

    def candidates(self, signal: Signal) -> Sequence[Candidate]:
        return [LearnedCandidate(signal, elastic=False), LearnedCandidate(signal, elastic=False, reach=SOON)]

    def packed(self, model: Any, newest: Sample, grid: SampleGrid) -> ModelParameters:  # noqa: ARG002
        fields, widths = _layout(model, grid)
        if self.geometric:
            fields += _stiffness_levels(grid, model.stiffness)
            widths += [_STIFFNESS.width] * 2
        return ModelParameters(pack(fields, widths))

    def unpacked(self, data: bytes, newest: Sample, grid: SampleGrid, limits: FitLimits) -> Path | None:
        count, width, exponent = unpack(data[:_HEAD_BYTES], _HEAD)
        known, widths, knots = 0, [*_HEAD], horizons_of(grid.period)
        if count == _LOOKS_AHEAD:
            widths += _AHEAD
            *_, known, inner, count = unpack(data[: _HEAD_BYTES + _AHEAD_BYTES], widths)
            widths += [_TICKS] * inner
            chords = unpack(data[: (sum(widths) + 7) // 8], widths)[len(widths) - inner :]
            knots = (0, *chords, *(known + knot for knot in knots[:count]))
            if known == 0 or not all(before < after for before, after in pairwise(knots)):
                return None
            count += 1 + inner
        if count > len(knots) or width == 0:
            return None
        numbers, first = count * grid.value.size, len(widths)
        widths += [*[width] * numbers, *[_STIFFNESS.width] * (2 * self.geometric)]
        if sum(widths) > 8 * MOST_PARAMETER_BYTES:
            return None
        fields = unpack(data, widths)[first:]
        middle, digit = 1 << width - 1, ldexp(grid.value.step, exponent)
        path = [(level - middle) * digit for level in fields[:numbers]]
        stiffness = (0.0, 0.0)
        if self.geometric:
            stiffness = _stiffness(grid, fields[numbers:])
            if newest.value == ZERO or not _is_accepted(stiffness, limits):
                return None
        sent, size = grid.value, grid.value.size
        displacements = tuple(vector_of(path[start : start + size], sent) for start in range(0, numbers, size))
        return Path(newest, knots[:count], displacements, exponent, stiffness, known)


class ElasticPredictor(PathPredictor):
    name: ClassVar[str] = "elastic"
    geometric: ClassVar[bool] = True

    def candidates(self, signal: Signal) -> Sequence[Candidate]:
        return [LearnedCandidate(signal, elastic=True)]


def horizons_of(period: float) -> tuple[int, ...]:
    """The horizons in ticks of this period [s]."""
    return tuple(max(1, round(STEP_S / period)) * steps for steps in HORIZONS)


PATH = PathPredictor()
ELASTIC = ElasticPredictor()


def _layout(model: Path, grid: SampleGrid) -> tuple[list[int], list[int]]:
    """The fields of a path and their widths, without the stiffness."""
    digit = ldexp(grid.value.step, model.exponent)
    levels = [round(each / digit) for vector in model.displacements for each in components(vector, grid.value)]
    width = max([each.bit_length() for each in levels], default=0) + 1
    fields, widths = [len(model.knots), width, model.exponent], [*_HEAD]
    if model.known:
        inner = [knot for knot in model.knots[1:] if knot <= model.known]
        fields = [_LOOKS_AHEAD, width, model.exponent, model.known, len(inner), len(model.knots) - 1 - len(inner)]
        widths += [*_AHEAD, *[_TICKS] * len(inner)]
        fields += inner
    fields += [each + (1 << width - 1) for each in levels]
    return fields, widths + [width] * len(levels)


def _yielded(newest: Sample, stiffness: tuple[float, float], position: Vector) -> Vector:
    """The change of the force by the motion of the hand since the sample: K_1 d + K_2 u (u d)."""
    along, normal = stiffness
    if along == normal == 0.0:
        return ZERO
    _, (u, v, w), (x, y, z) = newest
    a, b, c = position[0] - x, position[1] - y, position[2] - z
    pressed = normal * (a * u + b * v + c * w) / (u * u + v * v + w * w)
    return (along * a + pressed * u, along * b + pressed * v, along * c + pressed * w)


def _rounded(displacement: Vector, digit: float) -> Vector:
    x, y, z = [digit * max(-_LARGEST, min(_LARGEST, round(each / digit))) for each in displacement]
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
