"""The paper's hybrid: the predictor whose value *before* the update is closest; after it, all pass through the sample.

The smallest w_i = |f_pred,i - f| / |f| is chosen, and used until the next send. The common divisor |f| is left out.
"""

from collections.abc import Sequence
from math import inf
from typing import ClassVar

from weberlink.codec.channel import Channel
from weberlink.codec.choice import Choice, DueSample
from weberlink.codec.predictors.contract import FittedPredictor
from weberlink.codec.predictors.model import Model
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import distance


class Hybrid(Choice):
    """With look-ahead it chooses among the predictors whose new models last longest in the known signal."""

    name: ClassVar[str] = "hybrid"

    def __init__(self, channel: Channel) -> None:
        super().__init__(channel)
        self._channel = channel
        # All of the bank: `Channel` sees to it.
        self._predictors = [each for each in channel.predictors if isinstance(each, FittedPredictor)]
        self.reset()

    @classmethod
    def bank(cls, signal: str) -> tuple[str, ...]:
        return ("zoh", "linear", "plane", "sphere") if signal == "force" else ("zoh", "linear")

    def reset(self) -> None:
        self._newest: Sample | None = None  # that was sent
        self._previous: Sample | None = None  # sent before that

    def choose(self, selectors: Sequence[int], due: DueSample) -> tuple[int, Model | None]:
        newest, previous = self._newest, self._previous
        self._newest, self._previous = due.newest, newest if due.earlier is not None else None
        if newest is None or len(selectors) == 1:
            return selectors[0], None
        channel, predictors, tick = self._channel, self._predictors, due.newest.tick
        limits = channel.fit_limits
        if due.ahead.values:
            new = [predictors[selector].model(due.newest, due.earlier, limits) for selector in selectors]
            lasts = [due.ahead.lasts(model, tick, self.deadband.error) for model in new]
            selectors = [selector for selector, ticks in zip(selectors, lasts, strict=True) if ticks == max(lasts)]
        best, smallest = selectors[0], inf
        for selector in selectors:
            # Of the predictor in use, the model is that of the other end.
            model = due.model if selector == due.selected else None
            if model is None:
                model = predictors[selector].model(newest, previous, limits)
            error = distance(channel.displayable(model.at(tick, due.place), newest), due.actual)
            if error < smallest:
                best, smallest = selector, error
        return best, None
