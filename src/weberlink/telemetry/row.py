"""The record of a tick in the making: a side fills it field by field."""

from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO
from weberlink.telemetry.record import NAMES


class Row:
    """The values of a record in the making, by field; what a side does not fill stays 0."""

    __slots__ = NAMES

    def __init__(self) -> None:
        self.at = self.peer_at = 0.0
        nothing: Joints = ()
        self.position = self.raw = self.decoded = self.predicted = self.coded = self.output = nothing
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
        self.second_updates_sent = self.second_updates_received = 0
        self.second_bound = 0.0
        self.second_selected = self.second_sent = self.widened = self.second_widened = 0
