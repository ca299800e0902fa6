"""What telemetry records of the channels of a side: those of a hand and a tool, or those of an arm's joints."""

from collections.abc import Sequence
from math import nan
from typing import Any, Protocol

from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO
from weberlink.protocol.events import Statistics
from weberlink.session.channels import IncomingChannel, OutgoingChannel
from weberlink.telemetry.record import MOST_RECEIVED, UNKNOWN
from weberlink.telemetry.row import Row, placed


class ChannelRows(Protocol):
    """Fills in what a record holds of the channels."""

    def fill(self, row: Row, statistics: Statistics) -> None: ...


class CartesianRows:
    """Force and position and, with six degrees of freedom, torque and orientation.

    Args:
        outgoing: channels of the side.
        incoming: channels of the side.
        leads: whether this is the operator's end.
    """

    def __init__(
        self, outgoing: Sequence[OutgoingChannel], incoming: Sequence[IncomingChannel], *, leads: bool
    ) -> None:
        self._outgoing, self._incoming, self._leads = outgoing, incoming, leads
        self._rotates = len(outgoing) > 1

    def fill(self, row: Row, statistics: Statistics) -> None:
        outgoing, incoming = self._outgoing[0], self._incoming[0]
        encoder: Any = outgoing.encoder
        sends, hears = encoder.mirror.selected, incoming.decoder.selected
        if self._leads:
            force, row.selected, row.position_selected = incoming.decoder.record, hears, sends
        else:
            force, row.selected, row.position_selected = encoder.mirror.record, sends, hears
            row.decoded = encoder.held or ZERO
        row.raw = outgoing.sensor.value
        row.predicted = encoder.predicted or UNKNOWN
        row.coded = encoder.coded
        row.bound = encoder.bound
        row.model, row.surface, row.surface_size, row.surface_stiffness = force
        row.sent = outgoing.update is not None
        row.widened = encoder.widened
        row.received = min(incoming.received, MOST_RECEIVED)
        if self._rotates:
            self._fill_rotation(row, statistics)

    def _fill_rotation(self, row: Row, statistics: Statistics) -> None:
        rotation, incoming = self._outgoing[1], self._incoming[1]
        if self._leads:
            row.rotation_selected = incoming.decoder.selected
        else:
            row.rotation_selected = rotation.encoder.mirror.selected
            held: Any = rotation.encoder.held
            row.rotation_decoded = held or ZERO
        row.rotation_updates_sent = statistics.updates_sent[1]
        row.rotation_updates_received = statistics.updates_received[1]
        row.rotation_raw = rotation.sensor.value
        row.rotation_bound = rotation.encoder.bound
        row.rotation_sent = rotation.update is not None
        row.rotation_widened = rotation.encoder.widened


class JointRows:
    """The joints of an arm and its gripper, each in deadbands: the bound of a channel is 1.

    Args: as of `CartesianRows`.
    """

    def __init__(
        self, outgoing: Sequence[OutgoingChannel], incoming: Sequence[IncomingChannel], *, leads: bool
    ) -> None:
        self._outgoing, self._incoming, self._leads = outgoing, incoming, leads
        self._counts = [len(channel.sensor.value) for channel in outgoing]

    def fill(self, row: Row, statistics: Statistics) -> None:
        joints, grips = self._outgoing[0], self._outgoing[1:]
        row.bound = joints.encoder.bound
        row.sent = joints.update is not None
        row.widened = joints.encoder.widened
        row.received = min(self._incoming[0].received, MOST_RECEIVED)
        predicted: Joints = ()
        held: Joints = ()
        for channel, count in zip(self._outgoing, self._counts, strict=True):
            predicted += channel.encoder.predicted or (nan,) * count
            held += channel.encoder.held or (0.0,) * count
        row.joint_predicted = placed(predicted, self._counts[0])
        if not self._leads:
            row.joint_decoded = placed(held, self._counts[0])
        if grips:
            row.gripper_updates_sent = statistics.updates_sent[1]
            row.gripper_updates_received = statistics.updates_received[1]
            row.gripper_sent = grips[0].update is not None
