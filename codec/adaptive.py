"""Adaptive choice of the predictor: at every send, the candidate that would have sent least often lately.

Each candidate of each predictor in the bank runs a deadband loop of its own, a shadow. Its record is the number of its
sends, slowly forgotten: over a few sends similar candidates cannot be told apart, and the choice would be noise
(docs/adaptive/ compares other time constants). The receiver knows nothing of this: choice and parameters travel in the
update.
"""

from collections.abc import Callable, Sequence
from math import exp

from weberlink.codec.channel import Channel
from weberlink.codec.predictors.contract import Candidate, EncodeContext, History
from weberlink.codec.predictors.model import Hold, Model
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector
from weberlink.update import MAX_GAP

MEMORY = 3000.0
"""Time constant of the record [ticks]."""
HOPELESS = 3
"""A candidate whose model lasts no more ticks than this is suspended: it costs more time than it could save."""
REST = 16
"""Ticks for which it is suspended; it counts as sending as often as it did."""
PRESENT = 12.0
"""What an error of one deadband or more at this moment counts for, in sends."""
LEAST_FORCE_STEPS = 10.0
"""A contact is a force of so many wire steps at least, and twice the deadband at rest."""

Measure = Callable[[Vector, Vector], float]


class Shadow:
    """One candidate and its deadband loop.

    Attributes:
        selector: index in the bank of the predictor whose model the candidate makes.
        candidate: that makes it.
        doubt: factor on its record, as the choice compares it.
        error: of its prediction at the newest sample, in the unit of the values, before any send of its own.
    """

    def __init__(self, selector: int, candidate: Candidate, rest: Vector | None, doubt: float = 1.0) -> None:
        self.selector = selector
        self.candidate = candidate
        self.doubt = doubt
        self._model: Model | None = Hold(rest) if rest is not None else None
        self._remembered: object = None
        self._newest: Sample | None = None
        self._sends = 0.0
        self._at = 0
        self._wakes = -REST
        self.error = 0.0

    def follow(self, tick: int, actual: Vector, place: Vector, bound: float, measure: Measure) -> bool:
        """Predict a sample; returns whether this candidate would send it."""
        if self._wakes - REST <= tick < self._wakes:  # False if the sender's ticks restarted
            return False
        model = self._model
        if model is None:
            return True
        if self._remembered is None:
            predicted = model.at(tick, place)
        else:
            predicted, self._remembered = model.advance(tick, place, self._remembered)
        self.error = error = measure(predicted, actual)
        return not error <= bound

    def send(self, sample: Sample, bound: float, history: History) -> None:
        """Do what a sender with this candidate alone would do now."""
        earlier = self._newest
        tick = sample.tick
        lasted = tick - earlier.tick if earlier is not None else MAX_GAP + 1
        usable = earlier if 0 < lasted <= MAX_GAP else None
        self._model = self.candidate.model(EncodeContext(sample, usable, bound, history)) or Hold(sample.value)
        self._remembered = self._model.memory
        self._newest = sample
        sends = 1.0
        if lasted <= HOPELESS:
            self._wakes = tick + REST
            sends += REST / HOPELESS
        self._forget(tick)
        self._sends += sends

    def record(self, tick: int) -> float:
        """Recent sends; the fewer the better."""
        self._forget(tick)
        return self._sends

    def _forget(self, tick: int) -> None:
        # If the sender's ticks restarted, nothing is forgotten.
        passed = max(0, tick - self._at)
        self._at = tick
        self._sends *= exp(-passed / MEMORY)


class AdaptiveChoice:
    """The shadows of all candidates of a bank, and the choice among them."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._grid = channel.grid
        self._measure: Measure = channel.deadband.error
        self.reset()

    def reset(self) -> None:
        """Forget the signal."""
        channel = self._channel
        at_rest = channel.deadband.bound(ZERO, ZERO, ZERO, 0.0)
        least_force = max(2.0 * at_rest, LEAST_FORCE_STEPS * channel.value_quantizer.step)
        self._history = History()
        self._shadows: list[Shadow] = []
        self._followers = []
        for selector, predictor in enumerate(channel.predictors):
            candidates = predictor.candidates(channel.fit_limits, least_force)
            self._shadows += [Shadow(selector, each, channel.rest, predictor.doubt) for each in candidates.each]
            if candidates.follow is not None:
                self._followers.append(candidates.follow)

    def measure_with(self, measure: Measure) -> None:
        """Compare errors as another deadband does, from now on."""
        self._measure = measure

    def follow(self, tick: int, actual: Vector, place: Vector, bound: float) -> None:
        """Take in a sample as measured, within the range of the wire; `place` is where models are evaluated."""
        measure, history, grid = self._measure, self._history, self._grid
        follows = history.add(tick, actual, place)
        for follow in self._followers:
            follow(history, follows)
        sample: Sample | None = None
        for shadow in self._shadows:
            if shadow.follow(tick, actual, place, bound, measure):
                if sample is None:
                    sample = grid.sample(tick, grid.levels(actual, place))
                shadow.send(sample, bound, history)

    def choose(
        self, selectors: Sequence[int], newest: Sample, earlier: Sample | None, bound: float
    ) -> tuple[int, Model | None]:
        """The best of the allowed selectors for a sample to send, and its model; None to hold the sample."""
        best = min(
            (shadow for shadow in self._shadows if shadow.selector in selectors),
            key=lambda shadow: self._cost(shadow, newest.tick, bound),
        )
        return best.selector, best.candidate.model(EncodeContext(newest, earlier, bound, self._history))

    @staticmethod
    def _cost(shadow: Shadow, tick: int, bound: float) -> float:
        wrong = min(1.0, shadow.error / bound) if bound > 0.0 else 1.0
        return shadow.doubt * shadow.record(tick) + PRESENT * wrong
