"""First-order extrapolation in time from the two newest samples: f_1 + (f_1 - f_2) / (t_1 - t_2) * (t - t_1).

It extrapolates without end when nothing arrives; the silence ramp and the force limiter bound what the operator feels.
"""

from typing import NamedTuple

from weberlink.codec.predictors.contract import Predictor, Trust
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import Vector


class Line(NamedTuple):
    value: Vector
    slope: Vector
    """Per tick."""
    tick: int

    def at(self, tick: float, position: Vector) -> Vector:  # noqa: ARG002
        ahead = tick - self.tick
        value, slope = self.value, self.slope
        return (value[0] + slope[0] * ahead, value[1] + slope[1] * ahead, value[2] + slope[2] * ahead)

    def wall(self) -> None:
        return None


def fit(newest: Sample, previous: Sample | None, trust: Trust) -> Line | None:  # noqa: ARG001
    if previous is None or newest.tick <= previous.tick:
        return None
    gap = newest.tick - previous.tick
    a, b = newest.value, previous.value
    return Line(a, ((a[0] - b[0]) / gap, (a[1] - b[1]) / gap, (a[2] - b[2]) / gap), newest.tick)


def needs_previous(newest: Sample, previous: Sample) -> bool:  # noqa: ARG001
    return True


LINEAR = Predictor(fit, needs_previous)
