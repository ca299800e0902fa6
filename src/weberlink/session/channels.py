"""The channels of a side: a codec, a stream of updates, a sensor or place on this end each, and their telemetry."""

from collections.abc import Callable, Sequence
from math import nan
from typing import Any

from weberlink.codec import Decoder, Encoder
from weberlink.codec.predictors.model import Hold
from weberlink.control.contract import UNREACHED_S
from weberlink.control.ends import MasterControl
from weberlink.control.port import Port, Sensor
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.protocol.events import Statistics
from weberlink.telemetry.record import ARM, HAND, MOST_RECEIVED, ROTATION, UNKNOWN, Layout
from weberlink.telemetry.row import Row, placed
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

    def encode(self, tick: int) -> None:
        """Encode the newest sample into `update`, where one must be sent."""
        value, position, most = self.sensor.sample()
        if self.unreached is not None:
            position = self.unreached.place(tick, value, position)
        self.update = self.encoder.encode(tick, value, position, most)


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
    """Fills in what a record holds of the streams: those of a hand and its rotation, or of an arm and its gripper."""

    def __init__(self, outgoing: Sequence[OutgoingChannel], incoming: Sequence[IncomingChannel], port: Port) -> None:
        self._outgoing, self._incoming, self._leads = outgoing, incoming, port.leads
        self._port: Any = port
        self._is_arm, self._has_second = incoming[0].decoder.is_arm, len(outgoing) > 1
        parts = [ARM] if self._is_arm else [HAND, ROTATION] if self._has_second else [HAND]
        self.layout = Layout(parts)

    def fill(self, row: Row, statistics: Statistics) -> None:
        outgoing: Any = self._outgoing[0]
        encoder = outgoing.encoder
        row.bound = encoder.bound
        row.sent = outgoing.update is not None
        row.widened = encoder.widened
        received = self._incoming[0].received
        row.received = received if received < MOST_RECEIVED else MOST_RECEIVED
        for incoming in self._incoming:
            incoming.received = 0
        if self._is_arm:
            self._fill_arm(row, statistics)
            return
        predicted: Any = encoder.predicted
        coded: Any = encoder.coded
        row.raw, row.coded, row.predicted = outgoing.sensor.value, coded, predicted or UNKNOWN
        sends, receives = encoder.mirror, self._incoming[0].decoder
        port = self._port
        if self._leads:
            force, row.position_selected = receives, sends.selected
            display = port.displays[0]
            row.position, row.raw = outgoing.sensor.value, outgoing.sensor.command
            row.decoded, row.output = display.decoded, display.output
        else:
            force, row.position_selected = sends, receives.selected
            held: Any = encoder.held
            row.decoded = held or ZERO
            row.position, row.output = port.commanded, port.applied
        row.selected = force.selected
        row.model, row.surface, row.surface_size, row.surface_stiffness = force.record
        if self._has_second:
            self._fill_rotation(row, statistics)

    def _fill_rotation(self, row: Row, statistics: Statistics) -> None:
        rotation, encoder = self._outgoing[1], self._outgoing[1].encoder
        if self._leads:
            row.rotation_selected, display = self._incoming[1].decoder.selected, self._port.displays[1]
            row.rotation_decoded, row.rotation_output = display.decoded, display.output
        else:
            row.rotation_selected = encoder.mirror.selected
            held: Any = encoder.held
            row.rotation_decoded, row.rotation_output = held or ZERO, self._port.tool.applied
        row.rotation_updates_sent = statistics.updates_sent[1]
        row.rotation_updates_received = statistics.updates_received[1]
        row.rotation_raw = rotation.sensor.value
        row.rotation_bound = encoder.bound
        row.rotation_sent = rotation.update is not None
        row.rotation_widened = encoder.widened

    def _fill_arm(self, row: Row, statistics: Statistics) -> None:
        predicted: Joints = ()
        held: Joints = ()
        values: Joints = ()
        for stream in self._outgoing:
            count = len(stream.sensor.value)
            predicted += stream.encoder.predicted or (nan,) * count
            held += stream.encoder.held or (0.0,) * count
            values += stream.sensor.value
        joints, port = len(self._outgoing[0].sensor.value), self._port
        if self._leads:
            where, sent, decoded, output = values, values, port.displays[0].decoded, port.displays[0].output
        else:
            where, sent, decoded, output = port.where, port.shown(values), held, port.applied
        row.joint_predicted, row.joint_position = placed(predicted, joints), placed(where, joints)
        row.joint_raw, row.joint_decoded = placed(sent, joints), placed(decoded, joints)
        row.joint_output = placed(output, joints)
        if self._has_second:
            row.gripper_updates_sent = statistics.updates_sent[1]
            row.gripper_updates_received = statistics.updates_received[1]
            row.gripper_sent = self._outgoing[1].update is not None
