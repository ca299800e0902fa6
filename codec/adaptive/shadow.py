"""A deadband loop of its own for one candidate: what it would have sent, had it been alone.

The record of a candidate is the number of its sends, slowly forgotten. Over a few sends alike candidates cannot be told
apart, and the choice would be noise; docs/adaptive/ has the record with other times.
"""

from collections.abc import Callable
from math import exp

from weberlink.codec.adaptive.candidate import Candidate, Occasion
from weberlink.codec.adaptive.history import History
from weberlink.codec.predictors import Model
from weberlink.codec.predictors.hold import Hold
from weberlink.codec.predictors.surface import Surface
from weberlink.codec.sample import Sample
from weberlink.codec.update import MAX_GAP
from weberlink.geometry.vector import Vector

MEMORY = 3000.0
"""Time constant of the record [ticks]."""
HOPELESS = 3
"""A candidate that lasts for no more ticks than this is left alone for a while: it costs the tick more than it could
save.
"""
REST = 16
"""For so many ticks, for which it is taken to send as often as it did."""

Measure = Callable[[Vector, Vector], float]


class Shadow:
    """One candidate and its loop.

    Attributes:
        selector: index in the bank of the predictor whose model the candidate makes.
        candidate: that makes it.
        doubt: factor on its record, as the choice compares it.
        error: of its prediction at the newest sample, in the unit of the values, before any send of its own.
    """

    __slots__ = (
        "_at",
        "_held",
        "_model",
        "_newest",
        "_sends",
        "_wakes",
        "candidate",
        "doubt",
        "error",
        "selector",
    )

    def __init__(self, selector: int, candidate: Candidate, rest: Vector | None, doubt: float = 1.0) -> None:
        self.selector = selector
        self.candidate = candidate
        self.doubt = doubt
        self._model: Model | None = Hold(rest) if rest is not None else None
        self._held: Vector | None = None
        self._newest: Sample | None = None
        self._sends = 0.0
        self._at = 0
        self._wakes = -REST
        self.error = 0.0

    def follow(self, tick: int, actual: Vector, place: Vector, bound: float, measure: Measure) -> bool:
        """Predict a sample; returns whether this candidate would send it."""
        if self._wakes - REST <= tick < self._wakes:  # not if the sender's ticks began anew
            return False
        model = self._model
        if model is None:
            return True
        if self._held is None:
            said = model.at(tick, place)
        else:
            assert isinstance(model, Surface)
            said, self._held = model.along(tick, place, self._held)
        self.error = error = measure(said, actual)
        return not error <= bound

    def send(self, sample: Sample, bound: float, history: History) -> None:
        """Do what a sender with this candidate alone would do now."""
        earlier = self._newest
        tick = sample.tick
        lasted = tick - earlier.tick if earlier is not None else MAX_GAP + 1
        usable = earlier if 0 < lasted <= MAX_GAP else None
        self._model = self.candidate.model(Occasion(sample, usable, bound, history)) or Hold(sample.value)
        self._held = self._model.memory if isinstance(self._model, Surface) else None
        self._newest = sample
        sends = 1.0
        if lasted <= HOPELESS:
            self._wakes = tick + REST
            sends += REST / HOPELESS
        self._forget(tick)
        self._sends += sends

    def record(self, tick: int) -> float:
        """Sends lately; the smaller the better."""
        self._forget(tick)
        return self._sends

    def _forget(self, tick: int) -> None:
        # A sender that counts anew forgets nothing.
        passed = max(0, tick - self._at)
        self._at = tick
        self._sends *= exp(-passed / MEMORY)
