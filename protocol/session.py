"""One session, from the keys on: makes and reads its datagrams, and decides when the next one is due.

Owns sequence numbers, replay window, clock mapping, loss, acknowledgement and credit of one pair of session keys. Knows
no address, no handshake and no state of the endpoint; what it carries are integers that it does not interpret.
"""

from math import inf
from typing import NamedTuple

from protocol.credit import Credit
from protocol.events import PeerClosed, UpdateReceived
from protocol.heartbeat import HeartbeatSchedule
from protocol.loss import CLEAN_INTERVAL, LossMeter
from protocol.reasons import DropReason
from protocol.repetition import Repetition
from protocol.replay import ReplayWindow
from protocol.security import Protection
from protocol.sequence import ACKNOWLEDGEMENT_MASK, SEQUENCE_BITS, SEQUENCE_MASK, expand_counter
from protocol.statistics import Statistics
from protocol.timing import Clock
from protocol.wire import (
    Head,
    Kind,
    Report,
    UpdateLayout,
    pack_bye,
    pack_heartbeat,
    read_head,
    sequence_of,
    unpack_bye,
    unpack_credit,
    unpack_report,
)

TICK_BITS = 24
_TICK_MASK = (1 << TICK_BITS) - 1
TICK_LEAD = 1.0
"""How far a sample tick may lie after the datagram that carries it [s]; the owner's tick grid need not be exact."""

ACKNOWLEDGE_WITHIN = 0.01
LOSSY = 0.001
"""Measured loss above which an update is acknowledged within `ACKNOWLEDGE_WITHIN` instead of at the next occasion."""
FADE_SHARE = 0.6
"""Share of the silence limit after which owners begin to fade force out and hold motion."""
SLACK = 0.001
"""On top of the measured bound on delays: the ends work in ticks [s]."""
UNMEASURED_RTT = 0.2
_HEARTBEAT, _BYE = int(Kind.HEARTBEAT), int(Kind.BYE)  # looking a member up costs more than comparing it


class Parameters(NamedTuple):
    """What all sessions of an endpoint have in common.

    Args:
        outgoing, incoming: layout of the updates of each direction.
        epoch: when our clock was at 0 [s].
        tick_period: of both ends [s].
        silence: age beyond which nothing is executed, and silence beyond which the peer counts as gone [s].
    """

    outgoing: UpdateLayout
    incoming: UpdateLayout
    epoch: float
    tick_period: float
    silence: float


class Opened(NamedTuple):
    """An authentic datagram: full sequence number, first byte, and the rest after the clear part."""

    sequence: int
    first: int
    body: bytes


class _Update(NamedTuple):
    tick: int
    selector: int
    newest: tuple[int, ...]
    gap: int
    previous: tuple[int, ...]


class Session:
    """Both directions of one session.

    Attributes:
        clock: mapping to the peer's clock.
        credit: what each end has handed to the other, where the session carries that.
        heard_at: when the last fresh authentic datagram came [s].
    """

    __slots__ = (
        "_delivered",
        "_heartbeats",
        "_incoming",
        "_is_confirmed",
        "_last_ack",
        "_loss",
        "_newest_report",
        "_next_sequence",
        "_outgoing",
        "_parameters",
        "_protection",
        "_repetition",
        "_replay",
        "_statistics",
        "_update",
        "clock",
        "credit",
        "heard_at",
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
        self._outgoing, self._incoming = parameters.outgoing, parameters.incoming
        self._statistics = statistics
        self.clock = Clock(parameters.epoch, peer_clock, now)
        self.credit = Credit()
        self.heard_at = now
        # Silence is faded from this share of the limit on, so a gap of that length must not come by chance.
        self._heartbeats = HeartbeatSchedule(now, FADE_SHARE * parameters.silence, parameters.tick_period)
        self._replay = ReplayWindow()
        self._loss = LossMeter()
        self._repetition = Repetition()
        self._update: _Update | None = None
        self._delivered = 0
        self._last_ack = 0
        self._newest_report = -1
        self._next_sequence = first_sequence
        self._is_confirmed = False

    # --- sending

    def send_update(
        self, now: float, tick: int, selector: int, newest: tuple[int, ...], gap: int, previous: tuple[int, ...]
    ) -> bytes:
        """The datagram of a new update, which replaces any older one as the state to be held by the peer.

        Raises:
            ValueError: naming the field that cannot be sent; nothing has changed then.
        """
        if tick < 0:
            raise ValueError(f"tick must not be negative, not {tick}")
        self._outgoing.check(selector, newest, gap, previous)
        self._update = _Update(tick, selector, newest, gap, previous)
        sequence, datagram = self._seal_update(self._update, now)
        self._repetition.begin(sequence, now)
        self._statistics.updates_sent += 1
        return datagram

    def send_repeat(self, now: float) -> bytes:
        """The newest update again, with a new number and time stamp."""
        assert self._update is not None
        sequence, datagram = self._seal_update(self._update, now)
        self._repetition.repeated(sequence, now)
        self._statistics.repeats += 1
        return datagram

    def send_heartbeat(self, now: float) -> bytes:
        minimum, latest, late = self.clock.report()
        report = Report(
            round(minimum * 1e6), round(latest * 1e6), round(late * 1e6), round(min(self._loss.fraction, 1.0) * 65_535)
        )
        sequence = self._number(now)
        self._heartbeats.reported(now, is_confirmed=self._is_confirmed)
        self._statistics.heartbeats += 1
        credit = self.credit.handed if self._outgoing.carries_credit else None
        clear = pack_heartbeat(sequence & SEQUENCE_MASK, self._ack(), self.clock.stamp(now), report, credit)
        return self._protection.seal(sequence, clear)

    def send_bye(self, now: float, reason: str) -> bytes:
        sequence = self._number(now)
        clear = pack_bye(sequence & SEQUENCE_MASK, self._ack(), self.clock.stamp(now), reason)
        return self._protection.seal(sequence, clear)

    def _seal_update(self, update: _Update, now: float) -> tuple[int, bytes]:
        if self._next_sequence & ACKNOWLEDGEMENT_MASK == self._last_ack:
            self._next_sequence += 1  # else an acknowledgement 2^16 datagrams old would look like one of this update
        sequence = self._number(now)
        clear = self._outgoing.pack(
            sequence & SEQUENCE_MASK,
            self._ack(),
            self.clock.stamp(now),
            update.tick & _TICK_MASK,
            update.selector,
            update.newest,
            update.gap,
            update.previous,
            self.credit.handed,
        )
        return sequence, self._protection.seal(sequence, clear)

    def _number(self, now: float) -> int:
        sequence = self._next_sequence
        self._next_sequence = sequence + 1
        self._heartbeats.sent(now)
        return sequence

    def _ack(self) -> int:
        return self._delivered & ACKNOWLEDGEMENT_MASK

    # --- time

    def next_timer(self, *, is_engaged: bool) -> float:
        """When something is due [s]."""
        due = self._heartbeats.due(is_engaged=is_engaged)
        return min(due, self._repeat_due()) if is_engaged else due

    def handle_timer(self, now: float, *, is_engaged: bool) -> bytes | None:
        """The next datagram that is due, if any; updates are not repeated to a peer that has fallen silent."""
        if is_engaged and now >= self._repeat_due():
            return self.send_repeat(now)
        return self.send_heartbeat(now) if now >= self._heartbeats.due(is_engaged=is_engaged) else None

    def _repeat_due(self) -> float:
        if not self._repetition.is_pending:
            return inf
        rtt = self.clock.rtt
        if rtt is None:
            return self._repetition.due_at(0.0, UNMEASURED_RTT)
        return self._repetition.due_at(rtt, rtt + self.clock.late + SLACK + 1.5 * CLEAN_INTERVAL)

    # --- receiving

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

    def accept(self, opened: Opened, now: float) -> UpdateReceived | PeerClosed | DropReason | None:
        """Take an authentic datagram: what it says, why it is of no use, or None for a heartbeat."""
        sequence, first, body = opened
        if not self._replay.is_new(sequence):
            return DropReason.REPLAYED
        self._replay.mark(sequence)
        self._statistics.lost += self._loss.record(sequence)
        self._is_confirmed = True
        head = read_head(first, body)
        departure = self.clock.departure(head.sent, now)
        if not self.clock.is_plausible(departure, now):
            return DropReason.IMPLAUSIBLE
        self.clock.record(departure, now)
        self._take_acknowledgement(head.ack, departure)
        if head.kind == _BYE:
            return PeerClosed(unpack_bye(body))
        if head.kind == _HEARTBEAT and not self._take_report(sequence, unpack_report(body)):
            return DropReason.IMPLAUSIBLE
        outcome = self._deliver(sequence, head, departure, body, now)
        is_untrue = outcome is DropReason.IMPLAUSIBLE or outcome is DropReason.MALFORMED
        if self._incoming.carries_credit and not is_untrue:  # what is late is still true of a growing count
            self.credit.learn(sequence, *unpack_credit(head.kind, body))
        return outcome

    def _deliver(
        self, sequence: int, head: Head, departure: float, body: bytes, now: float
    ) -> UpdateReceived | DropReason | None:
        age = self.clock.age(departure, now)
        if age is not None and age > self._parameters.silence:
            return DropReason.STALE
        self.heard_at = now
        if head.kind == _HEARTBEAT:
            return None
        if age is None:
            return DropReason.UNTIMED
        if sequence < self._delivered:
            return DropReason.SUPERSEDED
        return self._deliver_update(sequence, head, departure, body, age)

    def _deliver_update(
        self, sequence: int, head: Head, departure: float, body: bytes, age: float
    ) -> UpdateReceived | DropReason:
        newest, gap, previous = self._incoming.unpack(body, head.has_previous)
        if head.has_previous and not gap:
            return DropReason.MALFORMED
        sent_tick = departure / self._parameters.tick_period
        tick = expand_counter(head.tick, TICK_BITS, int(sent_tick))
        if (tick - sent_tick) * self._parameters.tick_period > TICK_LEAD:
            return DropReason.IMPLAUSIBLE
        self._delivered = sequence
        if self._loss.fraction > LOSSY:
            self._heartbeats.acknowledge_by(self.heard_at + ACKNOWLEDGE_WITHIN)
        return UpdateReceived(tick, head.selector, newest, gap, previous, age)

    def _take_acknowledgement(self, ack: int, departure: float) -> None:
        self._last_ack = ack
        if not self._repetition.is_pending or self._repetition.acknowledge(ack):
            return
        arrived = self.clock.arrival_bound(self._repetition.sent_at)
        if arrived is not None and departure > arrived + SLACK:
            self._repetition.miss()

    def _take_report(self, sequence: int, report: Report) -> bool:
        if sequence < self._newest_report:
            return True
        if not self.clock.learn(report.minimum_us * 1e-6, report.latest_us * 1e-6, report.late_us * 1e-6):
            return False
        self._newest_report = sequence
        loss = report.loss_65535 / 65_535
        self._statistics.outgoing_loss = loss
        self._heartbeats.adapt(loss)
        return True

    def measure(self) -> None:
        """Write the present measurements into the statistics."""
        self._statistics.rtt = self.clock.rtt
        self._statistics.one_way = self.clock.one_way
        self._statistics.incoming_loss = self._loss.fraction
