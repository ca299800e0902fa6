"""One session, from the keys on: reads its datagrams, and holds what makes them (`protocol.sending`).

Owns replay window, clock mapping, loss and credit of one pair of session keys. Knows no address, no handshake and no
state of the endpoint; what it carries are integers that it does not interpret.
"""

from math import inf
from typing import NamedTuple

from protocol.credit import Credit
from protocol.direction import Direction
from protocol.events import ChangeAnswered, ChangeProposed, PeerClosed, UpdateReceived
from protocol.heartbeat import HeartbeatSchedule
from protocol.loss import LossMeter
from protocol.reasons import DropReason
from protocol.replay import ReplayWindow
from protocol.security import Protection
from protocol.sending import Sender
from protocol.sequence import SEQUENCE_BITS, expand_counter
from protocol.statistics import Statistics
from protocol.timing import Clock
from protocol.wire import (
    TICK_BITS,
    Head,
    Kind,
    Report,
    read_head,
    sequence_of,
    split_acks,
    stream_of,
    unpack_bye,
    unpack_change,
    unpack_credit,
    unpack_report,
)

TICK_LEAD = 1.0
"""How far a sample tick may lie after the datagram that carries it [s]; the owner's tick grid need not be exact."""

CHANGE_LEAD = 30.0
"""How far ahead of its datagram a proposed change may lie [s]."""

FADE_SHARE = 0.6
"""Share of the silence limit after which owners begin to fade force out and hold motion."""
HORIZON_SHARE = 0.6
"""Share of the silence limit for which owners extrapolate past the last sign of the peer's encoder."""
_HEARTBEAT, _BYE, _CHANGE = (
    int(Kind.HEARTBEAT),
    int(Kind.BYE),
    int(Kind.CHANGE),
)  # looking a member up costs more than comparing it


class Parameters(NamedTuple):
    """What all sessions of an endpoint have in common.

    Args:
        outgoing, incoming: layouts of each direction.
        epoch: when our clock was at 0 [s].
        tick_period: of both ends [s].
        silence: age beyond which nothing is executed, and silence beyond which the peer counts as gone [s].
    """

    outgoing: Direction
    incoming: Direction
    epoch: float
    tick_period: float
    silence: float


Outcome = UpdateReceived | PeerClosed | ChangeProposed | ChangeAnswered | DropReason | None
"""What an authentic datagram says, or why it is of no use; None where nobody need be told."""


class Opened(NamedTuple):
    """An authentic datagram: full sequence number, first byte, and the rest after the clear part."""

    sequence: int
    first: int
    body: bytes


class Session:
    """Both directions of one session.

    Attributes:
        clock: mapping to the peer's clock.
        credit: what each end has handed to the other, where the session carries that.
        sender: makes our datagrams.
        heard_at: when the last fresh authentic datagram came [s].
    """

    __slots__ = (
        "_incoming",
        "_loss",
        "_newest_report",
        "_parameters",
        "_protection",
        "_replay",
        "_statistics",
        "clock",
        "credit",
        "heard_at",
        "sender",
    )

    def __init__(
        self,
        protection: Protection,
        parameters: Parameters,
        statistics: Statistics,
        peer_clock: float,
        now: float,
        *,
        first_sequence: int = 1,
    ) -> None:
        """Begin a session.

        Args:
            statistics: counted into.
            peer_clock: departure of the peer's handshake datagram on its clock [s].
            now: arrival of that datagram [s].
            first_sequence: number of our first datagram, 1 to 2^23.
        """
        self._protection = protection
        self._parameters = parameters
        self._incoming = parameters.incoming
        self._statistics = statistics
        self.clock = Clock(parameters.epoch, peer_clock, now)
        self.credit = Credit()
        self.heard_at = now
        self._replay = ReplayWindow()
        self._loss = LossMeter()
        self._newest_report = -1
        self.sender = Sender(
            protection,
            parameters.outgoing,
            statistics,
            clock=self.clock,
            credit=self.credit,
            loss=self._loss,
            heartbeats=HeartbeatSchedule(
                now,
                fade=FADE_SHARE * parameters.silence,
                silence=parameters.silence,
                tick_period=parameters.tick_period,
            ),
            first_sequence=first_sequence,
        )

    def retime(self, departure: float, now: float) -> None:
        """Take a repeated handshake datagram as one more measurement of the clock."""
        if self.clock.is_plausible(departure, now):
            self.clock.record(departure, now)

    def authenticate(self, data: bytes) -> Opened | None:
        """Whether a datagram, of the right length, is of this session; changes nothing."""
        sequence = expand_counter(sequence_of(data), SEQUENCE_BITS, self._replay.newest + 1)
        body = self._protection.open(sequence, data)
        return None if body is None else Opened(sequence, data[0], body)

    def is_newest(self, opened: Opened) -> bool:
        """Whether no datagram sent after this one has been accepted."""
        return opened.sequence > self._replay.newest

    def accept(self, opened: Opened, now: float) -> Outcome:
        """Take an authentic datagram."""
        sequence, first, body = opened
        if not self._replay.is_new(sequence):
            return DropReason.REPLAYED
        self._replay.mark(sequence)
        self._statistics.lost += self._loss.record(sequence)
        self.sender.is_confirmed = True
        head = read_head(first, body)
        departure = self.clock.departure(head.sent, now)
        if not self.clock.is_plausible(departure, now):
            return DropReason.IMPLAUSIBLE
        self.clock.record(departure, now)
        body = self._take_acks(head, body, departure)
        if head.kind == _BYE:
            return PeerClosed(unpack_bye(body))
        if head.kind == _HEARTBEAT and not self._take_report(sequence, unpack_report(body)):
            return DropReason.IMPLAUSIBLE
        outcome = self._deliver(sequence, head, departure, body, now)
        is_untrue = outcome is DropReason.IMPLAUSIBLE or outcome is DropReason.MALFORMED
        if (
            self._incoming.carries_credit and not is_untrue and head.kind != _CHANGE
        ):  # what is late is still true of a growing count
            self.credit.learn(sequence, *unpack_credit(head.kind, body))
        return outcome

    def _take_acks(self, head: Head, body: bytes, departure: float) -> bytes:
        """What the datagram acknowledges of each stream of ours; returns the rest of it."""
        self.sender.acknowledge(head.ack, departure)
        count = self._incoming.further_acks
        if not count or head.kind in (_BYE, _CHANGE):
            return body
        rest, acks = split_acks(body, count)
        for stream, ack in enumerate(acks, 1):
            self.sender.acknowledge(ack, departure, stream)
        return rest

    def _deliver(self, sequence: int, head: Head, departure: float, body: bytes, now: float) -> Outcome:
        age = self.clock.age(departure, now)
        if age is not None and age > self._parameters.silence:
            return DropReason.STALE
        self.heard_at = now
        self.sender.heartbeats.heard(now)
        if head.kind == _HEARTBEAT:
            if head.asks:
                self.sender.heartbeats.asked()
            return None
        if age is None:
            return DropReason.UNTIMED
        if head.kind == _CHANGE:
            return self._deliver_change(head, departure, body)
        if sequence < self.sender.delivered[stream_of(head.kind)]:
            return DropReason.SUPERSEDED
        return self._deliver_update(sequence, head, departure, body, age)

    def _deliver_update(
        self, sequence: int, head: Head, departure: float, body: bytes, age: float
    ) -> UpdateReceived | DropReason:
        stream = stream_of(head.kind)
        newest, gap, previous = self._incoming.updates[stream].unpack(body, head.has_previous)
        if head.has_previous and not gap:
            return DropReason.MALFORMED
        sent_tick = departure / self._parameters.tick_period
        tick = expand_counter(head.tick, TICK_BITS, int(sent_tick))
        if (tick - sent_tick) * self._parameters.tick_period > TICK_LEAD:
            return DropReason.IMPLAUSIBLE
        self.sender.delivered[stream] = sequence
        return UpdateReceived(tick, head.selector, newest, gap, previous, age, stream)

    def _deliver_change(
        self, head: Head, departure: float, body: bytes
    ) -> ChangeProposed | ChangeAnswered | DropReason | None:
        accord, content = self.sender.accord, unpack_change(body)
        if head.has_previous:
            return accord.heard_answer(head.selector, content)
        sent_tick = departure / self._parameters.tick_period
        tick = expand_counter(head.tick, TICK_BITS, int(sent_tick))
        if abs(tick - sent_tick) * self._parameters.tick_period > CHANGE_LEAD:
            return DropReason.IMPLAUSIBLE
        return accord.heard_proposal(head.selector, tick, content)

    def _take_report(self, sequence: int, report: Report) -> bool:
        if sequence < self._newest_report:
            return True
        if not self.clock.learn(report.minimum_us * 1e-6, report.latest_us * 1e-6, report.late_us * 1e-6):
            return False
        self._newest_report = sequence
        loss = report.loss_65535 / 65_535
        self._statistics.outgoing_loss = loss
        rtt = self.clock.rtt
        self.sender.heartbeats.adapt(loss, self._loss.fraction, inf if rtt is None else rtt, self.clock.jitter)
        return True

    def measure(self) -> None:
        """Write the present measurements into the statistics."""
        self._statistics.rtt = self.clock.rtt
        self._statistics.one_way = self.clock.one_way
        self._statistics.incoming_loss = self._loss.fraction
