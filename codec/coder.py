"""The two ends of a stream: the encoder predicts what the decoder holds, and makes an update when the error leaves the
deadband; the decoder evaluates the model of the newest update at any tick and position.
"""

from collections import deque
from collections.abc import Sequence
from math import inf
from typing import Any, NamedTuple

from weberlink.codec.channel import Channel
from weberlink.codec.choice import CHOICES, NOTHING, Ahead, Choice, DueSample
from weberlink.codec.deadband import Deadband, Measure
from weberlink.codec.predictors.contract import (
    UNFITTED,
    EstimatedPredictor,
    FittedPredictor,
    Model,
    ModelRecord,
    Predictor,
)
from weberlink.codec.rate import TokenBucket
from weberlink.codec.sample import Sample
from weberlink.geometry.joints import PART, Joints, is_finite, joined, parts
from weberlink.geometry.vector import ZERO, Vector, add, distance, subtract, within
from weberlink.update import MAX_GAP, Payload, PreviousSample, Update

# Largest ramp of a smooth update, of the deadband; the rest is for the error of the new model meanwhile. Without a ramp
# the displayed value jumps by the error of the old model, at least one just noticeable difference. The ramp holds a
# part of the jump back and removes it in equal steps. The mirror does the same, so the law of the encoder still holds.
RAMP = 0.4
Quantized = tuple[tuple[int, ...], Sample]  # Levels on the wire, and the sample that they stand for


class Decoded(NamedTuple):
    """What an update says to a part: its sample, its model, and the value of that model at the tick of the sample."""

    newest: Sample
    model: Model
    first: Vector


class Decoder:
    """The mirror of an `Encoder`.

    Its state depends only on the newest update that arrived and on the positions since. So after a loss, a reordering
    or a late start it agrees with the encoder from the next update on (with smoothing, from the end of the ramp on).
    With look-ahead a model is played as many ticks late as the encoder looks ahead.
    """

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._grid = channel.grid
        self._limits = channel.fit_limits
        self._predictors: list[Predictor] = [*channel.predictors]
        self._deadband = channel.deadband
        self._smoothing = channel.smoothing
        forms = channel.forms
        self._sizes = [form.newest[0] if channel.more else sum(form.newest) for form in forms]
        self._late = channel.lookahead
        self.is_arm = channel.joints > 0  # whether the values are those of an arm's joints
        self._places = channel.position_quantizer
        self._lowest, self._highest = channel.value_quantizer.lowest, channel.value_quantizer.highest
        # The decoders of the parts; this one is the first, and its attributes are those of that part.
        self.parts: list[Decoder] = [self, *[Decoder(part) for part in channel.more]]
        # Levels of each part in those of an update; what the last part gets too much, it refuses.
        starts = range(0, PART * len(self.parts), PART)
        self._slices = [slice(start, start + PART if start < starts[-1] else None) for start in starts]
        self.reset()

    def reset(self) -> None:
        """Forget the signal: `value` returns the channel's `rest` until the first update. The deadband stays."""
        self._former, self._since = self._deadband, -inf
        self.newest: Sample | None = None  # that was received
        self.model: Model | None = None  # of that sample
        self.selected = 0  # index in the bank of the predictor in use
        self.first: Vector = ZERO  # value of the model at the tick of its sample, without a ramp
        self.record: ModelRecord = UNFITTED  # the model as telemetry records it
        self._applied: Update | None = None
        self._memory: Any = None
        self._noted: tuple[float, Any] | None = None
        self._ramp: Vector | None = None
        for part in self.parts[1:]:
            part.reset()

    @property
    def state(self) -> list[tuple[int, Model | None, Sample | None, Any]]:
        """All that a prediction depends on, except a ramp: selector, model, newest sample and memory, of each part."""
        return [(part.selected, part.model, part.newest, part._memory) for part in self.parts]

    def retune(self, deadband: Deadband, since: float = -inf) -> None:
        """Size ramps by another deadband, that of the encoder; without smoothing this changes nothing.

        Args:
            deadband: of the encoder.
            since: tick of the sender at which its encoder changed; updates made before may arrive later.
        """
        self._former, self._deadband, self._since = self._deadband, deadband, since

    def apply(self, update: Update) -> None:
        """Replace the state by that of an update; one that was applied already, and is repeated, changes nothing.

        Raises:
            ValueError: if selector, number of levels or payload do not fit the channel; the state is unchanged then.
        """
        if update != self._applied:  # the model of a repeated one has a memory of the positions since
            self.take(update, self.read(update))

    def read(self, update: Update) -> list[Decoded]:
        """What an update says to each part; changes nothing and raises as `apply`."""
        tick, selector, newest, payload = update
        if not 0 <= selector < len(self._predictors):
            raise ValueError(f"update selects predictor {selector} of a bank of {len(self._predictors)}")
        predictor, decoded = self._predictors[selector], []
        for part, own in zip(self.parts, self._slices, strict=True):
            levels, grid, previous = newest[own], part._grid, payload
            if len(levels) != part._sizes[selector]:
                raise ValueError(f"update has {len(levels)} levels, expected {part._sizes[selector]}")
            if len(self.parts) > 1 and isinstance(payload, PreviousSample):
                previous = PreviousSample(payload.gap, payload.levels[own])
            sample = grid.sample(tick, levels)
            model = predictor.decode(previous, sample, grid, part._limits)
            first = part._channel.displayable(model.first(sample), sample) if predictor.estimated else sample.value
            decoded.append(Decoded(sample, model, first))
        return decoded

    def take(self, update: Update, decoded: Sequence[Decoded]) -> None:
        """Replace the state by that of an update that was read."""
        for part, (newest, model, first) in zip(self.parts, decoded, strict=True):
            part._ramp = part._ramp_from(newest, first) if part._smoothing else None
            part.model, part.newest, part.selected, part.first = model, newest, update.selector, first
            part.record = model.record()
            part._memory, part._noted = model.memory, None
        self._applied = update

    def _ramp_from(self, newest: Sample, first: Vector) -> Vector | None:
        """From the first value of a new model to that of the model before, as far as `RAMP` of the deadband."""
        if self._noted is not None and self._noted[0] == newest.tick:
            self._memory = self._noted[1]  # a mirror was asked in this tick already: that change is undone
        tick, sample = newest.tick + self._late, newest.value
        before = self.value(tick, newest.position)
        if before is None:
            return None
        # The ramp starts within a share of the deadband around the sample, even if the model starts elsewhere.
        bound = (self._deadband if tick >= self._since else self._former).bound(sample, sample, sample, 0.0)
        ramp = subtract(add(sample, within(subtract(before, sample), RAMP * bound)), first)
        return ramp if ramp != ZERO else None

    def value(self, tick: float, position: Vector = ZERO) -> Vector | None:
        """The value to display, finite and within the range of the wire; of an arm, that of its first part.

        Args:
            tick: the present time on the sender's tick clock; fractional between its ticks.
            position: the present commanded position [m]; not read on a position channel. A model with friction
                remembers it, so call this once per tick.

        Returns:
            Force [N] or position [m]; the channel's `rest` before the first update.
        """
        newest, model, ramp = self.newest, self.model, self._ramp
        if newest is None or model is None:
            return self._channel.rest
        tick -= self._late
        if tick == newest.tick:
            value = self.first
        else:
            if self._places is not None:
                position = self._places.confine(position)
            if self._memory is None:
                value = model.at(tick, position)
            else:
                if self._noted is None or self._noted[0] != tick:
                    self._noted = tick, self._memory
                value, self._memory = model.advance(tick, position, self._memory)
            (x, y, z), low, high = value, self._lowest, self._highest
            if not (low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]):
                value = self._channel.displayable(value, newest)
        if ramp is None:
            return value
        left = min(1.0, max(0.0, 1.0 - (tick - newest.tick) / self._smoothing))
        if left == 0.0:
            self._ramp = None
            return value
        shown = (value[0] + left * ramp[0], value[1] + left * ramp[1], value[2] + left * ramp[2])
        return self._channel.displayable(shown, newest)

    def joints(self, tick: float, position: Vector = ZERO) -> Joints | None:  # noqa: ARG002 - as `value`
        """As `value`, of all joints of an arm [rad or N m]."""
        values: list[Vector] = []
        for part in self.parts:
            value = part.value(tick)
            if value is None:
                return None
            values.append(value)
        return joined(values, self._channel.joints)

    def stated(self, tick: float, position: Vector) -> Vector:
        """As `value`, for another place or tick, and without the memory; zero before the first update."""
        newest, model = self.newest, self.model
        if newest is None or model is None:
            return ZERO
        value = model.at(tick - self._late, position if self._places is None else self._places.confine(position))
        (x, y, z), low, high = value, self._lowest, self._highest
        if low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]:
            return value
        return self._channel.displayable(value, newest)


class PendingSample(NamedTuple):
    """A measured sample that waits for its decision; `bound` is its deadband if it were displayed and sent."""

    tick: int
    value: Joints
    actual: Vector
    position: Vector
    most: float
    bound: float


class Part:
    """Up to three axes of a stream at its sending end."""

    __slots__ = ("actual", "deadband", "error", "grid", "levels", "mirror", "newest", "quantizer", "shown")

    def __init__(self, channel: Channel, mirror: Decoder) -> None:
        self.grid, self.quantizer, self.mirror = channel.grid, channel.value_quantizer, mirror
        self.newest: Sample | None = None  # that was sent
        self.levels: tuple[int, ...] = ()  # of it, on the wire
        self.actual: Vector = ZERO  # of the sample to code, within the range of the wire
        self.shown: Vector | None = None  # what the mirror displays instead
        self.retune(channel.deadband)

    def retune(self, deadband: Deadband) -> None:
        self.deadband = deadband
        self.error: Measure = distance if deadband.is_ball else deadband.error


class Encoder:
    """Closed-loop deadband coding with a bank of predictors.

    The encoder compares each sample with a mirror of the decoder, to which it applies the updates it returns. The law:
    on a lossless link, at every tick, the mirror's value is within the deadband of the measured one, or within half a
    wire step per axis if that is more. An update that would not be nearer than the prediction is not sent.

    At a send the channel's choice (`weberlink.codec.choice`) selects the predictor that is used until the next one. A
    bounded rate of updates widens the deadband of a busy signal (`weberlink.codec.rate`).

    With look-ahead the sample of L ticks ago is coded in a tick, and the law holds for the signal delayed by L: the
    mirror is evaluated at the tick and at the commanded position of the coded sample.
    """

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._joints = channel.joints
        self._lowest, self._highest = channel.value_quantizer.lowest, channel.value_quantizer.highest
        self._reads_value = channel.position_quantizer is None  # A deadband reads the motion of the value itself
        self._lookahead = channel.lookahead
        self._predictors = channel.predictors
        self._sizes = [sum(form.newest) for form in channel.forms]
        self._reads = [sum(form.previous or ()) for form in channel.forms]
        self.mirror = Decoder(channel)  # the state of the other end if no update was lost
        self._parts = [
            Part(each, mirror) for each, mirror in zip((channel, *channel.more), self.mirror.parts, strict=True)
        ]
        self._choice: Choice = CHOICES[channel.choice](channel)
        self._follows = self._choice.follows
        self._bucket: TokenBucket | None = None
        if channel.rate is not None:
            at_rest = channel.deadband.bound(ZERO, ZERO, ZERO, 0.0)
            self._bucket = TokenBucket(channel.rate, max(at_rest, channel.value_quantizer.step))
        self._selectors = tuple(range(len(self._predictors)))
        self._pending: deque[PendingSample] = deque()
        self.rejected = 0  # number of samples that were not finite, and so were not coded
        self.reset()

    def reset(self) -> None:
        """Forget the signal, because the other end started anew. Deadband, predictors selected and tokens stay."""
        self._pending.clear()
        self._forget()

    def _forget(self) -> None:
        """Forget what was sent, and what was estimated."""
        self.mirror.reset()
        self._choice.reset()
        for part in self._parts:
            part.newest, part.levels = None, ()
        self._last: Vector | None = None
        self._arrived: Vector | None = None
        self.bound = 0.0  # deadband of the last sample, widened by the rate limit; its error if no token was left
        self.widened = False  # whether the rate limit widened it
        rest = self.mirror.joints(0.0) if self._joints else self._channel.rest
        self.coded: Joints = rest or (0.0,) * (self._joints or 3)  # the last coded sample as measured
        self.predicted: Joints | None = None  # the value at the other end for it, before any update
        self.held: Joints | None = None  # what the other end holds after this tick if nothing was lost
        self._forced = False

    def restart(self) -> None:
        """Forget what was sent and send the next sample unconditionally, because the other end's state is unknown.

        The samples that wait for their decision are of the same signal, and stay.
        """
        self._forget()
        self._forced = True

    def retune(self, deadband: Deadband, selectors: Sequence[int], more: Sequence[Deadband] = ()) -> None:
        """Change deadband and predictors from the next sample on; the other end needs to know of it for smoothing only.

        If the predictor in use is no longer selected, the next sample is sent unconditionally.

        Args:
            deadband: the bound on an unsent error.
            selectors: indices in the bank of the predictors to choose among.
            more: the deadbands of the further parts of an arm.

        Raises:
            ValueError: for no selector, or one that is not in the bank; nothing is changed then.
        """
        count = len(self._predictors)
        if not selectors or not all(0 <= selector < count for selector in selectors):
            raise ValueError(f"selectors must name some of a bank of {count} predictors, not {list(selectors)!r}")
        for part, each in zip(self._parts, (deadband, *more), strict=True):
            part.retune(each)
        self._choice.deadband = deadband
        self.mirror.retune(deadband)
        if not deadband.reads_motion:
            self._last = self._arrived = None
        self._selectors = tuple(sorted(set(selectors)))
        if self._parts[0].newest is not None:  # without one, what a restart demanded stands
            self._forced = self.mirror.selected not in self._selectors

    def encode(self, tick: int, value: Joints, position: Vector = ZERO, most: float = inf) -> Update | None:
        """Take the sample of one tick, and code the one of L ticks ago.

        Args:
            tick: the sender's tick number, higher in every call.
            value: measured force [N], position [m], or values of all joints [rad or N m]; saturated at the range of the
                wire.
            position: commanded position at which a force was measured [m]; not read on a position channel.
            most: largest error that may stay unsent, where the deadband allows more; a bounded rate widens this too.

        Returns:
            The update to send; None if the prediction is good enough, if there is no sample of L ticks ago, or if that
            was not finite (counted in `rejected`).

        Raises:
            ValueError: the sample has another number of values than the channel.
        """
        first = self._parts[0]
        if self._joints:
            if len(value) != self._joints:
                raise ValueError(f"a sample has {len(value)} axes, expected {self._joints}")
            good = is_finite(value)
            for part, each in zip(self._parts, parts(value), strict=True):
                part.actual = part.quantizer.confine(each)
        else:
            vector: Any = value
            (x, y, z), (u, v, w), low, high = vector, position, self._lowest, self._highest
            good = u - u == v - v == w - w == 0.0
            if low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]:
                first.actual = vector
            else:
                good = good and x - x == y - y == z - z == 0.0
                first.actual = first.quantizer.confine(vector)
        if not good:
            self.rejected += 1
            return self.decide(tick)
        if self._lookahead == 0:
            return self._code(tick, tick, value, position, most, NOTHING)
        actual = first.actual
        pending = self._pending
        if pending and tick <= pending[-1].tick:  # the sender's ticks began anew
            pending.clear()
        deadband, moved = first.deadband, 0.0
        if deadband.reads_motion:
            place = actual if self._reads_value else position
            moved, self._arrived = distance(place, self._arrived or place), place
        bound = min(deadband.bound(actual, actual, actual, moved), most)
        if self._follows:
            self._choice.learn(tick, actual, self._channel.place(position), bound)
        pending.append(PendingSample(tick, value, actual, position, most, bound))
        return self.decide(tick)

    def decide(self, tick: int) -> Update | None:
        """Code the sample of L ticks ago in a tick that has none itself, as `encode` does.

        A tick without a sample gets no decision, and neither does a sample whose time passed while nothing was encoded.
        """
        pending, due = self._pending, tick - self._lookahead
        while pending and pending[0].tick < due:
            pending.popleft()
        if not pending or pending[0].tick != due:
            return None
        coded, value, self._parts[0].actual, position, most, _ = pending.popleft()
        # What is known follows the sample without a gap.
        following = [each for step, each in enumerate(pending, 1) if each.tick == coded + step]
        ahead = Ahead(
            tuple([each.actual for each in following]),
            tuple([self._channel.place(each.position) for each in following]),
            tuple([each.bound for each in following]),
        )
        return self._code(tick, coded, value, position, most, ahead)

    def idle(self, tick: int, value: Joints, position: Vector) -> None:
        """A tick in which nothing is encoded; `value` is the newest measurement."""
        self.coded = value
        self.held = self.mirror.joints(tick) if self._joints else self.mirror.value(tick, position)

    def _code(self, now: int, tick: int, value: Joints, position: Vector, most: float, ahead: Ahead) -> Update | None:
        """Code the sample of `tick`, which the parts hold."""
        self.coded = value
        first, error = self._parts[0], inf if self._forced else 0.0
        for part in self._parts:
            part.shown = shown = part.mirror.value(now, position)
            apart = inf if shown is None else part.error(shown, part.actual)
            if not apart <= error:
                error = apart
        actual, shown, deadband, moved = first.actual, first.shown, first.deadband, 0.0
        if self._joints and shown is not None:
            self.predicted = self.held = joined([part.shown or ZERO for part in self._parts], self._joints)
        else:
            self.predicted = self.held = shown
        # The deadband in force is that of the first part for all.
        if deadband.reads_motion:
            place = actual if self._reads_value else position
            moved, self._last = distance(place, self._last or place), place
        displayed = shown or actual
        bound = deadband.bound(actual, displayed, displayed if first.newest is None else first.newest.value, moved)
        self.bound = bound = bound if bound < most else most
        self.widened = False
        if self._bucket is not None:
            self.bound = self._bucket.widened(tick, bound)
            self.widened, bound = self.bound > bound, self.bound
        if self._follows:
            self._choice.follow(tick, actual, self._channel.place(position), bound, ahead)
        return None if error <= bound else self._send(tick, position, error, bound, ahead)

    def _send(self, tick: int, position: Vector, error: float, bound: float, ahead: Ahead) -> Update | None:
        """Make the update of a sample whose error is beyond the deadband, and apply it to the mirror.

        None if it would not be nearer, or if no token is left for it.
        """
        quantized: list[Quantized] = []
        least = 0.0
        for part in self._parts:
            quantized.append(part.grid.quantize(tick, part.actual, position))
            least = max(part.error(quantized[-1][1].value, part.actual), least)
        if error <= least:
            return None
        first, sample, mirror = self._parts[0], quantized[0][1], self.mirror
        if self._bucket is not None and not self._bucket.take(forced=self._forced or first.shown is None):
            self.bound = error
            return None
        self._forced = False
        earlier = first.newest
        if earlier is not None and not 0 < sample.tick - earlier.tick <= MAX_GAP:
            earlier = None
        place = self._channel.place(position)
        due = DueSample(sample, earlier, first.actual, place, self.bound, ahead, mirror.selected, mirror.model)
        selector, model = self._choice.choose(self._selectors, due)
        predictor = self._predictors[selector]
        levels: tuple[int, ...] = ()
        former: tuple[int, ...] = ()
        reads_previous = False  # where one part reads it, it travels for all
        for part, (own, each) in zip(self._parts, quantized, strict=True):
            levels += own
            former += part.levels
            if earlier is not None and part.newest is not None and isinstance(predictor, FittedPredictor):
                reads_previous = reads_previous or predictor.needs_previous(each, part.newest)
            part.newest, part.levels = each, own
        payload: Payload = None
        if reads_previous and earlier is not None:
            payload = PreviousSample(sample.tick - earlier.tick, former[: self._reads[selector]])
        elif model is not None and isinstance(predictor, EstimatedPredictor):
            payload = predictor.packed(model, sample, first.grid)
        update = Update(sample.tick, selector, levels[: self._sizes[selector]], payload)
        decoded = mirror.read(update)
        # A model that would not begin within the deadband is not sent: the sample is held.
        if first.error(decoded[0].first, first.actual) > max(bound, least):
            update = update._replace(payload=None)
            decoded = mirror.read(update)
        mirror.take(update, decoded)
        self.held = joined([each.first for each in decoded], self._joints) if self._joints else decoded[0].first
        return update
