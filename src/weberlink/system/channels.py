"""The channels of a side: one codec, one stream of updates, and one sensor or place on this end each."""

from typing import TYPE_CHECKING, Any

from weberlink.codec import Decoder, Encoder
from weberlink.codec.predictors.model import UNFITTED, ModelRecord
from weberlink.control.contract import MasterControl
from weberlink.control.port import Sensor
from weberlink.geometry.vector import ZERO
from weberlink.update import Update

if TYPE_CHECKING:
    from weberlink.codec.bundle import BundleDecoder, BundleEncoder

Value = Any
"""A vector, or the joints of an arm; None for nothing."""


class OutgoingChannel:
    """A signal that this side senses and encodes.

    Args:
        name: as the configuration names it.
        stream: number of its updates on the wire.
        encoder: of the channel.
        sensor: gives the samples.

    Attributes:
        coded: the sample that this tick decided on; without one, the newest measurement.
        update: made in this tick, if any.
        held: what the decoder of the peer holds after this tick if nothing was lost; None for nothing.
        model: the contact model of the newest update.
    """

    def __init__(self, name: str, stream: int, encoder: "Encoder | BundleEncoder", sensor: Sensor) -> None:
        self.name, self.stream, self.encoder, self.sensor = name, stream, encoder, sensor
        self._sample = sensor.sample
        self.coded: Value = sensor.value
        self.update: Update | None = None
        self.held: Value = None
        self.model: ModelRecord = UNFITTED

    def reset(self) -> None:
        self.encoder.reset()
        self.model = UNFITTED

    def encode(self, tick: int) -> None:
        """Encode the newest sample into `update`, where one must be sent."""
        encoder = self.encoder
        value, position, most = self._sample()
        self.update = update = encoder.encode(tick, value, position, most)
        self.coded = encoder.coded
        if update is None:
            self.held = encoder.predicted
            return
        mirror = encoder.mirror
        self.held = mirror.first
        self.model = mirror.record

    def idle(self, tick: int) -> None:
        """A tick in which nothing is encoded."""
        self.update, self.coded = None, self.sensor.value
        self.held = self.encoder.mirror.value(tick, self.sensor.sample()[1])


class IncomingChannel:
    """A signal that this side decodes and actuates.

    Args:
        name: as the configuration names it.
        stream: number of its updates on the wire.
        decoder: of the channel.
        place: measures where the model is evaluated; None where the model does not read a position.
        learner: is told each received contact model; None for nobody.

    Attributes:
        received: updates applied in this tick.
        model: the contact model of the newest update.
    """

    def __init__(
        self,
        name: str,
        stream: int,
        decoder: "Decoder | BundleDecoder",
        place: Sensor | None = None,
        learner: MasterControl | None = None,
    ) -> None:
        self.name, self.stream, self.decoder = name, stream, decoder
        self._place = place
        self._learner = learner
        self._value = decoder.value
        self.received = 0
        self.model: ModelRecord = UNFITTED

    def reset(self) -> None:
        self.decoder.reset()
        self.model = UNFITTED

    def apply(self, update: Update) -> None:
        """Take an update.

        Raises:
            ValueError: it does not fit the channel; nothing is changed.
        """
        self.decoder.apply(update)
        self.received += 1
        self.model = self.decoder.record
        if self._learner is not None:
            newest: Any = self.decoder.newest
            self._learner.learn(self.decoder.surface, newest.value, newest.position)

    def decode(self, tick: float) -> Value:
        """The value now; `tick` is of the peer. None before the first update."""
        place = self._place
        return self._value(tick, ZERO if place is None else place.value)
