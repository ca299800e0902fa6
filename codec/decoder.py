"""The receiving end: it evaluates the model of the newest update at any tick and position."""

from math import inf
from typing import Any, NamedTuple

from weberlink.codec.channel import Channel
from weberlink.codec.deadband import Deadband
from weberlink.codec.predictors import ContactSurface, Model
from weberlink.codec.predictors.model import UNFITTED, ModelRecord
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, add, subtract
from weberlink.update import Update


class Decoded(NamedTuple):
    """What an update says: its sample, its model, and the value of that model at the tick of the sample."""

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
    """

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._grid = channel.grid
        self._predictors = channel.predictors
        self._deadband = channel.deadband
        self._sizes = [sum(form.newest) for form in channel.forms]
        self._late = channel.lookahead
        self.reset()

    def reset(self) -> None:
        """Forget the signal: `value` returns the channel's `rest` until the first update. The deadband stays."""
        self._former, self._since = self._deadband, -inf
        self.model: Model | None = None
        self._applied: Update | None = None
        self.first: Vector = ZERO
        self._memory: Any = None
        self._noted: tuple[float, Any] | None = None
        self._ramp: Vector | None = None
        self.newest: Sample | None = None
        self.selected = 0

    @property
    def state(self) -> tuple[int, Model | None, Sample | None, Any]:
        """All that a prediction depends on, except a ramp: selector, model, newest sample and memory of the model."""
        return self.selected, self.model, self.newest, self._memory

    @property
    def surface(self) -> ContactSurface | None:
        """The contact surface of the model in use; None if the model describes none."""
        return None if self.model is None else self.model.surface()

    @property
    def record(self) -> ModelRecord:
        """The model in use, as telemetry records it."""
        return UNFITTED if self.model is None else self.model.record()

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

    def read(self, update: Update) -> Decoded:
        """What an update says; changes nothing and raises as `apply`."""
        channel, grid = self._channel, self._grid
        if not 0 <= update.selector < len(self._predictors):
            raise ValueError(f"update selects predictor {update.selector} of a bank of {len(self._predictors)}")
        if len(update.newest) != self._sizes[update.selector]:
            raise ValueError(f"update has {len(update.newest)} levels, expected {self._sizes[update.selector]}")
        predictor = self._predictors[update.selector]
        newest = grid.sample(update.tick, update.newest)
        model = predictor.decode(update.payload, newest, grid, channel.fit_limits)
        first = channel.displayable(model.first(newest), newest) if predictor.estimated else newest.value
        return Decoded(newest, model, first)

    def take(self, update: Update, decoded: Decoded) -> None:
        """Replace the state by that of an update that was read."""
        newest, model, first = decoded
        before = None
        if self._channel.smoothing is not None:
            if self._noted is not None and self._noted[0] == newest.tick:
                self._memory = self._noted[1]  # a mirror was asked in this tick already: that change is undone
            before = self._value(newest.tick, newest.position)
        self.model, self.newest, self.selected, self._applied = model, newest, update.selector, update
        self.first = first
        self._memory, self._noted = model.memory, None
        self._ramp = self._ramp_from(before) if before is not None else None

    def value(self, tick: float, position: Vector = ZERO) -> Vector | None:
        """The value to display, finite and within the range of the wire.

        Args:
            tick: the present time on the sender's tick clock; fractional between its ticks.
            position: the present commanded position [m]; not read on a position channel. A model with friction
                remembers it, so call this once per tick.

        Returns:
            Force [N] or position [m]; the channel's `rest` before the first update.
        """
        return self._value(tick - self._late, position)

    def stated(self, tick: float, position: Vector) -> Vector:
        """As `value`, for another place or tick, and without the memory; zero before the first update."""
        newest, model, channel = self.newest, self.model, self._channel
        if newest is None or model is None:
            return ZERO
        return channel.displayable(model.at(tick - self._late, channel.place(position)), newest)

    def _value(self, tick: float, position: Vector) -> Vector | None:
        """The prediction for a tick of the signal."""
        newest, model, channel = self.newest, self.model, self._channel
        if newest is None or model is None:
            return channel.rest
        if tick == newest.tick:
            value = self.first
        elif self._memory is None:
            value = channel.displayable(model.at(tick, channel.place(position)), newest)
        else:
            if self._noted is None or self._noted[0] != tick:
                self._noted = tick, self._memory
            predicted, self._memory = model.advance(tick, channel.place(position), self._memory)
            value = channel.displayable(predicted, newest)
        return value if self._ramp is None else self._smoothed(value, tick)

    def _ramp_from(self, before: Vector) -> Vector | None:
        """The ramp starts within a share of the deadband around the sample, even if the model starts elsewhere."""
        channel, first, newest = self._channel, self.first, self.newest
        assert channel.smoothing is not None
        assert newest is not None
        sample = newest.value
        deadband = self._deadband if newest.tick + self._late >= self._since else self._former
        kept = channel.smoothing.kept(subtract(before, sample), deadband.bound(sample, sample, sample, 0.0))
        ramp = subtract(add(sample, kept), first)
        return ramp if ramp != ZERO else None

    def _smoothed(self, value: Vector, tick: float) -> Vector:
        newest, ramp, channel = self.newest, self._ramp, self._channel
        assert newest is not None
        assert ramp is not None
        assert channel.smoothing is not None
        left = channel.smoothing.remaining(tick - newest.tick)
        if left == 0.0:
            self._ramp = None
            return value
        shown = (value[0] + left * ramp[0], value[1] + left * ramp[1], value[2] + left * ramp[2])
        return channel.displayable(shown, newest)
