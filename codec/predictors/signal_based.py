"""The paper's signal-based predictors: the newest sample is held, or a straight line goes on through the two newest.

Without updates a line goes on without end; the silence limit and the force limiter bound what the operator feels.
"""

from dataclasses import dataclass
from typing import ClassVar

from weberlink.codec.predictors.contract import FitLimits, FittedPredictor, Hold, Model
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import Vector


@dataclass(slots=True)
class Line(Model):
    """A straight line in time."""

    value: Vector
    slope: Vector  # Per tick
    tick: int

    def at(self, tick: float, position: Vector) -> Vector:  # noqa: ARG002
        ahead = tick - self.tick
        value, slope = self.value, self.slope
        return (value[0] + slope[0] * ahead, value[1] + slope[1] * ahead, value[2] + slope[2] * ahead)

    def first(self, newest: Sample) -> Vector:  # noqa: ARG002
        return self.value


class ZeroOrderHold(FittedPredictor):
    name: ClassVar[str] = "zoh"

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Hold:  # noqa: ARG002
        return Hold(newest.value)


ZOH = ZeroOrderHold()


class Linear(FittedPredictor):
    name: ClassVar[str] = "linear"

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Line | None:  # noqa: ARG002
        if previous is None or newest.tick <= previous.tick:
            return None
        gap = newest.tick - previous.tick
        a, b = newest.value, previous.value
        return Line(a, ((a[0] - b[0]) / gap, (a[1] - b[1]) / gap, (a[2] - b[2]) / gap), newest.tick)

    def needs_previous(self, newest: Sample, previous: Sample) -> bool:  # noqa: ARG002
        return True


LINEAR = Linear()
