"""The paper's predictors as candidates: their models are those of the two samples that travel."""

from weberlink.codec.adaptive.candidate import Occasion
from weberlink.codec.predictors import Model, Predictor, Trust


class Fitted:
    """A predictor that both ends fit alike."""

    __slots__ = ("_predictor", "_trust")

    def __init__(self, predictor: Predictor, trust: Trust) -> None:
        self._predictor = predictor
        self._trust = trust

    def model(self, occasion: Occasion) -> Model | None:
        return self._predictor.fit(occasion.newest, occasion.earlier, self._trust)
