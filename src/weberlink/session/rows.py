"""What telemetry records of the streams of a side."""

from collections.abc import Sequence
from math import nan
from typing import Any

from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO
from weberlink.protocol.events import Statistics
from weberlink.session.channels import IncomingChannel, OutgoingChannel
from weberlink.telemetry.record import ARM, HAND, MOST_RECEIVED, ROTATION, UNKNOWN, Layout
from weberlink.telemetry.row import Row, placed


class Rows:
    """Fills in what a record holds of the streams: those of a hand and its rotation, or of an arm and its gripper.

    Args:
        outgoing: streams of the side.
        incoming: streams of the side.
        leads: whether this is the operator's end.

    Attributes:
        layout: of the records.
    """

    def __init__(
        self, outgoing: Sequence[OutgoingChannel], incoming: Sequence[IncomingChannel], *, leads: bool
    ) -> None:
        self._outgoing, self._incoming, self._leads = outgoing, incoming, leads
        self._is_arm, self._has_second = incoming[0].decoder.is_arm, len(outgoing) > 1
        parts = [ARM] if self._is_arm else [HAND, ROTATION] if self._has_second else [HAND]
        self.layout = Layout(parts)

    def fill(self, row: Row, statistics: Statistics) -> None:
        outgoing = self._outgoing[0]
        encoder = outgoing.encoder
        row.bound = encoder.bound
        row.sent = outgoing.update is not None
        row.widened = encoder.widened
        row.received = min(self._incoming[0].received, MOST_RECEIVED)
        if self._is_arm:
            self._fill_arm(row, statistics)
            return
        predicted: Any = encoder.predicted
        coded: Any = encoder.coded
        row.raw, row.coded, row.predicted = outgoing.sensor.value, coded, predicted or UNKNOWN
        sends, receives = encoder.mirror, self._incoming[0].decoder
        if self._leads:
            force, row.position_selected = receives, sends.selected
        else:
            force, row.position_selected = sends, receives.selected
            held: Any = encoder.held
            row.decoded = held or ZERO
        row.selected = force.selected
        row.model, row.surface, row.surface_size, row.surface_stiffness = force.record
        if self._has_second:
            self._fill_rotation(row, statistics)

    def _fill_rotation(self, row: Row, statistics: Statistics) -> None:
        rotation, encoder = self._outgoing[1], self._outgoing[1].encoder
        if self._leads:
            row.rotation_selected = self._incoming[1].decoder.selected
        else:
            row.rotation_selected = encoder.mirror.selected
            held: Any = encoder.held
            row.rotation_decoded = held or ZERO
        row.rotation_updates_sent = statistics.updates_sent[1]
        row.rotation_updates_received = statistics.updates_received[1]
        row.rotation_raw = rotation.sensor.value
        row.rotation_bound = encoder.bound
        row.rotation_sent = rotation.update is not None
        row.rotation_widened = encoder.widened

    def _fill_arm(self, row: Row, statistics: Statistics) -> None:
        predicted: Joints = ()
        held: Joints = ()
        for stream in self._outgoing:
            count = len(stream.sensor.value)
            predicted += stream.encoder.predicted or (nan,) * count
            held += stream.encoder.held or (0.0,) * count
        joints = len(self._outgoing[0].sensor.value)
        row.joint_predicted = placed(predicted, joints)
        if not self._leads:
            row.joint_decoded = placed(held, joints)
        if self._has_second:
            row.gripper_updates_sent = statistics.updates_sent[1]
            row.gripper_updates_received = statistics.updates_received[1]
            row.gripper_sent = self._outgoing[1].update is not None
