"""Zero-order hold: the newest sample, until the next one. The fallback of every other predictor."""

from typing import ClassVar

from weberlink.codec.predictors.contract import FittedPredictor
from weberlink.codec.predictors.model import FitLimits, Hold
from weberlink.codec.sample import Sample


class ZeroOrderHold(FittedPredictor):
    name: ClassVar[str] = "zoh"

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Hold:  # noqa: ARG002
        return Hold(newest.value)


ZOH = ZeroOrderHold()
