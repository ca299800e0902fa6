"""Zero-order hold: the newest sample, until the next one. Every other predictor falls back to it."""

from dataclasses import dataclass

from codec.predictors.contract import Predictor, Trust
from codec.sample import Sample
from codec.vector import Vector


@dataclass(frozen=True, slots=True)
class Hold:
    value: Vector

    def at(self, tick: float, position: Vector) -> Vector:  # noqa: ARG002
        return self.value


def fit(newest: Sample, previous: Sample | None, trust: Trust) -> Hold:  # noqa: ARG001
    return Hold(newest.value)


ZOH = Predictor(fit, needs_previous=lambda _newest, _previous: False)
