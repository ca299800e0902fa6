"""Adaptive choice of the predictor: every send uses the candidate that would have sent least often in the recent past.

Each candidate of each predictor in the bank runs its own deadband loop, a shadow encoder. Its record is the number of
its sends with exponential forgetting. The time constant is long, because a few sends do not tell similar candidates
apart. The receiver needs none of this: choice and parameters travel in the update.

The rule without forgetting, `doubt` and the weight of the present error is to follow the leader. If the best of N
candidates would send m times, then the sends charged to the leaders (those of ticks in which the leader would send) are
at most N (m + 1): each adds one to the count of a leader, and while the smallest count is c each candidate errs at most
once as a leader with that count. An adversary reaches the bound (Cesa-Bianchi and Lugosi, Prediction, Learning, and
Games, 2006). Forgetting is for a best candidate that changes (Littlestone and Warmuth, The weighted majority algorithm,
1994).
The bound is not one of the sends of a session: after a send the model in use is not that of the shadow. Measured, the
sends of most synthetic signals are 0.4 to 1.1 times the best of the paper's four (tests/test_selection.py).
"""

from collections.abc import Sequence
from math import exp
from typing import ClassVar

from weberlink.codec.channel import Channel
from weberlink.codec.choice import NOTHING, Ahead, Choice, DueSample
from weberlink.codec.deadband import Deadband
from weberlink.codec.predictors.contract import FitLimits, FittedPredictor, Hold, Model, Predictor
from weberlink.codec.predictors.signal_based import ZOH
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.update import MAX_GAP
from weberlink_predictors.estimation import Candidate, CandidatePredictor, EncodeContext, History, Signal

MEMORY_S = 3.0  # Time constant of the record [s]
MIN_LIFETIME_S = 0.003  # A candidate whose model lasts no longer is suspended: it costs time and saves no update [s]
REST_S = 0.016  # Length of a suspension [s]; meanwhile one send per `MIN_LIFETIME_S` is added to the record
PRESENT_ERROR_WEIGHT = 12.0  # In the choice without look-ahead: an error of one deadband or more is as many sends
BANKS = {
    "force": ("plane", "sphere", "surface", "affine", "path", "elastic", "linear", "zoh"),
    "torque": ("zoh", "linear", "affine", "path", "elastic"),
    "position": ("zoh", "linear", "path"),
}
"""The default banks, by signal; that of a force begins with contacts: all are equally good before the first force."""
LEAST_FORCE_STEPS = 10.0  # Smallest force that is a contact, in wire steps; twice the deadband at rest if that is more


class FittedCandidate:
    """The candidate of a fitted predictor."""

    def __init__(self, predictor: FittedPredictor, limits: FitLimits) -> None:
        self._predictor, self._limits = predictor, limits

    def model(self, context: EncodeContext) -> Model | None:
        return self._predictor.fit(context.newest, context.earlier, self._limits)


class Shadow:
    """One candidate and its deadband loop; `error` is that of its prediction at the newest sample that it followed."""

    def __init__(
        self, selector: int, candidate: Candidate, rest: Vector | None, doubt: float = 1.0, period: float = 1e-3
    ) -> None:
        self.selector = selector
        self._memory = MEMORY_S / period
        self._min_lifetime = MIN_LIFETIME_S / period
        self._rest = round(REST_S / period)
        self.candidate = candidate
        self.doubt = doubt
        self._model: Model | None = Hold(rest) if rest is not None else None
        self._remembered: object = None
        self._newest: Sample | None = None
        self._sends = 0.0
        self._at = 0
        self._wakes = -self._rest
        self.error = 0.0

    def follow(self, tick: int, actual: Vector, place: Vector, bound: float, deadband: Deadband) -> bool:
        """Predict a sample; returns whether this candidate would send it."""
        if self.is_suspended(tick):
            return False
        model = self._model
        if model is None:
            return True
        if self._remembered is None:
            predicted = model.at(tick, place)
        else:
            predicted, self._remembered = model.advance(tick, place, self._remembered)
        self.error = error = deadband.error(predicted, actual)
        return not error <= bound

    def is_suspended(self, tick: int) -> bool:
        return self._wakes - self._rest <= tick < self._wakes  # False if the sender's ticks restarted

    def send(self, sample: Sample, bound: float, history: History, ahead: Ahead = NOTHING) -> None:
        """Make a new model, as a sender with this candidate alone would do now."""
        earlier = self._newest
        tick = sample.tick
        lasted = tick - earlier.tick if earlier is not None else MAX_GAP + 1
        usable = earlier if 0 < lasted <= MAX_GAP else None
        self._model = self.candidate.model(EncodeContext(sample, usable, bound, history, ahead)) or Hold(sample.value)
        self._remembered = self._model.memory
        self._newest = sample
        sends = 1.0
        if lasted <= self._min_lifetime:
            self._wakes = tick + self._rest
            sends += REST_S / MIN_LIFETIME_S
        self._forget(tick)
        self._sends += sends

    def record(self, tick: int) -> float:
        """Number of recent sends; fewer is better."""
        self._forget(tick)
        return self._sends

    def _forget(self, tick: int) -> None:
        passed = max(0, tick - self._at)  # 0 if the sender's ticks restarted
        self._at = tick
        self._sends *= exp(-passed / self._memory)


def shadows_of(selector: int, predictor: Predictor, channel: Channel, signal: Signal) -> list[Shadow]:
    """One for each way of the predictor to make a model, the simplest first."""
    candidates: Sequence[Candidate] = []
    doubt = 1.0
    if isinstance(predictor, FittedPredictor):
        candidates = [FittedCandidate(predictor, signal.limits)]
    elif isinstance(predictor, CandidatePredictor):
        candidates, doubt = predictor.candidates(signal), predictor.doubt
    return [Shadow(selector, each, channel.rest, doubt, channel.tick_period) for each in candidates]


class AdaptiveChoice(Choice):
    """The shadows of all candidates of a bank, and the choice among them; `deadband` measures the errors."""

    name: ClassVar[str] = "adaptive"
    follows: ClassVar[bool] = True

    def __init__(self, channel: Channel) -> None:
        super().__init__(channel)
        self._channel = channel
        self._grid = channel.grid
        self._hold = channel.bank.index(ZOH.name) if ZOH.name in channel.bank else -1
        self.reset()

    @classmethod
    def bank(cls, signal: str) -> tuple[str, ...]:
        return BANKS[signal]

    @classmethod
    def takes(cls, predictor: Predictor) -> bool:
        return isinstance(predictor, FittedPredictor | CandidatePredictor)

    def reset(self) -> None:
        channel = self._channel
        at_rest = channel.deadband.bound(ZERO, ZERO, ZERO, 0.0)
        least_force = max(2.0 * at_rest, LEAST_FORCE_STEPS * channel.value_quantizer.step)
        self._history, self._known = History(channel.tick_period), History(channel.tick_period)
        self._signal = Signal(self._grid, channel.fit_limits, least_force)
        self._shadows = [
            shadow
            for selector, predictor in enumerate(channel.predictors)
            for shadow in shadows_of(selector, predictor, channel, self._signal)
        ]
        self._estimators = tuple(self._signal.estimators.values())

    def learn(self, tick: int, actual: Vector, place: Vector, bound: float) -> None:
        """Let the estimators take in a sample that is not coded yet."""
        self._add(self._known, tick, actual, place, bound, learns=True)

    def _add(self, history: History, tick: int, actual: Vector, place: Vector, bound: float, *, learns: bool) -> None:
        for each, value, there in (*history.missing(tick, actual, place), (tick, actual, place)):
            history.add(each, value, there, bound)
            if learns:
                for estimator in self._estimators:
                    estimator.follow(history)

    def follow(self, tick: int, actual: Vector, place: Vector, bound: float, ahead: Ahead = NOTHING) -> None:
        """Run all shadows on a measured sample within the range of the wire; models are evaluated at `place` [m]."""
        deadband, history, grid = self.deadband, self._history, self._grid
        self._add(history, tick, actual, place, bound, learns=not self._channel.lookahead)
        if len(self._shadows) == 1:  # there is no choice
            return
        sample: Sample | None = None
        for shadow in self._shadows:
            if shadow.follow(tick, actual, place, bound, deadband):
                if sample is None:
                    _, sample = grid.quantize(tick, actual, place)
                shadow.send(sample, bound, history, ahead)

    def choose(self, selectors: Sequence[int], due: DueSample) -> tuple[int, Model | None]:
        """The best of the allowed selectors for a sample to send, and its model; the model None holds the sample.

        Where the control scheme renders the contact, those that describe a surface and are not suspended come first
        while there is a force. A model that leaves the deadband within the known signal is a last resort: of such the
        one that lasts longest. A model that does not begin within the deadband is left out. A sample that is held goes
        by `zoh` where that is allowed, which sends no position.
        """
        newest, earlier, actual, place, bound, ahead, *_ = due
        context = EncodeContext(newest, earlier, bound, self._history, ahead)
        allowed = [shadow for shadow in self._shadows if shadow.selector in selectors]
        # With look-ahead the known signal says more than the present error.
        weight = 0.0 if self._channel.lookahead else PRESENT_ERROR_WEIGHT
        allowed.sort(
            key=lambda shadow: (
                shadow.doubt * shadow.record(newest.tick)
                + weight * (min(1.0, shadow.error / bound) if bound > 0.0 else 1.0)
            )
        )
        renders = self._channel.every_position and norm(newest.value) > self._signal.least_contact
        best: tuple[int, Model | None] = (allowed[0].selector, None)
        highest = (False, -1)
        for shadow in allowed:
            model = shadow.candidate.model(context)
            if model is not None:  # a surface may not hold a force outside of its friction cone
                memory = model.memory
                first = model.first(newest) if memory is None else model.advance(newest.tick, place, memory)[0]
                if not self.deadband.error(first, actual) <= bound:
                    continue
            surface = model is not None and model.surface() is not None and not shadow.is_suspended(newest.tick)
            suits = not renders or surface
            rank = (suits, ahead.lasts(model or Hold(newest.value), newest.tick, self.deadband.error))
            if rank > highest:
                highest, best = rank, (shadow.selector, model)
            if rank == (True, len(ahead.values)):
                break
        return (self._hold, None) if best[1] is None and self._hold in selectors else best
