"""The sending half of a session: make its datagrams, and decide when the next one is due."""

from math import inf
from typing import Final, NamedTuple

from weberlink.protocol.counters import ACKNOWLEDGEMENT_MASK, SEQUENCE_MASK, Credit, LossMeter, int16
from weberlink.protocol.heartbeat import HeartbeatSchedule
from weberlink.protocol.liveness import Liveness
from weberlink.protocol.mailbox import Statistics
from weberlink.protocol.negotiation import ParameterNegotiation
from weberlink.protocol.retransmission import Allowance, OutgoingStream, copies_needed
from weberlink.protocol.round_trip import RoundTripAgreement, in_ms
from weberlink.protocol.security import Protection
from weberlink.protocol.timing import Clock
from weberlink.protocol.wire import (
    BURST_UNITS,
    CHANGE_TICK_BITS,
    LOSS_UNITS,
    LOST_MASK,
    PHASE,
    TICK_BITS,
    DirectionLayout,
    Envelope,
    Report,
    pack_bye,
    pack_change,
    pack_heartbeat,
    pack_path,
)
from weberlink.update import Update

SLACK: Final = 0.001
"""Added to the measured bound on delays, because both ends work in ticks [s]."""
UNMEASURED_RTT: Final = 0.2
"""Assumed round trip until it is measured [s]."""
LOSS_STEP: Final = 0.02
"""Change of the measured loss that is reported with the next heartbeat."""
REKEY_AFTER_S: Final = 120.0
REKEY_AFTER: Final = 1 << 20
"""For how long, and for how many datagrams, one key seals what an end sends; far below the limit of AES-CCM (RFC 9147,
section 4.5.3)."""
_CHANGE_TICK_MASK: Final = (1 << CHANGE_TICK_BITS) - 1
_TICK_MASK: Final = (1 << TICK_BITS) - 1
_PHASED = tuple(bytes((first | PHASE,)) for first in range(256))
"""By first byte, that of the other key phase."""


class Parameters(NamedTuple):
    """Parameters that all sessions of an endpoint share.

    Args:
        outgoing, incoming: layouts of each direction.
        epoch: when our clock was at 0 [s].
        tick_period: of both ends [s].
        silence: time without a fresh datagram after which the peer counts as gone [s].
        longest_round_trip: largest one that this end allows [s].
        opens: whether this end begins the sessions, as the initiator does.
        rekey_after: datagrams after which the key of a direction is replaced, if it was not by time.
    """

    outgoing: DirectionLayout
    incoming: DirectionLayout
    epoch: float
    tick_period: float
    silence: float
    longest_round_trip: float
    opens: bool
    rekey_after: int = REKEY_AFTER

    def tick_at(self, departure: float) -> int:
        """The tick of an end nearest to a time on its clock [s], which the other end computes alike."""
        return round(departure / self.tick_period)


class Acknowledgement:
    """The acknowledgement of one stream of the peer, told until the peer is known to have heard it.

    Attributes:
        number: of the newest update received; 0 for none.
    """

    __slots__ = ("_heard_from", "number")

    def __init__(self) -> None:
        self.number = 0
        self._heard_from = -inf

    def change(self, number: int, heard_from: float) -> None:
        """Acknowledge another update, or with 0 none; `heard_from` is the `confirmed_at` that shows it was heard."""
        self.number, self._heard_from = number, heard_from

    def told(self, confirmed_at: float) -> int | None:
        """What the next datagram tells, truncated; None if the peer has heard it."""
        return None if confirmed_at >= self._heard_from else self.number & ACKNOWLEDGEMENT_MASK


class Sender:
    """Makes the datagrams of one end in one session.

    Attributes:
        heartbeats: when one is due.
        negotiation: of the changes that the owners of both ends make.
        round_trip: the agreement of both ends on it.
        acknowledgements: by stream of the peer.
        is_confirmed: whether the peer was heard under the keys of this session.
        said_encoding: whether our newest datagram said that our encoder runs.
    """

    def __init__(
        self,
        protection: Protection,
        parameters: Parameters,
        statistics: Statistics,
        *,
        clock: Clock,
        credit: Credit,
        loss: LossMeter,
        liveness: Liveness,
        longest_round_trip: float,
        first_sequence: int,
        now: float,
    ) -> None:
        """Begin; the receiving half updates clock, credit, loss and liveness, which this half reports to the peer.

        Args:
            longest_round_trip: largest one that both ends allow [s].
            first_sequence: number of the first datagram, 1 to 2^15.
            now: [s].
        """
        self._protection = protection
        self._outgoing = parameters.outgoing
        self._allowance = Allowance()
        self._lost = 0
        self._streams = tuple(OutgoingStream(layout, self._allowance) for layout in parameters.outgoing.updates)
        self._statistics = statistics
        self._clock = clock
        self._credit = credit
        self._loss = loss
        self._liveness = liveness
        self._parameters = parameters
        _, self._departed = clock.stamp(now)
        self._next_sequence = first_sequence
        self._phase = 0
        self._rekey_at = now + REKEY_AFTER_S
        self._rekey_from = first_sequence + parameters.rekey_after
        self.heartbeats = HeartbeatSchedule(now, silence=parameters.silence, tick_period=parameters.tick_period)
        self.negotiation = ParameterNegotiation()
        self.round_trip = RoundTripAgreement(
            liveness, longest_round_trip, parameters.tick_period, proposes=parameters.opens
        )
        self.acknowledgements = tuple(Acknowledgement() for _ in range(parameters.outgoing.acks))
        self.is_confirmed = False
        self.said_encoding = False
        self._reported = (0.0, 0.0, 0.0)

    def send_update(self, now: float, update: Update, stream: int = 0) -> bytes:
        """The datagram of a new update, which replaces any older one of its stream.

        Raises:
            ValueError: naming the field that cannot be sent; nothing has changed then.
        """
        if update.tick < 0:
            raise ValueError(f"tick must not be negative, not {update.tick}")
        own = self._streams[stream]
        own.layout.check(update)
        own.is_forgotten = False
        own.update = update
        sequence, datagram = self._seal_update(own, update, now)
        statistics = self._statistics
        own.retransmission.begin(sequence, now, copies_needed(statistics.outgoing_loss, statistics.outgoing_burst))
        self.said_encoding = True
        statistics.updates_sent[stream] += 1
        return datagram

    def _send_repeat(self, stream: OutgoingStream, now: float) -> bytes:
        """The newest update again, with a new number and time stamp."""
        assert stream.update is not None
        sequence, datagram = self._seal_update(stream, stream.update, now)
        stream.retransmission.repeated(sequence, now)
        self._statistics.repeats += 1
        return datagram

    def _seal_update(self, stream: OutgoingStream, update: Update, now: float) -> tuple[int, bytes]:
        while stream.is_ambiguous(self._next_sequence):
            self._next_sequence += 1
        envelope, sequence = self._envelope(now)
        lag = self._parameters.tick_at(self._departed) - update.tick
        clear = stream.layout.pack(envelope, int16(lag), update, self._credit.granted)
        return sequence, self._seal(sequence, clear, now)

    def send_heartbeat(self, now: float, *, is_encoding: bool = False) -> bytes:
        """The datagram of a heartbeat, which may report our measurements and ask for an answer."""
        asks = self.heartbeats.asks(now)
        report = self._report() if self.heartbeats.reports(now) or self._has_changed() else None
        envelope, sequence = self._envelope(now)
        self.heartbeats.pulsed(now, has_reported=report is not None, is_confirmed=self.is_confirmed)
        self._statistics.heartbeats += 1
        self.said_encoding = is_encoding
        clear = pack_heartbeat(
            envelope,
            sum(stream.update.tick for stream in self._streams if stream.update is not None) & _TICK_MASK,
            report,
            self._credit.granted if self._outgoing.carries_credit else None,
            round_trip_ms=None if self.is_confirmed or not self._parameters.opens else in_ms(self._liveness.round_trip),
            asks=asks,
            is_encoding=is_encoding,
        )
        return self._seal(sequence, clear, now)

    def _report(self) -> Report:
        minimum, latest, late = self._clock.report()
        self._reported = minimum, late, self._loss.fraction
        self._statistics.incoming_burst = self._loss.burst
        return Report(
            round(minimum * 1e6),
            round(latest * 1e6),
            round(late * 1e6),
            round(min(self._loss.fraction, 1.0) * LOSS_UNITS),
            round(self._statistics.incoming_burst * BURST_UNITS),
            self._loss.lost & LOST_MASK,
        )

    def _has_changed(self) -> bool:
        """Whether the link is another one than the newest report says, so that the next heartbeat reports again."""
        minimum, _, late = self._clock.report()
        least, bound, loss = self._reported
        return (
            abs(minimum - least) > SLACK
            or abs(late - bound) > max(SLACK, 0.5 * bound)
            or abs(self._loss.fraction - loss) > LOSS_STEP
        )

    def send_bye(self, now: float, reason: str) -> bytes:
        """The datagram of a farewell; `reason` is cut to `LONGEST_REASON` bytes."""
        envelope, sequence = self._envelope(now)
        return self._seal(sequence, pack_bye(envelope, reason), now)

    def send_path(self, now: float, token: bytes, *, is_answer: bool) -> bytes:
        """Ask whether the peer is at the address that this is sent to, or answer such a question."""
        envelope, sequence = self._envelope(now)
        return self._seal(sequence, pack_path(envelope, token, is_answer=is_answer), now)

    def send_change(self, now: float) -> bytes:
        """The datagram of the message of a negotiation that is due."""
        rtt = self._clock.rtt
        negotiation = self.negotiation if now >= self.negotiation.due else self.round_trip.negotiation
        change = negotiation.take(now, UNMEASURED_RTT if rtt is None else rtt + self._clock.jitter)
        envelope, sequence = self._envelope(now)
        clear = pack_change(
            envelope,
            change.tick & _CHANGE_TICK_MASK,
            change.number,
            change.body,
            is_answer=change.is_answer,
        )
        return self._seal(sequence, clear, now)

    def adapt(self, lost: int, now: float) -> None:
        """Follow the present measurements of the link; the peer has reported that so many were lost, low bits."""
        clock = self._clock
        self._allowance.adapt(int16(lost - self._lost), self._next_sequence, clock.late, now)
        self._lost = lost
        if clock.bound is not None:
            self.round_trip.follow(clock.bound, now - self._parameters.epoch, now)
        self.pace()

    def pace(self) -> None:
        """Send heartbeats as the present measurements and the agreed round trip need them."""
        clock = self._clock
        self.heartbeats.adapt(
            self._statistics.outgoing_loss,
            self._loss.fraction,
            inf if clock.rtt is None else clock.rtt,
            clock.jitter,
            self._liveness.round_trip,
        )

    def _envelope(self, now: float) -> tuple[Envelope, int]:
        """Envelope of the next datagram, which leaves now, and its number in full."""
        sequence = self._next_sequence
        self._next_sequence = sequence + 1
        liveness, clock = self._liveness, self._clock
        confirmed_at = liveness.confirmed_at
        acks = tuple([each.told(confirmed_at) for each in self.acknowledgements])
        stamp, self._departed = clock.stamp(now)
        self.heartbeats.sent(now, liveness.heard_at, self._credit.granted)
        return (sequence & SEQUENCE_MASK, liveness.generation, stamp, liveness.echo(now), acks), sequence

    def acknowledge_update(self, stream: int, number: int) -> None:
        """Acknowledge an update of the peer from now on; with 0, that this end holds none."""
        self.acknowledgements[stream].change(number, self._liveness.confirmed_after(self._departed))

    def _seal(self, sequence: int, clear: bytes, now: float) -> bytes:
        """The datagram under the present key, which is replaced by time and by count (RFC 9001, section 6)."""
        if now >= self._rekey_at or sequence >= self._rekey_from:
            self._protection.rekey_outgoing()
            self._phase ^= PHASE
            self._rekey_at, self._rekey_from = now + REKEY_AFTER_S, sequence + self._parameters.rekey_after
        if self._phase:
            clear = _PHASED[clear[0]] + clear[1:]
        return self._protection.seal(sequence, clear)

    def next_timer(self, *, is_engaged: bool, is_encoding: bool) -> float:
        """Time of the next datagram [s]."""
        due = self.heartbeats.due(is_engaged=is_engaged)
        if not is_engaged:
            return due
        if is_encoding:
            for stream in self._streams:
                due = min(due, -inf if stream.is_forgotten else self._repeat_due(stream))
        return min(due, self._change_due(), self.round_trip.switch_at)

    def _change_due(self) -> float:
        return min(self.negotiation.due, self.round_trip.negotiation.due)

    def handle_timer(self, now: float, *, is_engaged: bool, is_encoding: bool) -> bytes | None:
        """The next datagram that is due, if any; a silent peer is sent heartbeats only."""
        if self.round_trip.advance(now):
            self.pace()
        if is_engaged:
            for stream in self._streams if is_encoding else ():
                if now >= self._repeat_due(stream):
                    return self._send_repeat(stream, now)
            if now >= self._change_due():
                return self.send_change(now)
        if now < self.heartbeats.due(is_engaged=is_engaged):
            return None
        return self.send_heartbeat(now, is_encoding=is_engaged and is_encoding)

    def take_lost(self, now: float) -> list[int]:
        """Streams of which the peer needs a new state; their newest update is repeated no more.

        The peer has forgotten it, or it has not arrived and is older than what the peer executes.
        """
        lost = []
        for number, stream in enumerate(self._streams):
            if stream.is_forgotten or stream.retransmission.is_late(now, self._liveness.limit):
                stream.is_forgotten = False
                stream.retransmission.abandon()
                lost.append(number)
        return lost

    def _repeat_due(self, stream: OutgoingStream) -> float:
        retransmission = stream.retransmission
        if not retransmission.is_pending:
            return inf
        rtt = self._clock.rtt
        if rtt is None:
            return retransmission.due_at(0.0, UNMEASURED_RTT)
        return retransmission.due_at(rtt, rtt + self._clock.late + SLACK + self.heartbeats.gap)

    def acknowledged(
        self, sequence: int, ack: int | None, departure: float, stream: int = 0, *, is_newest: bool = True
    ) -> None:
        """Take the acknowledgement of a stream in the datagram of this number, which left the peer then [s, its clock].

        None if it has none.
        """
        own = self._streams[stream]
        if own.acknowledge(sequence, ack, is_newest=is_newest):
            return
        arrived = self._clock.arrival_bound(own.retransmission.sent_at)
        if arrived is not None and departure > arrived + SLACK:
            own.retransmission.miss()
