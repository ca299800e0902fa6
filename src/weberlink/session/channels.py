"""The channels of a side: a codec, a stream of updates, a sensor or place on this end each, and their telemetry."""

from collections.abc import Callable, Sequence
from math import nan
from typing import Any

from weberlink.codec import Decoder, Encoder
from weberlink.codec.predictors.contract import Hold
from weberlink.control.contract import UNREACHED_S
from weberlink.control.ends import MasterControl
from weberlink.control.port import Port, Sensor
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import Vector, norm
from weberlink.protocol.events import Statistics
from weberlink.telemetry.record import MOST_RECEIVED, layout
from weberlink.telemetry.row import Row
from weberlink.update import Update


class Unreached:
    """Notices a contact that the operator feels by a model, and that the robot does not reach.

    The encoder compares what the robot feels with the model where the robot is, and the operator's end evaluates the
    same model where the hand is. Both agree as long as the robot follows. One that is held back (by a trip or its
    workspace) is where the model states nothing, so that a force would last on the hand which nothing touches. From
    then on what the robot feels is coded for the place to which it is `led` [m]: that takes the model back. Less than
    the `least` force [N] states no contact, but may be left over within the deadband."""

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
        """The position [m] for which a sample is coded: a force, as it is shown [N], where it is felt [m]."""
        x, y, z = value
        may_be_felt = type(self._mirror.model) is not Hold and x * x + y * y + z * z <= self._least_squared
        led = self._led() if may_be_felt else None
        if led is None or led == position or norm(self._mirror.stated(tick, led)) <= self._least:
            self._ticks = 0
            return position
        self._ticks += 1
        return position if self._ticks <= self._most and self._follows() else led


class OutgoingChannel:
    """A signal that this side senses and encodes; a force that the other end may feel elsewhere is looked after."""

    def __init__(self, encoder: Encoder, sensor: Sensor, unreached: Unreached | None = None) -> None:
        self.encoder, self.sensor, self.unreached = encoder, sensor, unreached
        self.update: Update | None = None  # made in this tick
        self.sampled: Joints = sensor.value  # what was to be encoded in this tick

    def encode(self, tick: int) -> None:
        """Encode the newest sample into `update`, where one must be sent."""
        self.sampled, position, most = self.sensor.sample()
        if self.unreached is not None:
            value: Any = self.sampled
            position = self.unreached.place(tick, value, position)
        self.update = self.encoder.encode(tick, self.sampled, position, most)

    def idle(self, tick: int) -> None:
        """A tick in which nothing is encoded."""
        self.update = None
        self.sampled, position, _ = self.sensor.sample()
        self.encoder.idle(tick, self.sensor.value, position)


class IncomingChannel:
    """A signal that this side decodes and actuates.

    Args:
        place: measures where the model is evaluated; None where the model does not read a position.
        learner: is told each received contact model; None for nobody.
    """

    def __init__(self, decoder: Decoder, place: Sensor | None = None, learner: MasterControl | None = None) -> None:
        self.decoder, self.place, self.learner = decoder, place, learner
        self.received = 0  # updates applied since the last record
        # Gives the value at a tick of the peer and a position; None before the first update.
        self.value = decoder.joints if decoder.is_arm else decoder.value

    def apply(self, update: Update) -> None:
        """Take an update; raises ValueError if it does not fit the channel; nothing is changed."""
        self.decoder.apply(update)
        self.received += 1
        if self.learner is not None:
            newest: Any = self.decoder.newest
            self.learner.learn(self.decoder.surface, newest.value, newest.position)


class Rows:
    """Fills in what a record holds of the streams; what the port commands and where it is, it reports itself."""

    def __init__(self, outgoing: Sequence[OutgoingChannel], incoming: Sequence[IncomingChannel], port: Port) -> None:
        self._outgoing, self._incoming, self._leads = outgoing, incoming, port.leads
        mirrors = [channel.encoder.mirror for channel in outgoing]
        decoders = [channel.decoder for channel in incoming]
        self._felt, self._led = (decoders, mirrors) if port.leads else (mirrors, decoders)
        self._has_second = len(outgoing) > 1
        self.layout = layout(sum(len(channel.sensor.value) for channel in outgoing), len(outgoing))

    def fill(self, row: Row, statistics: Statistics) -> None:
        measured: Joints = ()
        sampled: Joints = ()
        coded: Joints = ()
        predicted: Joints = ()
        held: Joints = ()
        for channel in self._outgoing:
            encoder, value = channel.encoder, channel.sensor.value
            measured += value
            sampled += channel.sampled
            coded += encoder.coded
            predicted += encoder.predicted or (nan,) * len(value)
            held += encoder.held or (0.0,) * len(value)
        row.coded, row.predicted = coded, predicted
        if self._leads:
            row.position, row.raw = measured, sampled
        else:
            row.raw, row.decoded = measured, held
        first, received = self._outgoing[0], self._incoming[0].received
        row.bound, row.widened, row.sent = first.encoder.bound, first.encoder.widened, first.update is not None
        row.received = received if received < MOST_RECEIVED else MOST_RECEIVED
        for incoming in self._incoming:
            incoming.received = 0
        row.selected, row.position_selected = self._felt[0].selected, self._led[0].selected
        row.model, row.surface, row.surface_size, row.surface_stiffness = self._felt[0].record
        if self._has_second:
            second = self._outgoing[1]
            row.second_bound, row.second_widened = second.encoder.bound, second.encoder.widened
            row.second_selected, row.second_sent = self._felt[1].selected, second.update is not None
            row.second_updates_sent = statistics.updates_sent[1]
            row.second_updates_received = statistics.updates_received[1]
