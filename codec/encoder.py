"""The sending end: predicts what the decoder holds, and makes an update when the error leaves the deadband."""

from collections import deque
from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING, NamedTuple

from weberlink.codec.channel import Channel
from weberlink.codec.deadband import Deadband
from weberlink.codec.decoder import Decoder
from weberlink.codec.predictors.contract import FittedPredictor
from weberlink.codec.predictors.estimation import NOTHING, Ahead
from weberlink.codec.rate import TokenBucket
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, distance, is_finite
from weberlink.update import MAX_GAP, Update

if TYPE_CHECKING:
    from weberlink.codec.adaptive import AdaptiveChoice


class Taken(NamedTuple):
    """A measured sample that waits for its decision; `bound` is its deadband if it were displayed and sent."""

    tick: int
    value: Vector
    actual: Vector
    position: Vector
    most: float
    bound: float = 0.0


class Window:
    """The samples that are known and not yet decided on: the decision on one waits for the next `length` ticks.

    A tick without a sample gets no decision, and neither does a sample whose time passed while nothing was encoded.
    """

    def __init__(self, length: int) -> None:
        self.length = length
        self._samples: deque[Taken] = deque()

    def clear(self) -> None:
        self._samples.clear()

    def take(self, sample: Taken) -> None:
        """Add the sample of a tick. One that does not rise (the sender's ticks began anew) clears the window."""
        samples = self._samples
        if samples and sample.tick <= samples[-1].tick:
            samples.clear()
        samples.append(sample)

    def due(self, tick: int) -> Taken | None:
        """Remove and return the sample of `length` ticks before this one; None if there was none."""
        samples, due = self._samples, tick - self.length
        while samples and samples[0].tick < due:
            samples.popleft()
        return samples.popleft() if samples and samples[0].tick == due else None

    def following(self, tick: int) -> list[Taken]:
        """The samples that follow a tick without a gap."""
        run: list[Taken] = []
        for sample in self._samples:
            tick += 1
            if sample.tick != tick:
                break
            run.append(sample)
        return run


class Encoder:
    """Closed-loop deadband coding with a bank of predictors.

    The encoder compares each sample with a mirror of the decoder, to which it applies the updates it returns. The law:
    on a lossless link, at every tick, the mirror's value is within the deadband of the measured one, or within half a
    wire step per axis if that is more. An update that would not be nearer than the prediction is not sent.

    With several predictors in the bank this is the paper's hybrid: at a send it chooses the predictor whose value
    *before* the update is closest (after it, all of them pass through the sample) and uses it until the next send. An
    adaptive channel chooses by the records of the predictors instead (`weberlink.codec.adaptive`). A bounded rate of
    updates widens the deadband of a busy signal (`weberlink.codec.rate`).

    With look-ahead the sample of L ticks ago is coded in a tick, and the law holds for the signal delayed by L: the
    mirror is evaluated at the tick and at the commanded position of the coded sample.

    Attributes:
        mirror: the state of the other end if no update was lost.
        coded: the last coded sample as measured; before the first, what the other end starts from.
        bound: its deadband in the unit of the values, widened by the rate limit; its error if no token was left.
        widened: whether the rate of updates widened it.
        predicted: the value at the other end for that sample, before any update; None if it had none.
        rejected: number of samples that were not finite, and so were not coded.
    """

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._predictors = channel.predictors
        self._fitted = [each for each in channel.predictors if isinstance(each, FittedPredictor)]
        self._grid = channel.grid
        self._sizes = [sum(form.newest) for form in channel.forms]
        self.mirror = Decoder(channel)
        self._quantizer = channel.value_quantizer
        self._choice: AdaptiveChoice | None = None
        if channel.estimates:
            from weberlink.codec import adaptive  # noqa: PLC0415 - where a file asks for it

            self._choice = adaptive.AdaptiveChoice(channel)
        self._bucket: TokenBucket | None = None
        if channel.rate is not None:
            at_rest = channel.deadband.bound(ZERO, ZERO, ZERO, 0.0)
            self._bucket = TokenBucket(channel.rate, max(at_rest, channel.value_quantizer.step))
        self._deadband = channel.deadband
        self._selectors = tuple(range(len(self._predictors)))
        self._window = Window(channel.lookahead)
        self.rejected = 0
        self.reset()

    def reset(self) -> None:
        """Forget the signal, because the other end started anew. Deadband, predictors selected and tokens stay."""
        self._window.clear()
        self._forget()

    def _forget(self) -> None:
        """Forget what was sent, and what was estimated."""
        self.mirror.reset()
        if self._choice is not None:
            self._choice.reset()
        self._newest: Sample | None = None
        self._previous: Sample | None = None
        self._levels: tuple[int, ...] = ()
        self._last: Vector | None = None
        self._arrived: Vector | None = None
        self.bound = 0.0
        self.widened = False
        self.coded: Vector = self._channel.rest or ZERO
        self.predicted: Vector | None = None
        self._forced = False

    def restart(self) -> None:
        """Forget what was sent and send the next sample unconditionally, because the other end's state is unknown.

        The samples that wait for their decision are of the same signal, and stay.
        """
        self._forget()
        self._forced = True

    def retune(self, deadband: Deadband, selectors: Sequence[int]) -> None:
        """Change deadband and predictors from the next sample on; the other end needs to know of it for smoothing only.

        If the predictor in use is no longer selected, the next sample is sent unconditionally.

        Args:
            deadband: the bound on an unsent error.
            selectors: indices in the bank of the predictors to choose among.

        Raises:
            ValueError: for no selector, or one that is not in the bank; nothing is changed then.
        """
        count = len(self._predictors)
        if not selectors or not all(0 <= selector < count for selector in selectors):
            raise ValueError(f"selectors must name some of a bank of {count} predictors, not {list(selectors)!r}")
        self._deadband = deadband
        if self._choice is not None:
            self._choice.retune(deadband)
        self.mirror.retune(deadband)
        if not deadband.reads_motion:
            self._last = self._arrived = None
        self._selectors = tuple(sorted(set(selectors)))
        if self._newest is not None:  # without one, what a restart demanded stands
            self._forced = self.mirror.selected not in self._selectors

    def encode(self, tick: int, value: Vector, position: Vector = ZERO, most: float = inf) -> Update | None:
        """Take the sample of one tick, and code the one of L ticks ago.

        Args:
            tick: the sender's tick number, higher in every call.
            value: measured force [N] or position [m]; saturated at the range of the wire.
            position: commanded position at which a force was measured [m]; not read on a position channel.
            most: largest error that may stay unsent, where the deadband allows more; a bounded rate widens this too.

        Returns:
            The update to send; None if the prediction is good enough, if there is no sample of L ticks ago, or if that
            was not finite (counted in `rejected`).
        """
        if not (is_finite(value) and is_finite(position)):
            self.rejected += 1
            return self.decide(tick)
        actual = self._quantizer.confine(value)
        if self._window.length == 0:
            return self._code(tick, tick, value, actual, position, most, NOTHING)
        self._window.take(self._taken(tick, value, actual, position, most))
        return self.decide(tick)

    def _taken(self, tick: int, value: Vector, actual: Vector, position: Vector, most: float) -> Taken:
        """A sample that waits, with its deadband; what learns from all samples learns from it."""
        deadband, moved = self._deadband, 0.0
        if deadband.reads_motion:
            place = self._moving(actual, position)
            moved, self._arrived = distance(place, self._arrived if self._arrived is not None else place), place
        bound = min(deadband.bound(actual, actual, actual, moved), most)
        if self._choice is not None:
            self._choice.learn(tick, actual, self._channel.place(position), bound)
        return Taken(tick, value, actual, position, most, bound)

    def decide(self, tick: int) -> Update | None:
        """Code the sample of L ticks ago in a tick that has none itself, as `encode` does."""
        sample = self._window.due(tick)
        if sample is None:
            return None
        coded, value, actual, position, most, _ = sample
        return self._code(tick, coded, value, actual, position, most, self._ahead(coded))

    def _code(
        self, now: int, tick: int, value: Vector, actual: Vector, position: Vector, most: float, ahead: Ahead
    ) -> Update | None:
        """Code the sample of `tick`."""
        self.coded = value
        deadband, bucket, newest, moved = self._deadband, self._bucket, self._newest, 0.0
        if deadband.reads_motion:
            place = self._moving(actual, position)
            moved, self._last = distance(place, self._last if self._last is not None else place), place
        displayed = self.predicted = self.mirror.value(now, position)
        compared = displayed if displayed is not None else actual
        sent = newest.value if newest is not None else compared
        allowed = min(deadband.bound(actual, compared, sent, moved), most)
        self.bound = bound = allowed if bucket is None else bucket.widened(tick, allowed)
        self.widened = bound > allowed
        if self._choice is not None:
            self._choice.follow(tick, actual, self._channel.place(position), bound, ahead)
        forced = displayed is None or self._forced
        error = inf if displayed is None or forced else deadband.error(displayed, actual)
        if error <= bound:
            return None
        levels = self._grid.levels(actual, position)
        sample = self._grid.sample(tick, levels)
        least = deadband.error(sample.value, actual)
        if error <= least:
            return None
        if bucket is not None and not bucket.take(forced=forced):
            self.bound = error
            return None
        return self.send(sample, levels, actual, position, ahead, max(bound, least))

    def send(
        self,
        sample: Sample,
        levels: tuple[int, ...],
        actual: Vector,
        position: Vector = ZERO,
        ahead: Ahead = NOTHING,
        most: float = inf,
    ) -> Update:
        """Make the update of a sample that was decided on, and apply it to the mirror.

        Args:
            sample: as the other end will hold it; `levels` are its levels on the wire.
            actual: the measured value within the range of the wire; `position` where it was measured [m].
            ahead: the samples that follow.
            most: largest error with which a model may begin; otherwise the sample is held.
        """
        earlier = self._newest
        if earlier is not None and not 0 < sample.tick - earlier.tick <= MAX_GAP:
            earlier = None
        if self._choice is None:
            selector, model = self._choose(sample, actual, position, earlier, ahead), None
        else:
            selector, model = self._choice.choose(self._selectors, sample, earlier, self.bound, ahead)
        payload = self._predictors[selector].encode(model, sample, earlier, self._levels, self._grid)
        update = Update(sample.tick, selector, levels[: self._sizes[selector]], payload)
        self._newest, self._previous, self._levels, self._forced = sample, earlier, levels, False
        decoded = self.mirror.read(update)
        if self._deadband.error(decoded.first, actual) > most:
            update = update._replace(payload=None)
            decoded = self.mirror.read(update)
        self.mirror.take(update, decoded)
        return update

    def _moving(self, actual: Vector, position: Vector) -> Vector:
        """The position whose motion the deadband reads [m]."""
        return position if self._channel.position_quantizer is not None else actual

    def _ahead(self, tick: int) -> Ahead:
        """The samples that follow a tick without a gap."""
        following, place = self._window.following(tick), self._channel.place
        return Ahead(
            tuple(sample.actual for sample in following),
            tuple(place(sample.position) for sample in following),
            tuple(sample.bound for sample in following),
        )

    def _choose(self, sample: Sample, actual: Vector, position: Vector, earlier: Sample | None, ahead: Ahead) -> int:
        """The paper's choice: the smallest w_i = |f_pred,i - f| / |f|. The common divisor |f| is left out.

        With look-ahead it is made among the predictors whose new models last longest in the known signal.
        """
        newest, previous, selectors = self._newest, self._previous, self._selectors
        if newest is None or len(selectors) == 1:
            return selectors[0]
        channel, predictors = self._channel, self._fitted  # all of the bank: `Channel` sees to it
        place, limits = channel.place(position), channel.fit_limits
        if ahead.values:
            new = [predictors[selector].model(sample, earlier, limits) for selector in selectors]
            lasts = [ahead.lasts(model, sample.tick, self._deadband.error) for model in new]
            selectors = tuple(selector for selector, ticks in zip(selectors, lasts, strict=True) if ticks == max(lasts))
        models = [predictors[selector].model(newest, previous, limits) for selector in selectors]
        errors = [distance(channel.displayable(model.at(sample.tick, place), newest), actual) for model in models]
        return selectors[errors.index(min(errors))]
