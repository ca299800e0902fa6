"""The receiving end: it holds the model of the newest update and says the value at any tick and position."""

from weberlink.codec.channel import Channel
from weberlink.codec.predictors import Model, Parametric
from weberlink.codec.predictors.linear import Line
from weberlink.codec.predictors.surface import Surface
from weberlink.codec.sample import Sample
from weberlink.codec.update import Update
from weberlink.geometry.vector import ZERO, Vector, add, is_finite, subtract


class Decoder:
    """The mirror of an `Encoder`.

    Its state is a function of the newest update that arrived and of the positions since, so no loss, reordering or late
    start can leave it in disagreement with the encoder for longer than until the next one. (Where updates are smoothed,
    the ramp from what was displayed before ends some ticks later: nobody is made to jump because of a loss.) Only the
    chosen predictor is computed.

    Attributes:
        newest: the newest sample received; None before the first.
        selected: index in the bank of the predictor in use.
    """

    __slots__ = ("_begin", "_channel", "_held", "_model", "_noted", "_predictors", "_ramp", "newest", "selected")

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._predictors = channel.predictors
        self.reset()

    def reset(self) -> None:
        """Forget the signal: `value` is the channel's rest until the first update."""
        self._model: Model | None = None
        self._begin: Vector = ZERO
        self._held: Vector | None = None
        self._noted: tuple[float, Vector] | None = None
        self._ramp: Vector | None = None
        self.newest: Sample | None = None
        self.selected = 0

    @property
    def state(self) -> tuple[int, Model | None, Sample | None, Vector | None]:
        """All that a prediction depends on but for a ramp: selected predictor, its model, the newest sample, and where
        a surface with friction holds the probe.
        """
        return self.selected, self._model, self.newest, self._held

    def apply(self, update: Update) -> None:
        """Take over the state that an update carries.

        Raises:
            ValueError: if it does not fit the channel (selector or number of levels); the state is unchanged.
        """
        channel = self._channel
        expected = channel.level_count
        if len(update.newest) != expected or len(update.previous) not in (0, expected):
            raise ValueError(f"update has {len(update.newest)}+{len(update.previous)} levels, expected {expected}")
        if not 0 <= update.selector < len(self._predictors):
            raise ValueError(f"update selects predictor {update.selector} of a bank of {len(self._predictors)}")
        newest = channel.sample(update.tick, update.newest)
        before = self._shown(newest.tick, newest.position) if channel.smoothing is not None else None
        predictor = self._predictors[update.selector]
        if isinstance(predictor, Parametric):
            model = predictor.model(update.gap, update.previous, newest, channel.grids, channel.trust)
        else:
            previous = channel.sample(update.tick - update.gap, update.previous) if update.previous else None
            model = predictor.model(newest, previous, channel.trust)
        self._model, self.newest, self.selected = model, newest, update.selector
        # A line says its beginning exactly; a stiff model evaluated at the exact position would miss the sample.
        self._begin = channel.displayable(model.value, newest) if isinstance(model, Line) else newest.value
        self._held, self._noted = model.memory if isinstance(model, Surface) else None, None
        self._ramp = self._ramp_from(before) if before is not None else None

    def value(self, tick: float, position: Vector = ZERO) -> Vector | None:
        """The value now: finite, and within the range of the wire.

        At the very tick of a sample it is that sample, or where the model begins instead: a stiff model evaluated at
        the exact position would miss it by up to stiffness times half a position step.

        Args:
            tick: now on the sender's tick clock; fractional between its ticks.
            position: the commanded position now [m]; not read on a position channel. A surface with friction takes
                note of it.

        Returns:
            Force [N] or position [m]; before the first update the channel's `rest`.
        """
        newest, model, channel = self.newest, self._model, self._channel
        if newest is None or model is None:
            return channel.rest
        if tick == newest.tick:
            value = self._begin
        elif self._held is None:
            value = channel.displayable(model.at(tick, channel.place(position)), newest)
        else:
            value = self._rubbed(tick, channel.place(position))
        return value if self._ramp is None else self._smoothed(value, tick)

    def _rubbed(self, tick: float, place: Vector) -> Vector:
        """By a surface with friction, which takes the probe's way into account."""
        newest, model = self.newest, self._model
        assert newest is not None
        assert isinstance(model, Surface)
        assert self._held is not None
        if self._noted is None or self._noted[0] != tick:
            self._noted = tick, self._held
        value, held = model.along(tick, place, self._held)
        # A place that is none is not remembered: all that follow would be none.
        if is_finite(held):
            self._held = held
        return self._channel.displayable(value, newest)

    def _shown(self, tick: float, position: Vector) -> Vector | None:
        """`value`, with nothing taken note of; nor earlier in this tick, when a mirror was asked and a receiver not."""
        if self._noted is not None and self._noted[0] == tick:
            self._held = self._noted[1]
        held = self._held
        shown = self.value(tick, position)
        self._held = held
        return shown

    def _ramp_from(self, before: Vector) -> Vector | None:
        """Begins near the sample, and not near where the model begins: that may be aside from it already."""
        channel, begin, newest = self._channel, self._begin, self.newest
        assert channel.smoothing is not None
        assert newest is not None
        sample = newest.value
        kept = channel.smoothing.kept(subtract(before, sample), channel.deadband.bound(sample, sample, sample, 0.0))
        ramp = subtract(add(sample, kept), begin)
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
