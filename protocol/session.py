"""One session, from the keys on: reads its datagrams, and holds what makes them (`weberlink.protocol.sending`).

Owns replay window, clock mapping, loss and credit of one pair of session keys. Knows no address, no handshake and no
state of the endpoint; what it carries are integers that it does not interpret.
"""

from math import inf
from typing import NamedTuple

from weberlink.protocol.credit import Credit
from weberlink.protocol.direction import Direction
from weberlink.protocol.events import (
    ChangeAnswered,
    ChangeProposed,
    PathAnswered,
    PathAsked,
    PeerClosed,
    UpdateReceived,
)
from weberlink.protocol.heartbeat import HeartbeatSchedule
from weberlink.protocol.liveness import Liveness
from weberlink.protocol.loss import LossMeter
from weberlink.protocol.reasons import DropReason
from weberlink.protocol.replay import ReplayWindow
from weberlink.protocol.security import Protection
from weberlink.protocol.sending import Sender
from weberlink.protocol.sequence import SEQUENCE_BITS, expand_counter
from weberlink.protocol.statistics import Statistics
from weberlink.protocol.timing import Clock
from weberlink.protocol.wire import (
    CHANGE_TICK_BITS,
    PHASE,
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
    unpack_path,
    unpack_report,
)

TICK_LEAD = 1.0
"""How far a sample tick may lie after the datagram that carries it [s]; the owner's tick grid need not be exact."""

CHANGE_LEAD = 30.0
"""How far ahead of its datagram a proposed change may lie [s]."""

TICK_AGE_SLACK = 0.01
"""How much older than the silence limit a sample may be when its datagram leaves [s]: the owner's ticks may be late."""

FADE_SHARE = 0.8
"""Share of the silence limit at which owners begin to fade force out, as loop age."""
HORIZON_SHARE = 0.6
"""Share of the silence limit for which a motion is extrapolated after the peer's encoder was last known to run."""
EXPIRY = 3.0
"""How long a session outlives the silence limit [s]. Time stamps wrap after 168 s."""
LONGEST_SILENCE = 10.0
"""Largest silence limit [s]; with `EXPIRY` far below half of what a time stamp counts."""
# Looking a member up costs more than comparing it.
_HEARTBEAT, _BYE, _CHANGE, _PATH = int(Kind.HEARTBEAT), int(Kind.BYE), int(Kind.CHANGE), int(Kind.PATH)
_WITHOUT_TAIL = (_BYE, _CHANGE, _PATH)
"""Kinds that carry neither credit nor acknowledgements of further streams."""
_TICK_MASK = (1 << TICK_BITS) - 1
_FOR_THE_ENDPOINT = (_HEARTBEAT, _PATH)


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


OwnersOutcome = UpdateReceived | PeerClosed | ChangeProposed | ChangeAnswered
Outcome = OwnersOutcome | PathAsked | PathAnswered | DropReason | None
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
        liveness: whether each end hears the other.
        is_fresh: whether the datagram accepted last was no older than the silence limit.
        sender: makes our datagrams.
    """

    __slots__ = (
        "_floor",
        "_held_ticks",
        "_incoming",
        "_incoming_phase",
        "_loss",
        "_mark",
        "_marked_at",
        "_newest_report",
        "_parameters",
        "_protection",
        "_replay",
        "_statistics",
        "clock",
        "credit",
        "is_fresh",
        "liveness",
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
        confirmed_at: float = -inf,
        first_sequence: int = 1,
    ) -> None:
        """Begin a session.

        Args:
            statistics: counted into.
            peer_clock: departure of the peer's handshake datagram on its clock [s].
            now: arrival of that datagram [s].
            confirmed_at: departure of our handshake datagram that it answers [s]; -inf if it answers none.
            first_sequence: number of our first datagram, 1 to 2^23.
        """
        self._protection = protection
        self._parameters = parameters
        self._incoming = parameters.incoming
        self._statistics = statistics
        self.clock = Clock(parameters.epoch, peer_clock, now)
        self.credit = Credit()
        self.is_fresh = False
        self.liveness = Liveness(parameters.epoch, parameters.silence, peer_clock, now, confirmed_at)
        self._replay = ReplayWindow()
        self._incoming_phase = 0
        self._held_ticks = [0] * len(parameters.incoming.updates)
        self._loss = LossMeter()
        self._newest_report = -1
        self._floor = self._mark = -1
        self._marked_at = now
        self.sender = Sender(
            protection,
            parameters.outgoing,
            statistics,
            clock=self.clock,
            credit=self.credit,
            loss=self._loss,
            liveness=self.liveness,
            heartbeats=HeartbeatSchedule(
                now,
                fade=FADE_SHARE * parameters.silence,
                silence=parameters.silence,
                tick_period=parameters.tick_period,
            ),
            first_sequence=first_sequence,
            silence=parameters.silence,
            now=now,
        )

    @property
    def silent_at(self) -> float:
        """When the loop age passes the limit [s]."""
        return self.liveness.confirmed_at + self._parameters.silence

    @property
    def expires_at(self) -> float:
        """When the session is over [s]."""
        return self.silent_at + EXPIRY

    def retime(self, departure: float, now: float) -> None:
        """Take a repeated handshake datagram as one more measurement of the clock."""
        if self.clock.is_plausible(departure, now):
            self.clock.record(departure, now)

    def request_full_state(self) -> None:
        """The peer's updates are held no more: acknowledge none, so that it sends complete ones."""
        self.sender.delivered = [0] * len(self.sender.delivered)
        self._held_ticks = [0] * len(self._held_ticks)

    def authenticate(self, data: bytes) -> Opened | None:
        """Whether a datagram, of the right length, is of this session; changes nothing."""
        sequence = expand_counter(sequence_of(data), SEQUENCE_BITS, self._replay.newest + 1)
        if data[0] & PHASE == self._incoming_phase:
            body = self._protection.open(sequence, data)
        elif sequence > self._replay.newest:
            body = self._protection.open_next(sequence, data)
        else:
            body = self._protection.open_previous(sequence, data)
        return None if body is None else Opened(sequence, data[0], body)

    def is_newest(self, opened: Opened) -> bool:
        """Whether no datagram sent after this one has been accepted."""
        return opened.sequence > self._replay.newest

    def accept(self, opened: Opened, now: float) -> Outcome:
        """Take an authentic datagram."""
        sequence, first, body = opened
        self.is_fresh = False
        if not self._replay.is_new(sequence):
            return DropReason.REPLAYED
        if sequence > self._replay.newest and first & PHASE != self._incoming_phase:
            self._protection.rekey_incoming()
            self._incoming_phase = first & PHASE
        self._raise_floor(now)
        is_newest = sequence > self._replay.newest
        self._replay.mark(sequence)
        self._statistics.lost += self._loss.record(sequence)
        self.sender.is_confirmed = True
        head = read_head(first, body)
        departure = self.clock.departure(head.sent, now)
        if not self.clock.is_plausible(departure, now):
            return DropReason.IMPLAUSIBLE
        if sequence <= self._floor:
            return DropReason.STALE
        self.clock.record(departure, now)
        body = self._take_acks(head, body, departure, is_newest=is_newest)
        if head.kind == _BYE:
            return PeerClosed(unpack_bye(body))
        if head.kind == _HEARTBEAT and not self._take_report(sequence, unpack_report(body)):
            return DropReason.IMPLAUSIBLE
        outcome = self._deliver(sequence, head, departure, body, now)
        is_untrue = outcome is DropReason.IMPLAUSIBLE or outcome is DropReason.MALFORMED
        if (
            self._incoming.carries_credit and not is_untrue and head.kind not in _WITHOUT_TAIL
        ):  # what is late is still true of a growing count
            self.credit.learn(sequence, *unpack_credit(head.kind, body))
        return outcome

    def _raise_floor(self, now: float) -> None:
        """Keep a number that was accepted at least one silence limit ago: what is numbered no higher left before that.

        Time stamps and echoes wrap, so one that was held back for minutes may look new; its number does not.
        """
        if now - self._marked_at >= self._parameters.silence:
            self._floor, self._mark, self._marked_at = self._mark, self._replay.newest, now

    def _take_acks(self, head: Head, body: bytes, departure: float, *, is_newest: bool) -> bytes:
        """What the datagram acknowledges of each stream of ours; returns the rest of it."""
        self.sender.acknowledge(head.ack, departure, is_newest=is_newest)
        count = self._incoming.further_acks
        if not count or head.kind in _WITHOUT_TAIL:
            return body
        rest, acks = split_acks(body, count)
        for stream, ack in enumerate(acks, 1):
            self.sender.acknowledge(ack, departure, stream, is_newest=is_newest)
        return rest

    def _deliver(self, sequence: int, head: Head, departure: float, body: bytes, now: float) -> Outcome:
        age = self.clock.age(departure, now)
        if age is not None and age > self._parameters.silence:
            return DropReason.STALE
        self.is_fresh = True
        self.liveness.hear(sequence, departure, head.echo, says_encoding=self._says_encoding(head), now=now)
        self.sender.heartbeats.confirmed(self.liveness.confirmed_at)
        if head.kind in _FOR_THE_ENDPOINT:
            return self._note(head, body)
        if age is None:
            return DropReason.UNTIMED
        if not self.liveness.is_current(head.echo, now):
            return DropReason.STALE
        return self._execute(sequence, head, departure, body, age)

    def _execute(self, sequence: int, head: Head, departure: float, body: bytes, age: float) -> Outcome:
        """Take what the owner acts on."""
        if head.kind == _CHANGE:
            return self._deliver_change(head, departure, body)
        if sequence < self.sender.delivered[stream_of(head.kind)]:
            return DropReason.SUPERSEDED
        return self._deliver_update(sequence, head, departure, body, age)

    def _says_encoding(self, head: Head) -> bool | None:
        """Whether the peer's encoder runs and this end holds what it encodes; None where the datagram does not say.

        A heartbeat whose ticks are not those of the newest updates held here tells of an update that is missing. It
        does not count, or who drops updates alone would have an old one followed for as long as heartbeats come.
        """
        if head.kind == _HEARTBEAT:
            if head.is_encoding and head.tick != sum(self._held_ticks) & _TICK_MASK:
                return None
            return head.is_encoding
        return True if head.is_encoding else None

    def _note(self, head: Head, body: bytes) -> PathAsked | PathAnswered | None:
        """Take what asks nothing of the owner."""
        if head.kind == _PATH:
            token = unpack_path(body)
            return PathAnswered(token) if head.has_previous else PathAsked(token)
        if head.asks:
            self.sender.heartbeats.asked()
        return None

    def _deliver_update(
        self, sequence: int, head: Head, departure: float, body: bytes, age: float
    ) -> UpdateReceived | DropReason:
        stream = stream_of(head.kind)
        sent_tick = departure / self._parameters.tick_period
        tick = expand_counter(head.tick, TICK_BITS, int(sent_tick))
        update = self._incoming.updates[stream].unpack(body, head, tick)
        if update is None:
            return DropReason.MALFORMED
        lead = (tick - sent_tick) * self._parameters.tick_period
        if lead > TICK_LEAD:
            return DropReason.IMPLAUSIBLE
        if -lead > self._parameters.silence + TICK_AGE_SLACK:
            return DropReason.STALE
        self.sender.delivered[stream] = sequence
        self._held_ticks[stream] = tick
        return UpdateReceived(update, age, stream)

    def _deliver_change(
        self, head: Head, departure: float, body: bytes
    ) -> ChangeProposed | ChangeAnswered | DropReason | None:
        negotiation, (low_tick, content) = self.sender.negotiation, unpack_change(body)
        if head.has_previous:
            return negotiation.heard_answer(head.selector, content)
        sent_tick = departure / self._parameters.tick_period
        tick = expand_counter(low_tick, CHANGE_TICK_BITS, int(sent_tick))
        if abs(tick - sent_tick) * self._parameters.tick_period > CHANGE_LEAD:
            return DropReason.IMPLAUSIBLE
        return negotiation.heard_proposal(head.selector, tick, content)

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
