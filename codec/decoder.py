"""The receiving end: it evaluates the model of the newest update at any tick and position."""

from collections.abc import Sequence
from math import inf
from typing import Any, NamedTuple

from weberlink.codec.channel import Channel
from weberlink.codec.deadband import Deadband
from weberlink.codec.predictors.contract import UNFITTED, Model, ModelRecord, Predictor
from weberlink.codec.sample import Sample
from weberlink.geometry.joints import PART, Joints, joined
from weberlink.geometry.vector import ZERO, Vector, add, subtract, within
from weberlink.update import PreviousSample, Update


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

    Attributes:
        newest: the newest sample received; None before the first.
        model: the model of that sample; None before the first.
        selected: index in the bank of the predictor in use.
        first: value of that model at the tick of that sample, without a ramp.
        record: the model in use, as telemetry records it.
        is_arm: whether the values are those of an arm's joints.
        parts: the decoders of the parts; this one is the first, and its other attributes are those of that part.
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
        self.is_arm = channel.joints > 0
        self._places = channel.position_quantizer
        self._lowest, self._highest = channel.value_quantizer.lowest, channel.value_quantizer.highest
        self.parts: list[Decoder] = [self, *[Decoder(part) for part in channel.more]]
        # Levels of each part in those of an update; what the last part gets too much, it refuses.
        starts = range(0, PART * len(self.parts), PART)
        self._slices = [slice(start, start + PART if start < starts[-1] else None) for start in starts]
        self.reset()

    def reset(self) -> None:
        """Forget the signal: `value` returns the channel's `rest` until the first update. The deadband stays."""
        self._former, self._since = self._deadband, -inf
        self.model: Model | None = None
        self.record: ModelRecord = UNFITTED
        self._applied: Update | None = None
        self.first: Vector = ZERO
        self._memory: Any = None
        self._noted: tuple[float, Any] | None = None
        self._ramp: Vector | None = None
        self.newest: Sample | None = None
        self.selected = 0
        for part in self.parts[1:]:
            part.reset()

    @property
    def state(self) -> list[tuple[int, Model | None, Sample | None, Any]]:
        """All that a prediction depends on, except a ramp: selector, model, newest sample and memory, of each part."""
        return [(part.selected, part.model, part.newest, part._memory) for part in self.parts]

    @property
    def surface(self) -> Any:
        """The contact surface of the model in use; None if the model describes none."""
        return None if self.model is None else self.model.surface()

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
            part._ramp = None if part._smoothing is None else part._ramp_of(newest, first, part._smoothing.share)
            part.model, part.newest, part.selected, part.first = model, newest, update.selector, first
            part.record = model.record()
            part._memory, part._noted = model.memory, None
        self._applied = update

    def _ramp_of(self, newest: Sample, first: Vector, share: float) -> Vector | None:
        """From the first value of a new model to that of the model before, as far as this share of the deadband."""
        if self._noted is not None and self._noted[0] == newest.tick:
            self._memory = self._noted[1]  # a mirror was asked in this tick already: that change is undone
        tick, sample = newest.tick + self._late, newest.value
        before = self.value(tick, newest.position)
        if before is None:
            return None
        # The ramp starts within a share of the deadband around the sample, even if the model starts elsewhere.
        bound = (self._deadband if tick >= self._since else self._former).bound(sample, sample, sample, 0.0)
        ramp = subtract(add(sample, within(subtract(before, sample), share * bound)), first)
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
        if ramp is None or self._smoothing is None:
            return value
        left = min(1.0, max(0.0, 1.0 - (tick - newest.tick) / self._smoothing.ticks))
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
