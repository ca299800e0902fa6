"""The channels of a side: one codec, one stream of updates, and one sensor or place on this end each."""

from collections.abc import Callable
from typing import Any

from weberlink.codec import Decoder, Encoder
from weberlink.codec.predictors.model import Hold
from weberlink.control.contract import UNREACHED_S
from weberlink.control.ends import MasterControl
from weberlink.geometry.vector import Vector, norm
from weberlink.session.port import Sensor
from weberlink.update import Update


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
        """The position [m] for which a sample is coded: what the robot feels, as it is shown [N], and where [m]."""
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
        update: made in this tick, if any.
    """

    def __init__(
        self, name: str, stream: int, encoder: Encoder, sensor: Sensor, unreached: Unreached | None = None
    ) -> None:
        self.name, self.stream, self.encoder, self.sensor, self.unreached = name, stream, encoder, sensor, unreached
        self.update: Update | None = None

    def encode(self, tick: int) -> None:
        """Encode the newest sample into `update`, where one must be sent."""
        value, position, most = self.sensor.sample()
        if self.unreached is not None:
            position = self.unreached.place(tick, value, position)
        self.update = self.encoder.encode(tick, value, position, most)


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
        value: gives the value at a tick of the peer and a position; None before the first update.
    """

    def __init__(
        self,
        name: str,
        stream: int,
        decoder: Decoder,
        place: Sensor | None = None,
        learner: MasterControl | None = None,
    ) -> None:
        self.name, self.stream, self.decoder, self.place, self.learner = name, stream, decoder, place, learner
        self.received = 0
        self.value = decoder.joints if decoder.is_arm else decoder.value

    def apply(self, update: Update) -> None:
        """Take an update.

        Raises:
            ValueError: it does not fit the channel; nothing is changed.
        """
        self.decoder.apply(update)
        self.received += 1
        if self.learner is not None:
            newest: Any = self.decoder.newest
            self.learner.learn(self.decoder.surface, newest.value, newest.position)
