"""The channels of a side: one codec, one stream of updates, and one sensor or place on this end each."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from weberlink.codec import Decoder, Encoder
from weberlink.codec.predictors.model import UNFITTED, Hold, ModelRecord
from weberlink.control.contract import UNREACHED_S
from weberlink.control.ends import MasterControl
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.session.port import Sensor
from weberlink.update import Update

if TYPE_CHECKING:
    from weberlink.codec.bundle import BundleDecoder, BundleEncoder

Value = Any
"""A vector, or the joints of an arm; None for nothing."""


class Unreached:
    """Notices a contact that the operator feels by a model, and that the robot does not reach.

    The encoder compares what the robot feels with the model where the robot is, and the operator's end evaluates the
    same model where the hand is. Both agree as long as the robot follows. One that is held back (by a trip or its
    workspace) is where the model states nothing, so that a force would last on the hand which nothing
    touches. From then on what the robot feels is coded for the place to which it is led: that takes the model back.

    Args:
        mirror: of the encoder.
        led: where the operator leads the robot [m]; None for nowhere.
        follows: whether the robot follows at all.
        least: smallest force that states a contact [N]: less may be left over within the deadband.
        tick_period: [s].
    """

    def __init__(
        self,
        mirror: Decoder,
        led: Callable[[], Vector | None],
        follows: Callable[[], bool],
        least: float,
        tick_period: float,
    ) -> None:
        self._mirror = mirror
        self._led, self._follows = led, follows
        self._least, self._least_squared = least, least * least
        self._most = round(UNREACHED_S / tick_period)
        self._ticks = 0

    def place(self, tick: int, value: Vector, position: Vector) -> Vector:
        """The position for which a sample is coded [m].

        Args:
            tick: present tick.
            value: what the robot feels, as it is shown [N].
            position: where it feels that [m].
        """
        x, y, z = value
        if type(self._mirror.model) is Hold or x * x + y * y + z * z > self._least_squared:
            self._ticks = 0
            return position
        led = self._led()
        if led is None or led == position or norm(self._mirror.stated(tick, led)) <= self._least:
            self._ticks = 0
            return position
        self._ticks += 1
        return position if self._ticks <= self._most and self._follows() else led


class OutgoingChannel:
    """A signal that this side senses and encodes.

    Args:
        name: as the configuration names it.
        stream: number of its updates on the wire.
        encoder: of the channel.
        sensor: gives the samples.
        unreached: looks after a force that the other end may feel elsewhere; None for other signals.

    Attributes:
        coded: the sample that this tick decided on; without one, the newest measurement.
        update: made in this tick, if any.
        held: what the decoder of the peer holds after this tick if nothing was lost; None for nothing.
        model: the contact model of the newest update.
    """

    def __init__(
        self,
        name: str,
        stream: int,
        encoder: "Encoder | BundleEncoder",
        sensor: Sensor,
        unreached: Unreached | None = None,
    ) -> None:
        self.name, self.stream, self.encoder, self.sensor = name, stream, encoder, sensor
        self._unreached = unreached
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
        if self._unreached is not None:
            position = self._unreached.place(tick, value, position)
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
