"""The incoming channels of a side, and what telemetry records of its channels."""

from collections.abc import Sequence
from math import nan

from weberlink.codec import Decoder
from weberlink.codec.outgoing import OutgoingChannel
from weberlink.control.contract import MasterControl
from weberlink.control.port import Port
from weberlink.geometry.joints import Joints
from weberlink.protocol.events import Statistics
from weberlink.telemetry.record import MOST_RECEIVED, layout
from weberlink.telemetry.row import Row


class IncomingChannel:
    """A signal that this side decodes and actuates.

    Args:
        place: measures where the model is evaluated; None where the model does not read a position.
        learner: is told each received contact model; None for nobody.
    """

    def __init__(
        self, decoder: Decoder, place: OutgoingChannel | None = None, learner: MasterControl | None = None
    ) -> None:
        self.decoder, self.place, self.learner = decoder, place, learner
        self.received = 0  # updates applied since the last record
        # Gives the value at a tick of the peer and a position; None before the first update.
        self.value = decoder.joints if decoder.is_arm else decoder.value


class Rows:
    """Fills in what a record holds of the streams; what the port commands and where it is, it reports itself."""

    def __init__(self, outgoing: Sequence[OutgoingChannel], incoming: Sequence[IncomingChannel], port: Port) -> None:
        self._outgoing, self._incoming, self._leads = outgoing, incoming, port.leads
        mirrors = [channel.encoder.mirror for channel in outgoing]
        decoders = [channel.decoder for channel in incoming]
        self._felt, self._led = (decoders, mirrors) if port.leads else (mirrors, decoders)
        self._has_second = len(outgoing) > 1
        self.layout = layout(sum(len(channel.value) for channel in outgoing), len(outgoing))

    def fill(self, row: Row, statistics: Statistics) -> None:
        measured: Joints = ()
        sampled: Joints = ()
        coded: Joints = ()
        predicted: Joints = ()
        held: Joints = ()
        for channel in self._outgoing:
            encoder, value = channel.encoder, channel.value
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
