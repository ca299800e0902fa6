"""Zero-order hold: the newest sample, until the next one. Every other predictor falls back to it."""

from weberlink.codec.predictors.contract import Predictor, Trust
from weberlink.codec.predictors.hold import Hold
from weberlink.codec.sample import Sample


def fit(newest: Sample, previous: Sample | None, trust: Trust) -> Hold:  # noqa: ARG001
    return Hold(newest.value)


def needs_previous(newest: Sample, previous: Sample) -> bool:  # noqa: ARG001
    return False


ZOH = Predictor(fit, needs_previous)

__all__ = ["ZOH", "Hold"]
