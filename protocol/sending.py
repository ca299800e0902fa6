"""The sending half of a session: make its datagrams, and decide when the next one is due."""

from math import inf
from typing import NamedTuple

from weberlink.protocol.counters import ACKNOWLEDGEMENT_MASK, SEQUENCE_MASK, Credit, LossMeter
from weberlink.protocol.heartbeat import HeartbeatSchedule
from weberlink.protocol.liveness import Liveness
from weberlink.protocol.mailbox import Statistics
from weberlink.protocol.negotiation import ParameterNegotiation
from weberlink.protocol.retransmission import OutgoingStream, copies_needed
from weberlink.protocol.security import Protection
from weberlink.protocol.timing import Clock
from weberlink.protocol.wire import (
    CHANGE_TICK_BITS,
    PHASE,
    TICK_MASK,
    DirectionLayout,
    Report,
    pack_bye,
    pack_change,
    pack_heartbeat,
    pack_path,
    pack_word,
)
from weberlink.update import Update

SLACK = 0.001
"""Added to the measured bound on delays, because both ends work in ticks [s]."""
UNMEASURED_RTT = 0.2
"""Assumed round trip until it is measured [s]."""
REKEY_AFTER_S = 120.0
REKEY_AFTER = 1 << 20
"""For how long, and for how many datagrams, one key seals what an end sends; far below the limit of AES-CCM (RFC 9147,
section 4.5.3)."""
_CHANGE_TICK_MASK = (1 << CHANGE_TICK_BITS) - 1


class Parameters(NamedTuple):
    """Parameters that all sessions of an endpoint share.

    Args:
        outgoing, incoming: layouts of each direction.
        epoch: when our clock was at 0 [s].
        tick_period: of both ends [s].
        silence: age beyond which nothing is executed, and loop age beyond which the peer counts as gone [s].
    """

    outgoing: DirectionLayout
    incoming: DirectionLayout
    epoch: float
    tick_period: float
    silence: float


class Sender:
    """Makes the datagrams of one end in one session.

    Attributes:
        heartbeats: when one is due.
        negotiation: of the changes that both ends make.
        delivered: by stream of the peer, number of the newest update received, which every datagram acknowledges.
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
        first_sequence: int,
        now: float,
    ) -> None:
        """Begin; the receiving half updates clock, credit, loss and liveness, which this half reports to the peer.

        Args:
            first_sequence: number of the first datagram, 1 to 2^23.
            now: [s].
        """
        self._protection = protection
        self._outgoing = parameters.outgoing
        self._streams = tuple(OutgoingStream(layout) for layout in parameters.outgoing.updates)
        self._statistics = statistics
        self._clock = clock
        self._credit = credit
        self._loss = loss
        self._liveness = liveness
        self._silence = parameters.silence
        self._next_sequence = first_sequence
        self._phase = 0
        self._rekey_at = now + REKEY_AFTER_S
        self._rekey_from = first_sequence + REKEY_AFTER
        self.heartbeats = HeartbeatSchedule(now, silence=parameters.silence, tick_period=parameters.tick_period)
        self.negotiation = ParameterNegotiation()
        self.delivered = [0] * (1 + parameters.outgoing.further_acks)
        self.is_confirmed = False
        self.said_encoding = False

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
        own.retransmission.begin(sequence, now, copies_needed(self._statistics.outgoing_loss))
        self.said_encoding = True
        self._statistics.updates_sent[stream] += 1
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
        sequence = self._number(now)
        clear = stream.layout.pack(
            sequence & SEQUENCE_MASK,
            self._word(now, update.tick),
            update,
            self._credit.granted,
            self._further_acks(),
        )
        return sequence, self._seal(sequence, clear, now)

    def send_heartbeat(self, now: float, *, is_encoding: bool = False) -> bytes:
        """The datagram of a heartbeat, which reports our measurements and may ask for an answer."""
        minimum, latest, late = self._clock.report()
        report = Report(
            round(minimum * 1e6), round(latest * 1e6), round(late * 1e6), round(min(self._loss.fraction, 1.0) * 65_535)
        )
        sequence = self._number(now)
        asks = self.heartbeats.asks(now)
        self.heartbeats.reported(now, is_confirmed=self.is_confirmed)
        self._statistics.heartbeats += 1
        self.said_encoding = is_encoding
        clear = pack_heartbeat(
            sequence & SEQUENCE_MASK,
            self._word(now, sum(stream.update.tick for stream in self._streams if stream.update is not None)),
            report,
            self._credit.granted if self._outgoing.carries_credit else None,
            further_acks=self._further_acks(),
            asks=asks,
            is_encoding=is_encoding,
        )
        return self._seal(sequence, clear, now)

    def send_bye(self, now: float, reason: str) -> bytes:
        """The datagram of a farewell; `reason` is cut to `LONGEST_REASON` bytes."""
        sequence = self._number(now)
        return self._seal(sequence, pack_bye(sequence & SEQUENCE_MASK, self._word(now), reason), now)

    def send_path(self, now: float, token: bytes, *, is_answer: bool) -> bytes:
        """Ask whether the peer is at the address that this is sent to, or answer such a question."""
        sequence = self._number(now)
        clear = pack_path(sequence & SEQUENCE_MASK, self._word(now), token, is_answer=is_answer)
        return self._seal(sequence, clear, now)

    def send_change(self, now: float) -> bytes:
        """The datagram of the message of `negotiation` that is due."""
        rtt = self._clock.rtt
        change = self.negotiation.take(now, UNMEASURED_RTT if rtt is None else rtt + self._clock.jitter)
        sequence = self._number(now)
        clear = pack_change(
            sequence & SEQUENCE_MASK,
            self._word(now),
            change.tick & _CHANGE_TICK_MASK,
            change.number,
            change.body,
            is_answer=change.is_answer,
        )
        return self._seal(sequence, clear, now)

    def _number(self, now: float) -> int:
        sequence = self._next_sequence
        self._next_sequence = sequence + 1
        self.heartbeats.sent(now)
        return sequence

    def _word(self, now: float, tick: int = 0) -> int:
        ack = self.delivered[0] & ACKNOWLEDGEMENT_MASK
        return pack_word(ack, self._clock.stamp(now), self._liveness.echo(now), tick & TICK_MASK)

    def _further_acks(self) -> tuple[int, ...]:
        if not self._outgoing.further_acks:
            return ()
        return tuple([number & ACKNOWLEDGEMENT_MASK for number in self.delivered[1:]])

    def _seal(self, sequence: int, clear: bytes, now: float) -> bytes:
        """The datagram under the present key, which is replaced by time and by count (RFC 9001, section 6)."""
        if now >= self._rekey_at or sequence >= self._rekey_from:
            self._protection.rekey_outgoing()
            self._phase ^= PHASE
            self._rekey_at, self._rekey_from = now + REKEY_AFTER_S, sequence + REKEY_AFTER
        if self._phase:
            clear = bytes((clear[0] | self._phase,)) + clear[1:]
        return self._protection.seal(sequence, clear)

    def next_timer(self, *, is_engaged: bool, is_encoding: bool) -> float:
        """Time of the next datagram [s]."""
        due = self.heartbeats.due(is_engaged=is_engaged)
        if not is_engaged:
            return due
        if is_encoding:
            for stream in self._streams:
                due = min(due, -inf if stream.is_forgotten else self._repeat_due(stream))
        return min(due, self.negotiation.due)

    def handle_timer(self, now: float, *, is_engaged: bool, is_encoding: bool) -> bytes | None:
        """The next datagram that is due, if any; a silent peer is sent heartbeats only."""
        if is_engaged:
            for stream in self._streams if is_encoding else ():
                if now >= self._repeat_due(stream):
                    return self._send_repeat(stream, now)
            if now >= self.negotiation.due:
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
            if stream.is_forgotten or stream.retransmission.is_late(now, self._silence):
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
        return retransmission.due_at(rtt, rtt + self._clock.late + SLACK + 1.5 * self.heartbeats.interval)

    def acknowledge(self, ack: int, departure: float, stream: int = 0, *, is_newest: bool = True) -> None:
        """Take the acknowledgement of a stream in a datagram that left the peer then [s, its clock]."""
        own = self._streams[stream]
        if own.acknowledge(ack, is_newest=is_newest):
            return
        arrived = self._clock.arrival_bound(own.retransmission.sent_at)
        if arrived is not None and departure > arrived + SLACK:
            own.retransmission.miss()
