"""The record of a tick in the making: a side fills it field by field."""

from weberlink.geometry.joints import MOST_JOINTS, Joints
from weberlink.geometry.vector import ZERO
from weberlink.telemetry.record import JOINTS, NAMES

_UNUSED = (0.0,) * len(JOINTS)
NO_JOINTS = (*_UNUSED * 5, 0, 0)
"""The end of the record of a session without joints."""


def placed(values: Joints, joints: int) -> Joints:
    """The values of an arm's axes at their places in a record.

    Args:
        values: of the joints in order, and of the gripper if there is one.
        joints: how many of them are joints, 1 to 8.
    """
    return values[:joints] + _UNUSED[: MOST_JOINTS - joints] + (values[joints:] or _UNUSED[:1])


class Row:
    """The values of a record in the making, by field; what a side does not fill stays 0."""

    __slots__ = NAMES

    def __init__(self) -> None:
        self.at = self.peer_at = 0.0
        self.position = self.raw = self.decoded = self.predicted = self.coded = self.output = ZERO
        self.bound = self.weber = self.credit = 0.0
        self.tick = self.ticks_missed = self.slew_ticks = self.contact_ticks = 0
        self.datagrams_sent = self.datagrams_received = self.datagrams_lost = self.datagrams_dropped = 0
        self.bytes_sent = self.updates_sent = self.updates_received = self.repeats = self.heartbeats = 0
        self.lateness_us = self.work_us = self.codec_us = self.rtt_us = self.one_way_us = 0.0
        self.energy = self.jitter_us = self.incoming_loss = self.outgoing_loss = self.peer_burst = 0.0
        self.surface = ZERO
        self.surface_size = self.surface_stiffness = 0.0
        self.state = self.fault = self.selected = self.sent = self.received = 0
        self.clipped = self.ramping = self.model = self.settings = self.buttons = self.position_selected = 0
        self.rotation_updates_sent = self.rotation_updates_received = 0
        self.rotation_raw = self.rotation_decoded = self.rotation_output = ZERO
        self.rotation_bound = 0.0
        self.rotation_selected = self.rotation_sent = self.widened = self.rotation_widened = 0
        self.joint_position = self.joint_raw = self.joint_predicted = self.joint_decoded = self.joint_output = _UNUSED
        self.gripper_updates_sent = self.gripper_updates_received = self.gripper_sent = 0

    def values(self) -> tuple[float, ...]:
        """All of them, flat, in the order of `FIELDS`.

        Indices, since a star or an unpacking of each vector takes a compiled function four times as long.
        """
        position, raw, decoded, predicted = self.position, self.raw, self.decoded, self.predicted
        coded, output, surface = self.coded, self.output, self.surface
        turned, torque, turn = self.rotation_raw, self.rotation_decoded, self.rotation_output
        values = (
            self.at, self.peer_at,
            position[0], position[1], position[2], raw[0], raw[1], raw[2], decoded[0], decoded[1], decoded[2],
            predicted[0], predicted[1], predicted[2], coded[0], coded[1], coded[2], output[0], output[1], output[2],
            self.bound, self.weber, self.credit,
            self.tick, self.ticks_missed, self.slew_ticks, self.contact_ticks,
            self.datagrams_sent, self.datagrams_received, self.datagrams_lost, self.datagrams_dropped,
            self.bytes_sent, self.updates_sent, self.updates_received, self.repeats, self.heartbeats,
            self.lateness_us, self.work_us, self.codec_us, self.rtt_us, self.one_way_us,
            self.jitter_us, self.incoming_loss, self.outgoing_loss, self.peer_burst, self.energy,
            surface[0], surface[1], surface[2], self.surface_size, self.surface_stiffness,
            self.state, self.fault, self.selected, self.sent, self.received,
            self.clipped, self.ramping, self.model, self.settings, self.buttons, self.position_selected,
            self.gripper_sent,
            self.rotation_updates_sent, self.rotation_updates_received,
            turned[0], turned[1], turned[2], torque[0], torque[1], torque[2], turn[0], turn[1], turn[2],
            self.rotation_bound, self.rotation_selected, self.rotation_sent, self.widened, self.rotation_widened,
        )  # fmt: skip
        return values + self._arm()

    def _arm(self) -> tuple[float, ...]:
        if self.joint_position is _UNUSED:
            return NO_JOINTS
        return (
            self.joint_position
            + self.joint_raw
            + self.joint_predicted
            + self.joint_decoded
            + self.joint_output
            + (self.gripper_updates_sent, self.gripper_updates_received)
        )
