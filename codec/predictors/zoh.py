"""Zero-order hold: the newest sample, until the next one. Every other predictor falls back to it."""

from weberlink.codec.predictors.contract import Predictor
from weberlink.codec.predictors.model import FitLimits, Hold
from weberlink.codec.sample import Sample


class ZeroOrderHold(Predictor):
    name = "zoh"

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Hold:  # noqa: ARG002
        return Hold(newest.value)


ZOH = ZeroOrderHold()
