"""The receiving end: it holds the model of the newest update and says the value at any tick and position."""

from codec.channel import Channel
from codec.predictors import Model
from codec.sample import Sample
from codec.update import Update
from codec.vector import ZERO, Vector


class Decoder:
    """The mirror of an `Encoder`.

    Its whole state is a function of the newest update that arrived, so no loss, reordering or late start can leave
    it in disagreement with the encoder for longer than until the next one. Only the chosen predictor is computed.

    Attributes:
        newest: the newest sample received; None before the first.
        selected: index in the bank of the predictor in use.
    """

    __slots__ = ("_channel", "_model", "_predictors", "newest", "selected")

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._predictors = channel.predictors
        self.reset()

    def reset(self) -> None:
        """Forget the signal: `value` is the channel's rest until the first update."""
        self._model: Model | None = None
        self.newest: Sample | None = None
        self.selected = 0

    @property
    def state(self) -> tuple[int, Model | None, Sample | None]:
        """All that a prediction depends on: selected predictor, its fitted model, the newest sample."""
        return self.selected, self._model, self.newest

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
        previous = channel.sample(update.tick - update.gap, update.previous) if update.previous else None
        self._model = self._predictors[update.selector].model(newest, previous, channel.trust)
        self.newest = newest
        self.selected = update.selector

    def value(self, tick: float, position: Vector = ZERO) -> Vector | None:
        """The value now: finite, and within the range of the wire.

        At the very tick of a sample it is that sample: a stiff model evaluated at the exact position would miss it
        by up to stiffness times half a position step.

        Args:
            tick: now on the sender's tick clock; fractional between its ticks.
            position: the commanded position now [m]; not read on a position channel.

        Returns:
            Force [N] or position [m]; before the first update the channel's `rest`.
        """
        newest, model, channel = self.newest, self._model, self._channel
        if newest is None or model is None:
            return channel.rest
        if tick == newest.tick:
            return newest.value
        return channel.displayable(model.at(tick, channel.place(position)), newest)
