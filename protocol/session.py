"""The receiving half of a session: check its datagrams, and read what they say.

The sending half is `Session.sender` (`weberlink.protocol.sending`).
"""

from math import inf
from typing import Final

from weberlink.protocol.bits import MalformedError
from weberlink.protocol.counters import SEQUENCE_BITS, Credit, LossMeter, ReplayWindow, expand_counter
from weberlink.protocol.events import (
    ChangeAnswered,
    ChangeProposed,
    DropReason,
    PathAnswered,
    PathAsked,
    PeerClosed,
    UpdateReceived,
)
from weberlink.protocol.liveness import Liveness
from weberlink.protocol.mailbox import Statistics
from weberlink.protocol.negotiation import NUMBERS
from weberlink.protocol.security import Protection
from weberlink.protocol.sending import Parameters, Sender
from weberlink.protocol.timing import Clock
from weberlink.protocol.wire import (
    BURST_UNITS,
    CHANGE_TICK_BITS,
    HEARTBEAT_CREDIT_BITS,
    LOSS_UNITS,
    PHASE,
    TICK_BITS,
    UPDATE_CREDIT_BITS,
    ByeContent,
    ChangeContent,
    Content,
    Head,
    HeartbeatContent,
    PathContent,
    Report,
    UpdateContent,
    sequence_of,
    stream_of,
)
from weberlink.update import Update

TICK_LEAD: Final = 1.0
"""How far a sample tick may lie after the datagram that carries it [s]; the owner's tick grid need not be exact."""
CHANGE_LEAD: Final = 30.0
"""How far ahead of its datagram a proposed change may lie [s]."""
TICK_AGE_SLACK: Final = 0.01
"""How much older than the largest loop age a sample may be when its datagram leaves [s]: the owner's ticks may be late.
"""
EXPIRY: Final = 3.0
"""How long a session may be silent without a break [s]. Time stamps wrap after 84 s."""
_TICK_MASK: Final = (1 << TICK_BITS) - 1
LONGEST_SILENCE: Final = 10.0
"""Largest silence limit [s]; with the longest round trip and `EXPIRY` far below half of the range of a time stamp."""
OwnersOutcome = UpdateReceived | PeerClosed | ChangeProposed | ChangeAnswered
Outcome = OwnersOutcome | PathAsked | PathAnswered | DropReason | None
"""The content of an authentic datagram, or the reason to drop it; None if only the session needs it."""


Opened = tuple[int, int, bytes]
"""An authentic datagram: full sequence number, first byte, and the rest after the clear part."""
_OF_THE_OWNER = (UpdateContent, ChangeContent)


class Session:
    """One session from the keys on.

    Attributes:
        clock: mapping to the peer's clock.
        credit: granted by each end to the other, where the session carries it.
        liveness: whether each end hears the other.
        silent_since: when the present silence began [s]; inf without one.
        is_fresh: whether the datagram accepted last was fresh (`Liveness.is_fresh`).
        is_newest: whether no datagram sent after that one was accepted before it.
        sender: makes our datagrams.
    """

    def __init__(
        self,
        protection: Protection,
        parameters: Parameters,
        statistics: Statistics,
        peer_clock: float,
        now: float,
        *,
        longest_round_trip: float,
        confirmed_at: float = -inf,
        first_sequence: int = 1,
    ) -> None:
        """Begin a session.

        Args:
            longest_round_trip: largest one that both ends allow [s].
            statistics: counted into.
            peer_clock: departure of the peer's handshake datagram on its clock [s].
            now: arrival of that datagram [s].
            confirmed_at: departure of our handshake datagram that it answers [s]; -inf if it answers none.
            first_sequence: number of our first datagram, 1 to 2^15.
        """
        self._protection = protection
        self._parameters = parameters
        self._incoming = parameters.incoming
        self._silence, self._tick_period = parameters.silence, parameters.tick_period
        self._statistics = statistics
        self.clock = Clock(parameters.epoch, peer_clock, now)
        self.credit = Credit()
        self.liveness = Liveness(parameters.epoch, parameters.silence, peer_clock, now, confirmed_at)
        self.silent_since = inf
        self.is_fresh = False
        self.is_newest = False
        self._replay = ReplayWindow()
        self._loss = LossMeter()
        self._incoming_phase = 0
        self._held_ticks = [0] * len(parameters.incoming.updates)
        self._newest_report = -1
        self._floor = self._mark = -1
        self._marked_at = now
        self.sender = Sender(
            protection,
            parameters,
            statistics,
            clock=self.clock,
            credit=self.credit,
            loss=self._loss,
            liveness=self.liveness,
            longest_round_trip=longest_round_trip,
            first_sequence=first_sequence,
            now=now,
        )

    @property
    def silent_at(self) -> float:
        """Time at which one of the two limits is passed [s]."""
        return self.liveness.silent_at

    @property
    def expires_at(self) -> float:
        """Time at which the session expires [s].

        It counts from the beginning of the silence. One loop age may stay above the limit and the other one below it:
        then both ends hear each other, and only the end of the session lets them measure anew.
        """
        return min(self.silent_since, self.silent_at) + EXPIRY

    def request_full_state(self) -> None:
        """Acknowledge no update any more, so that the peer sends its full state."""
        for stream in range(len(self._held_ticks)):
            self.sender.acknowledge_update(stream, 0)
        self._held_ticks = [0] * len(self._held_ticks)

    def measure(self) -> None:
        """Write the present measurements into the statistics."""
        statistics, clock = self._statistics, self.clock
        statistics.rtt = clock.rtt
        statistics.one_way = clock.one_way
        statistics.incoming_loss = self._loss.fraction

    def authenticate(self, data: bytes) -> Opened | None:
        """Open a datagram of the right length; None if it is not of this session. Changes nothing."""
        newest = self._replay.newest
        sequence = expand_counter(sequence_of(data), SEQUENCE_BITS, newest + 1)
        if data[0] & PHASE == self._incoming_phase:
            body = self._protection.open(sequence, data)
        elif sequence > newest:
            body = self._protection.open_next(sequence, data)
        else:
            body = self._protection.open_previous(sequence, data)
        return None if body is None else (sequence, data[0], body)

    def accept(self, opened: Opened, now: float) -> Outcome:
        """Take an authentic datagram."""
        sequence, first, body = opened
        self.is_fresh = False
        self.is_newest = sequence > self._replay.newest
        if not self._replay.is_new(sequence):
            return DropReason.REPLAYED
        if self.is_newest and first & PHASE != self._incoming_phase:
            self._protection.rekey_incoming()
            self._incoming_phase = first & PHASE
        self._raise_floor(now)
        self._replay.mark(sequence)
        self._statistics.lost += self._loss.record(sequence)
        self.sender.is_confirmed = True
        try:
            head, content = self._incoming.read(first, body)
        except MalformedError:
            return DropReason.MALFORMED
        return self._take(sequence, head, content, now)

    def _take(self, sequence: int, head: Head, content: Content, now: float) -> Outcome:
        clock = self.clock
        departure = clock.departure(head.sent, now)
        if not clock.is_plausible(departure, now):
            return DropReason.IMPLAUSIBLE
        if sequence <= self._floor:
            return DropReason.STALE
        clock.record(departure, now)
        if not self.liveness.is_agreed and not self._opens(content, now):
            return DropReason.UNTIMED
        for stream, ack in enumerate(head.acks):
            self.sender.acknowledged(sequence, ack, departure, stream, is_newest=self.is_newest)
        if isinstance(content, ByeContent):
            return PeerClosed(content.reason)
        if isinstance(content, HeartbeatContent) and not self._take_report(sequence, content.report, now):
            return DropReason.IMPLAUSIBLE
        outcome = self._deliver(sequence, head, content, departure, now)
        # A late credit is still true, because the count only grows.
        if self._incoming.carries_credit and outcome is not DropReason.IMPLAUSIBLE:
            self._take_credit(sequence, content)
        return outcome

    def _opens(self, content: Content, now: float) -> bool:
        """Whether a datagram opens the session of a responder: it tells a round trip that both ends allow."""
        if not isinstance(content, HeartbeatContent) or content.round_trip_ms is None:
            return False
        if not self.sender.round_trip.open(content.round_trip_ms, now):
            return False
        self.sender.pace()
        return True

    def _take_credit(self, sequence: int, content: Content) -> None:
        if isinstance(content, UpdateContent) and content.credit is not None:
            self.credit.learn(sequence, content.credit, UPDATE_CREDIT_BITS)
        elif isinstance(content, HeartbeatContent) and content.credit is not None:
            self.credit.learn(sequence, content.credit, HEARTBEAT_CREDIT_BITS)

    def _raise_floor(self, now: float) -> None:
        """Reject numbers up to one that was accepted at least one silence limit ago: they left before that.

        Time stamps and echoes wrap, so a datagram that was held back for minutes may look new; its number does not.
        """
        if now - self._marked_at >= self._silence:
            self._floor, self._mark, self._marked_at = self._mark, self._replay.newest, now

    def _take_report(self, sequence: int, report: Report | None, now: float) -> bool:
        """Read the peer's measurements, if a heartbeat has any; False if they cannot be true."""
        if report is None or sequence < self._newest_report:
            return True
        if not self.clock.learn(report.minimum_us * 1e-6, report.latest_us * 1e-6, report.late_us * 1e-6):
            return False
        self._newest_report = sequence
        statistics = self._statistics
        statistics.outgoing_loss = report.loss_65535 / LOSS_UNITS
        statistics.outgoing_burst = report.burst_256 / BURST_UNITS
        self.sender.adapt(report.lost, now)
        return True

    def _deliver(self, sequence: int, head: Head, content: Content, departure: float, now: float) -> Outcome:
        age = self.clock.age(departure, now)
        if not self.liveness.is_fresh(age, head.generation):
            return DropReason.STALE
        self.is_fresh = True
        is_current = self.liveness.hear(departure, head.echo, head.generation, now)
        if isinstance(content, HeartbeatContent) and (runs := self._encodes(head, content)) is not None:
            self.liveness.hear_encoder(sequence, now, runs=runs)
        self.sender.heartbeats.heard(now, self.liveness.confirmed_at)
        if not isinstance(content, _OF_THE_OWNER):
            if head.asks:
                self.sender.heartbeats.asked()
            if isinstance(content, PathContent):
                return PathAnswered(content.token) if head.mark else PathAsked(content.token)
            return None
        if age is None or not is_current:
            return DropReason.UNTIMED if age is None else DropReason.STALE
        if isinstance(content, ChangeContent):
            return self._deliver_change(head, content, departure, now)
        outcome = self._deliver_update(sequence, head, content, departure, age)
        if isinstance(outcome, UpdateReceived):
            self.liveness.hear_encoder(sequence, now, runs=True)
        return outcome

    def _encodes(self, head: Head, content: HeartbeatContent) -> bool | None:
        """Whether the peer's encoder runs and this end holds what it encodes; None if an update is missing.

        A heartbeat whose ticks are not those of the newest updates held here shows that an update is missing. It does
        not count: otherwise an attacker who drops only updates could keep an old one in use as long as heartbeats come.
        """
        if head.is_encoding and content.ticks != sum(self._held_ticks) & _TICK_MASK:
            return None
        return head.is_encoding

    def _deliver_update(
        self, sequence: int, head: Head, content: UpdateContent, departure: float, age: float
    ) -> UpdateReceived | DropReason:
        stream = stream_of(head.kind)
        if sequence < self.sender.acknowledgements[stream].number:
            return DropReason.SUPERSEDED
        tick_period = self._tick_period
        tick = round(departure / tick_period) - content.lag  # `Parameters.tick_at`
        lead = tick * tick_period - departure
        if lead > TICK_LEAD or tick < 0:
            return DropReason.IMPLAUSIBLE
        if -lead > self.liveness.limit + TICK_AGE_SLACK:
            return DropReason.STALE
        self.sender.acknowledge_update(stream, sequence)
        self._held_ticks[stream] = tick
        return UpdateReceived(Update(tick, head.selector, content.newest, content.payload), age, stream)

    def _deliver_change(
        self, head: Head, content: ChangeContent, departure: float, now: float
    ) -> ChangeProposed | ChangeAnswered | DropReason | None:
        number, tick_period = head.selector, self._tick_period
        negotiation, round_trip = self.sender.negotiation, self.sender.round_trip
        if head.mark:
            if number < NUMBERS:
                return negotiation.heard_answer(number, content.body)
            round_trip.take_answer(number, content.body, now)
            return None
        sent_tick = departure / tick_period
        tick = expand_counter(content.tick, CHANGE_TICK_BITS, int(sent_tick))
        if abs(tick - sent_tick) * tick_period > CHANGE_LEAD:
            return DropReason.IMPLAUSIBLE
        if number < NUMBERS:
            return negotiation.heard_proposal(number, tick, content.body)
        peer_time = self.clock.peer_time(now)
        if peer_time is not None:
            round_trip.take_proposal(number, tick, content.body, tick * tick_period - peer_time, now)
        return None
