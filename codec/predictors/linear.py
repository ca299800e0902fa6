"""First-order extrapolation in time from the two newest samples: f_1 + (f_1 - f_2) / (t_1 - t_2) * (t - t_1).

Without updates it extrapolates without end; the silence limit and the force limiter bound what the operator feels.
"""

from typing import ClassVar

from weberlink.codec.predictors.contract import FittedPredictor
from weberlink.codec.predictors.model import FitLimits, Line
from weberlink.codec.sample import Sample


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
