"""The outgoing half of a session: makes its datagrams, and decides when the next one is due.

Owns sequence numbers, the newest update of each stream and its repetition. Knows no address, and of what comes in only
what the receiving half tells it: what was delivered, what was acknowledged, and what the link is like.
"""

from math import inf

from weberlink.protocol.credit import Credit
from weberlink.protocol.direction import Direction
from weberlink.protocol.heartbeat import HeartbeatSchedule
from weberlink.protocol.liveness import Liveness
from weberlink.protocol.loss import LossMeter, copies_needed
from weberlink.protocol.negotiation import ParameterNegotiation
from weberlink.protocol.security import Protection
from weberlink.protocol.sequence import ACKNOWLEDGEMENT_MASK, SEQUENCE_MASK
from weberlink.protocol.statistics import Statistics
from weberlink.protocol.stream import Stream
from weberlink.protocol.timing import Clock
from weberlink.protocol.wire import (
    CHANGE_TICK_BITS,
    PHASE,
    TICK_BITS,
    Report,
    pack_bye,
    pack_change,
    pack_heartbeat,
    pack_path,
    pack_word,
)
from weberlink.update import Update

SLACK = 0.001
"""On top of the measured bound on delays: the ends work in ticks [s]."""
UNMEASURED_RTT = 0.2
REKEY_AFTER_S = 120.0
REKEY_AFTER = 1 << 20
"""How long, and for how many datagrams, one key seals what an end sends; far below what AES-CCM stands (RFC 9147,
section 4.5.3)."""
_TICK_MASK = (1 << TICK_BITS) - 1
_CHANGE_TICK_MASK = (1 << CHANGE_TICK_BITS) - 1


class Sender:
    """What one end sends in one session.

    Attributes:
        heartbeats: when one is due.
        negotiation: the changes that this end proposes and answers.
        delivered: by stream of the peer, number of the newest update that came of it, which every datagram
            acknowledges.
        is_confirmed: whether the peer was heard under the keys of this session.
        said_encoding: whether our newest datagram said that our encoder runs.
    """

    __slots__ = (
        "_clock",
        "_credit",
        "_liveness",
        "_loss",
        "_next_sequence",
        "_outgoing",
        "_phase",
        "_protection",
        "_rekey_at",
        "_rekey_from",
        "_silence",
        "_statistics",
        "_streams",
        "delivered",
        "heartbeats",
        "is_confirmed",
        "negotiation",
        "said_encoding",
    )

    def __init__(
        self,
        protection: Protection,
        outgoing: Direction,
        statistics: Statistics,
        *,
        clock: Clock,
        credit: Credit,
        loss: LossMeter,
        liveness: Liveness,
        heartbeats: HeartbeatSchedule,
        first_sequence: int,
        silence: float,
        now: float,
    ) -> None:
        """Begin.

        Args:
            protection: seals what is sent.
            outgoing: layouts of our datagrams.
            statistics: counted into.
            clock: stamps what is sent; written by the receiving half.
            credit: what is handed to the peer.
            loss: of the peer's datagrams, to be reported to it; written by the receiving half.
            liveness: what to echo; written by the receiving half.
            heartbeats: not yet begun.
            first_sequence: number of the first datagram, 1 to 2^23.
            silence: age beyond which the peer executes nothing [s].
            now: [s].
        """
        self._protection = protection
        self._outgoing = outgoing
        self._streams = tuple(Stream(layout) for layout in outgoing.updates)
        self._statistics = statistics
        self._clock = clock
        self._credit = credit
        self._loss = loss
        self._liveness = liveness
        self._silence = silence
        self._phase = 0
        self._rekey_at = now + REKEY_AFTER_S
        self._rekey_from = first_sequence + REKEY_AFTER
        self.heartbeats = heartbeats
        self.negotiation = ParameterNegotiation()
        self._next_sequence = first_sequence
        self.delivered = [0] * (1 + outgoing.further_acks)
        self.is_confirmed = False
        self.said_encoding = False

    def send_update(self, now: float, update: Update, stream: int = 0) -> bytes:
        """The datagram of a new update, which replaces any older one of its stream as what the peer is to hold.

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
        own.repetition.begin(sequence, now, copies_needed(self._statistics.outgoing_loss))
        self.said_encoding = True
        self._statistics.updates_sent[stream] += 1
        return datagram

    def _send_repeat(self, stream: Stream, now: float) -> bytes:
        """The newest update again, with a new number and time stamp."""
        assert stream.update is not None
        sequence, datagram = self._seal_update(stream, stream.update, now)
        stream.repetition.repeated(sequence, now)
        self._statistics.repeats += 1
        return datagram

    def send_heartbeat(self, now: float, *, is_encoding: bool = False) -> bytes:
        minimum, latest, late = self._clock.report()
        report = Report(
            round(minimum * 1e6), round(latest * 1e6), round(late * 1e6), round(min(self._loss.fraction, 1.0) * 65_535)
        )
        sequence = self._number(now)
        asks = self.heartbeats.asks(now)
        self.heartbeats.reported(now, is_confirmed=self.is_confirmed)
        self._statistics.heartbeats += 1
        credit = self._credit.handed if self._outgoing.carries_credit else None
        self.said_encoding = is_encoding
        clear = pack_heartbeat(
            sequence & SEQUENCE_MASK,
            self._word(now, sum(stream.update.tick for stream in self._streams if stream.update is not None)),
            report,
            credit,
            further_acks=self._further_acks(),
            asks=asks,
            is_encoding=is_encoding,
        )
        return self._seal(sequence, clear, now)

    def send_bye(self, now: float, reason: str) -> bytes:
        sequence = self._number(now)
        return self._seal(sequence, pack_bye(sequence & SEQUENCE_MASK, self._word(now), reason), now)

    def send_path(self, now: float, token: bytes, *, is_answer: bool) -> bytes:
        """Ask whether the peer is where this goes, or answer that we are."""
        sequence = self._number(now)
        clear = pack_path(sequence & SEQUENCE_MASK, self._word(now), token, is_answer=is_answer)
        return self._seal(sequence, clear, now)

    def send_change(self, now: float) -> bytes:
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

    def _seal_update(self, stream: Stream, update: Update, now: float) -> tuple[int, bytes]:
        while stream.would_mistake(self._next_sequence):
            self._next_sequence += 1
        sequence = self._number(now)
        clear = stream.layout.pack(
            sequence & SEQUENCE_MASK,
            self._word(now, update.tick),
            update,
            self._credit.handed,
            self._further_acks(),
        )
        return sequence, self._seal(sequence, clear, now)

    def _seal(self, sequence: int, clear: bytes, now: float) -> bytes:
        """The datagram under the present key, which is replaced by time and by count (RFC 9001, section 6)."""
        if now >= self._rekey_at or sequence >= self._rekey_from:
            self._protection.rekey_outgoing()
            self._phase ^= PHASE
            self._rekey_at, self._rekey_from = now + REKEY_AFTER_S, sequence + REKEY_AFTER
        if self._phase:
            clear = bytes((clear[0] | self._phase,)) + clear[1:]
        return self._protection.seal(sequence, clear)

    def _word(self, now: float, tick: int = 0) -> int:
        return pack_word(self._ack(), self._clock.stamp(now), self._liveness.echo(now), tick & _TICK_MASK)

    def _number(self, now: float) -> int:
        sequence = self._next_sequence
        self._next_sequence = sequence + 1
        self.heartbeats.sent(now)
        return sequence

    def _ack(self) -> int:
        return self.delivered[0] & ACKNOWLEDGEMENT_MASK

    def _further_acks(self) -> tuple[int, ...]:
        if not self._outgoing.further_acks:
            return ()
        return tuple([number & ACKNOWLEDGEMENT_MASK for number in self.delivered[1:]])

    def next_timer(self, *, is_engaged: bool, is_encoding: bool) -> float:
        """When something is due [s]."""
        due = self.heartbeats.due(is_engaged=is_engaged)
        if not is_engaged:
            return due
        if is_encoding:
            for stream in self._streams:
                due = min(due, -inf if stream.is_forgotten else self._repeat_due(stream))
        return min(due, self.negotiation.due)

    def handle_timer(self, now: float, *, is_engaged: bool, is_encoding: bool) -> bytes | None:
        """The next datagram that is due, if any; a peer that has fallen silent gets nothing but heartbeats."""
        if is_engaged:
            for stream in self._streams if is_encoding else ():
                if now >= self._repeat_due(stream):
                    return self._send_repeat(stream, now)
            if now >= self.negotiation.due:
                return self.send_change(now)
        if now < self.heartbeats.due(is_engaged=is_engaged):
            return None
        return self.send_heartbeat(now, is_encoding=is_engaged and is_encoding)

    def give_up(self, now: float) -> list[int]:
        """Streams of which the peer needs a new state.

        It has forgotten the newest update, or that has not arrived and is older than the peer executes: then it is
        repeated no more.
        """
        lost = []
        for stream, own in enumerate(self._streams):
            if own.is_forgotten or own.repetition.is_late(now, self._silence):
                own.is_forgotten = False
                own.repetition.abandon()
                lost.append(stream)
        return lost

    def _repeat_due(self, stream: Stream) -> float:
        repetition = stream.repetition
        if not repetition.is_pending:
            return inf
        rtt = self._clock.rtt
        if rtt is None:
            return repetition.due_at(0.0, UNMEASURED_RTT)
        return repetition.due_at(rtt, rtt + self._clock.late + SLACK + 1.5 * self.heartbeats.interval)

    def acknowledge(self, ack: int, departure: float, stream: int = 0, *, is_newest: bool = True) -> None:
        """Take the acknowledgement of a stream in a datagram that left the peer then [s, its clock]."""
        own = self._streams[stream]
        if own.acknowledge(ack, is_newest=is_newest):
            return
        arrived = self._clock.arrival_bound(own.repetition.sent_at)
        if arrived is not None and departure > arrived + SLACK:
            own.repetition.miss()
