"""One session from the keys on: make its datagrams, say when the next one is due, check and read those of the peer."""

from math import inf
from typing import Final

from weberlink.protocol import wire
from weberlink.protocol.counters import Credit, LossMeter, ReplayWindow, expand
from weberlink.protocol.events import ChangeAnswered, ChangeProposed, DropReason, PathProbe, PeerClosed, UpdateReceived
from weberlink.protocol.liveness import HeartbeatSchedule, Liveness
from weberlink.protocol.local_end import LocalEnd
from weberlink.protocol.negotiation import NUMBERS, Negotiation, RoundTripAgreement, in_ms
from weberlink.protocol.retransmission import RESIDUAL, Allowance, OutgoingStream, copies_needed
from weberlink.protocol.security import Protection
from weberlink.protocol.timing import Clock
from weberlink.protocol.wire import ACKNOWLEDGEMENT_MASK, Content, Envelope, Report
from weberlink.text import one_line
from weberlink.update import Update

TICK_AHEAD: Final = 1.0
"""How far a sample tick may lie after the datagram that carries it [s]; the owner's tick grid need not be exact."""
CHANGE_AHEAD: Final = 30.0  # how far ahead of its datagram a proposed change may lie [s]
TICK_AGE_SLACK: Final = 0.01
"""How much older than the largest loop age a sample may be when its datagram leaves [s]: the owner's ticks may be late.
"""
EXPIRY: Final = 3.0  # how long a session may be silent without a break [s]; time stamps wrap after 84 s
SLACK: Final = 0.001  # added to the measured bound on delays, because both ends work in ticks [s]
UNMEASURED_RTT: Final = 0.2  # assumed round trip until it is measured [s]
LOSS_STEP: Final = 0.02  # change of the measured loss that is reported with the next heartbeat
_TICK_MASK: Final = (1 << wire.TICK_BITS) - 1

Outcome = UpdateReceived | PeerClosed | ChangeProposed | ChangeAnswered | PathProbe | DropReason | None
"""What an authentic datagram says, or the reason to drop it; None if only the session needs it."""


class Session:
    """One session.

    Attributes:
        silent_since: when the present silence began [s]; inf without one.
        sequence, is_fresh, is_newest: of the authentic datagram that came last: its number, whether it was fresh
            (`Liveness.is_fresh`), and whether none that was sent after it was accepted before it.
        said_encoding: whether our newest datagram said that our encoder runs.
        copies: how often to send at once, on this link, what must not be lost.
    """

    def __init__(
        self, end: LocalEnd, keys: Protection, peer_clock: float, now: float, longest: float, confirmed_at: float = -inf
    ) -> None:
        """Begin with a handshake datagram of the peer, which left at `peer_clock` on its clock and arrived at `now`.
        `confirmed_at` is the departure of our datagram that it answers; -inf if it answers none. `longest` is the
        largest round trip that both ends allow [s]."""
        self._end = end
        self._protection = keys
        self._tick_period = end.tick_period
        self._statistics = end.statistics
        self.clock = Clock(end.epoch, peer_clock, now)
        self.credit = Credit()
        streams = len(end.receives.updates)
        self.liveness = Liveness(end.epoch, end.silence, peer_clock, now, confirmed_at, streams)
        self.heartbeats = HeartbeatSchedule(self.liveness, now, end.tick_period)
        self.negotiation = Negotiation()
        self.round_trip = RoundTripAgreement(self.liveness, longest, end.tick_period, proposes=end.calls)
        self.silent_since = inf
        self.sequence = 0
        self.is_fresh = self.is_newest = self.said_encoding = False
        self._loss = LossMeter()
        # What the peer sends.
        self._replay = ReplayWindow()
        self._newest_report = -1
        self._floor = self._mark = -1
        self._marked_at = now
        self._every = tuple(range(streams))
        self._held_ticks = [0] * streams
        # Sum of these, truncated. Where the peer tells another one, an update is missing: otherwise an attacker who
        # drops only updates could keep an old one in use.
        self._held_sum = 0
        self._acks = [0] * streams  # number of the newest update received; 0 for none
        self._acks_from = [-inf] * streams  # the `confirmed_at` that shows that the peer has heard of it
        self._told_from = -inf  # the same for the first updates of all since an interruption; inf until there are any
        # What this end sends.
        self._allowance = Allowance()
        self._streams = tuple(OutgoingStream(layout, self._allowance, self.liveness) for layout in end.sends.updates)
        self._next_sequence = 1
        _, self._departed = self.clock.stamp(now)
        keys.begin(now, self._next_sequence, end.rekey_after)
        self._reported = (0.0, 0.0, 0.0)
        self._lost = 0
        self.copies = copies_needed(end.statistics.outgoing_loss, end.statistics.outgoing_burst)

    @property
    def expires_at(self) -> float:
        """Time at which the session expires [s].

        It counts from the beginning of the silence. One loop age may stay above the limit and the other one below it:
        then both ends hear each other, and only the end of the session lets them measure anew."""
        return min(self.silent_since, self.liveness.silent_at) + EXPIRY

    # --- what the peer sends

    def is_authentic(self, data: bytes) -> bool:
        """Whether a datagram of the right length is of this session. Changes nothing."""
        return self._open(data)[1] is not None

    def _open(self, data: bytes) -> tuple[int, bytes | None]:
        """Number of a datagram, and what it says (`DirectionLayout.read`); None if it is not of this session."""
        newest = self._replay.newest
        sequence = expand(wire.sequence_of(data), wire.SEQUENCE_BITS, max(newest + 1, wire.HALF_SEQUENCE))
        return sequence, self._protection.open(sequence, data, newest)

    def receive(self, data: bytes, now: float) -> Outcome:  # noqa: C901, PLR0911, PLR0912 - each reason to drop
        """Take a datagram of the right length; BAD_TAG, and nothing has changed, if it is not of this session."""
        sequence, said = self._open(data)
        if said is None:
            return DropReason.BAD_TAG
        newest = self._replay.newest
        self.sequence, self.is_fresh, self.is_newest = sequence, False, sequence > newest
        if not self._replay.accept(sequence):
            return DropReason.REPLAYED
        self._statistics.received += 1
        if self.is_newest:
            self._protection.accept(data[0])
        # Numbers up to one that was accepted at least one silence limit ago are rejected: they left before that. Time
        # stamps and echoes wrap, so a datagram that was held back for minutes may look new; its number does not.
        if now - self._marked_at >= self.liveness.silence:
            self._floor, self._mark, self._marked_at = self._mark, newest, now
        self._statistics.lost += self._loss.record(sequence)
        try:
            content = self._end.receives.read(said)
        except ValueError:
            return DropReason.MALFORMED
        clock = self.clock
        departure = clock.departure(content.sent, now)
        if departure is None:
            return DropReason.IMPLAUSIBLE
        if sequence <= self._floor:
            return DropReason.STALE
        clock.record(departure, now)
        if self.liveness.opened_at == -inf:  # a responder learns the round trip, if the user allows it
            round_trip_ms = content.round_trip_ms
            if round_trip_ms is None or round_trip_ms > in_ms(self.round_trip.longest):
                return DropReason.UNTIMED
            self.liveness.agree(round_trip_ms * 1e-3, now)
            self._pace()
        for stream, ack in zip(self._streams, content.acks, strict=True):
            if not stream.acknowledge(sequence, ack, is_newest=self.is_newest):
                arrived = clock.arrival_bound(stream.sent_at)
                if arrived is not None and departure > arrived + SLACK:
                    stream.is_missed = True
        if content.kind == wire.BYE:
            return PeerClosed(one_line(content.data.decode(errors="replace")))
        if content.report is not None and not self._learn(content.report, now):
            return DropReason.IMPLAUSIBLE
        outcome = self._deliver(content, departure, now)
        self._watch_streams()
        # A late credit is still true, because the count only grows.
        if content.credit is not None and outcome is not DropReason.IMPLAUSIBLE:
            bits = wire.UPDATE_CREDIT_BITS if content.update is not None else wire.HEARTBEAT_CREDIT_BITS
            self.credit.learn(sequence, content.credit, bits)
        return outcome

    def _learn(self, report: Report, now: float) -> bool:
        """Take the peer's measurements; False if they cannot be true."""
        if self.sequence < self._newest_report:
            return True
        clock, statistics = self.clock, self._statistics
        bound = clock.learn(report.minimum_us * 1e-6, report.latest_us * 1e-6, report.late_us * 1e-6)
        if bound is None:
            return False
        self._newest_report = self.sequence
        statistics.outgoing_loss = report.loss_65535 / wire.LOSS_UNITS
        statistics.outgoing_burst = report.burst_256 / wire.BURST_UNITS
        self.copies = copies_needed(statistics.outgoing_loss, statistics.outgoing_burst)
        lost = (report.lost - self._lost + 0x8000 & 0xFFFF) - 0x8000
        self._allowance.adapt(lost, self._next_sequence, clock.outgoing_jitter, now)
        self._lost = report.lost
        self.round_trip.on_needed(bound, now - self._end.epoch, now)
        self._pace()
        return True

    def _pace(self) -> None:
        """Send heartbeats as the present measurements and the agreed round trip need them."""
        rtt, jitter = self.clock.rtt, self.clock.jitter
        self.heartbeats.adapt(self._statistics.outgoing_loss, self._loss.fraction, inf if rtt is None else rtt, jitter)

    def _deliver(self, content: Content, departure: float, now: float) -> Outcome:  # noqa: PLR0911 - as above
        kind, liveness = content.kind, self.liveness
        age = self.clock.one_way  # of this datagram, which was recorded last
        if not liveness.is_fresh(age, content.generation):
            return DropReason.STALE
        self.is_fresh = True
        is_current = liveness.hear(departure, content.echo, content.generation, now)
        if kind == wire.HEARTBEAT:
            runs = content.selector & wire.ENCODES != 0
            streams = self._every if content.tick == self._held_sum else ()
            liveness.hear_encoder(self.sequence, now, runs=runs, streams=streams)
            if content.mark:
                self.heartbeats.is_answer_wanted = True
            return None
        if kind == wire.PATH:
            return PathProbe(content.data, content.mark)
        if age is None or not is_current:
            return DropReason.UNTIMED if age is None else DropReason.STALE
        if content.update is None:
            return self._deliver_change(content, departure, now)
        stream = int(kind == wire.SECOND_UPDATE)
        if self.sequence < self._acks[stream]:
            return DropReason.SUPERSEDED
        lag, selector, newest, payload = content.update
        tick = round(departure / self._tick_period) - lag
        ahead = tick * self._tick_period - departure
        if ahead > TICK_AHEAD or tick < 0:
            return DropReason.IMPLAUSIBLE
        if -ahead > liveness.limit + TICK_AGE_SLACK:
            return DropReason.STALE
        self._acknowledge(stream, self.sequence, tick)
        streams = self._every if content.tick == self._held_sum else (stream,)
        liveness.hear_encoder(self.sequence, now, runs=True, streams=streams)
        return UpdateReceived(Update(tick, selector, newest, payload), age, stream)

    def _deliver_change(self, content: Content, departure: float, now: float) -> Outcome:
        number, body = content.selector, content.data
        negotiation = self.negotiation if number < NUMBERS else self.round_trip
        if content.mark:
            return negotiation.on_answer(number, body, now)
        sent_tick = departure / self._tick_period
        tick = expand(content.tick, wire.CHANGE_TICK_BITS, max(int(sent_tick), wire.HALF_CHANGE_TICK))
        if abs(tick - sent_tick) * self._tick_period > CHANGE_AHEAD:
            return DropReason.IMPLAUSIBLE
        peer_time = self.clock.peer_time(now)
        at = now if peer_time is None else now + (tick * self._tick_period - peer_time)
        return negotiation.on_proposal(number, tick, body, max(now, at))

    def _acknowledge(self, stream: int, number: int, tick: int) -> None:
        """Acknowledge an update of the peer from now on; with 0, that this end holds none."""
        self._acks[stream], self._held_ticks[stream] = number, tick
        self._held_sum = sum(self._held_ticks) & _TICK_MASK
        self._acks_from[stream] = self.liveness.confirmed_after(self._departed)
        if self._told_from == inf and all(self._acks):
            self._told_from = max(self._acks_from)
            self.heartbeats.ask()

    def request_full_state(self) -> None:
        """Acknowledge no update any more, so that the peer sends its full state."""
        for stream in range(len(self._acks)):
            self._acknowledge(stream, 0, 0)

    def measure(self) -> None:
        """Write the present measurements into the statistics."""
        statistics, clock = self._statistics, self.clock
        statistics.rtt = clock.rtt
        statistics.one_way = clock.one_way
        statistics.incoming_loss = self._loss.fraction

    # --- what this end sends

    def send_update(self, now: float, update: Update, stream: int = 0) -> bytes:
        """The datagram of a new update, which replaces any older one of its stream.

        Raises ValueError, naming the field that cannot be sent; nothing has changed then."""
        if update.tick < 0:
            raise ValueError(f"tick must not be negative, not {update.tick}")
        own = self._streams[stream]
        own.layout.check(update)
        own.update = update
        sequence, datagram = self._seal_update(own, update, now)
        own.begin(sequence, now, self.copies)
        self._watch_streams()
        self.said_encoding = True
        self._statistics.updates_sent[stream] += 1
        return datagram

    def _seal_update(self, stream: OutgoingStream, update: Update, now: float) -> tuple[int, bytes]:
        while self._next_sequence & ACKNOWLEDGEMENT_MASK in (0, stream.last_ack):
            self._next_sequence += 1  # else confused with an acknowledgement of nothing, or of 2^16 datagrams ago
        envelope, sequence = self._envelope(now)
        lag = round(self._departed / self._tick_period) - update.tick
        ticks = self._newest_ticks() if len(self._streams) > 1 else 0
        self.heartbeats.sent(now)
        clear = stream.layout.pack(envelope, lag, update, self.credit.granted, ticks)
        return sequence, self._protection.seal(sequence, clear, now)

    def _newest_ticks(self) -> int:
        """Sum of the ticks of our newest updates of all streams, truncated."""
        return sum(stream.update.tick for stream in self._streams if stream.update is not None) & _TICK_MASK

    def prove(self) -> None:
        """Nothing counts that either end held before an interruption."""
        self._told_from = max(self._acks_from) if all(self._acks) else inf  # one may have ended the silence
        for stream in self._streams:
            stream.forget()
        self._watch_streams(was_proven=False)

    def _watch_streams(self, *, was_proven: bool = True) -> None:
        since, are_held = inf, True
        for stream in self._streams:
            since = min(since, stream.unheld_since)
            are_held = are_held and stream.is_held
        liveness = self.liveness
        was_proven = was_proven and liveness.is_proven
        liveness.hold(since, is_proven=was_proven or (are_held and liveness.confirmed_at >= self._told_from))

    def late_stream(self, now: float) -> int:
        """Number of the stream, from 1, of which an update is missing for longest: of this end if one is too late, else
        of the peer."""
        since = [stream.unheld_since for stream in self._streams]
        if min(since) + self.liveness.round_trip + self.liveness.limit >= now:
            since = self.liveness.proven_at
        return since.index(min(since)) + 1

    def send_heartbeat(self, now: float, *, is_encoding: bool = False) -> bytes:
        """The datagram of a heartbeat, which may report our measurements and ask for an answer."""
        asks, is_confirmed = self.heartbeats.asks(now), self._replay.newest >= 0
        report = self._report(must=self.heartbeats.reports(now))
        envelope, sequence = self._envelope(now)
        self.heartbeats.sent(now)
        self.heartbeats.sent_heartbeat(now, has_reported=report is not None, is_confirmed=is_confirmed)
        self._statistics.heartbeats += 1
        self.said_encoding = is_encoding
        clear = wire.pack_heartbeat(
            envelope,
            self._newest_ticks(),
            report,
            self.credit.granted if self._end.carries_credit else None,
            round_trip_ms=None if is_confirmed or not self._end.calls else in_ms(self.liveness.round_trip),
            asks=asks,
            is_encoding=is_encoding,
        )
        return self._protection.seal(sequence, clear, now)

    def _report(self, *, must: bool) -> Report | None:
        """Our measurements; None where the link is as the newest report says, unless one must be sent."""
        minimum, latest, jitter = self.clock.report()
        least, bound, loss = self._reported
        is_same = abs(minimum - least) <= SLACK and abs(jitter - bound) <= max(SLACK, 0.5 * bound)
        if not must and is_same and abs(self._loss.fraction - loss) <= LOSS_STEP:
            return None
        self._reported = minimum, jitter, self._loss.fraction
        self._statistics.incoming_burst = self._loss.burst
        return Report(
            round(minimum * 1e6),
            round(latest * 1e6),
            round(jitter * 1e6),
            round(min(self._loss.fraction, 1.0) * wire.LOSS_UNITS),
            round(self._statistics.incoming_burst * wire.BURST_UNITS),
            self._loss.lost & wire.LOST_MASK,
        )

    def send(
        self, now: float, kind: int, data: bytes, *, mark: bool = False, selector: int = 0, tick: int | None = None
    ) -> bytes:
        """The datagram of a farewell, of a change, or of a question or an answer (`mark`) about an address."""
        envelope, sequence = self._envelope(now)
        clear = wire.pack(envelope, kind, data, mark=mark, selector=selector, tick=tick)
        return self._protection.seal(sequence, clear, now)

    def _send_change(self, now: float) -> bytes | None:
        """The message of a negotiation that is due."""
        rtt = self.clock.rtt
        negotiation = self.negotiation if now >= self.negotiation.due else self.round_trip
        message = negotiation.take(now, UNMEASURED_RTT if rtt is None else rtt + self.clock.jitter)
        if message is None:
            return None
        number, tick, body, is_answer = message
        return self.send(now, wire.CHANGE, body[: wire.LONGEST_CHANGE], mark=is_answer, selector=number, tick=tick)

    def _envelope(self, now: float) -> tuple[Envelope, int]:
        """Envelope of the next datagram, which leaves now, and its number in full."""
        sequence = self._next_sequence
        self._next_sequence = sequence + 1
        liveness = self.liveness
        confirmed_at, froms = liveness.confirmed_at, self._acks_from
        acks: list[int | None] = []
        for stream, number in enumerate(self._acks):  # told until the peer is known to have heard it
            acks.append(None if confirmed_at >= froms[stream] else number & ACKNOWLEDGEMENT_MASK)
        stamp, self._departed = self.clock.stamp(now)
        return (sequence & wire.SEQUENCE_MASK, liveness.generation, stamp, liveness.echo(now), tuple(acks)), sequence

    # --- time

    def next_timer(self, *, is_encoding: bool) -> float:
        """Time of the next datagram [s]."""
        is_engaged = self.silent_since == inf
        due = self.heartbeats.due(is_engaged=is_engaged)
        if not is_engaged:
            return due
        for stream in self._streams if is_encoding else ():
            if stream.is_forgotten:
                return -inf
            if stream.is_pending:
                due = min(due, stream.due_at(*self._patience()))
        return min(due, self.negotiation.due, self.round_trip.due, self.round_trip.switch_at)

    def handle_timer(self, now: float, *, is_encoding: bool) -> bytes | None:
        """The next datagram that is due, if any; a silent peer is sent heartbeats only."""
        is_engaged = self.silent_since == inf
        if self.round_trip.advance(now):
            self._pace()
        if is_engaged:
            for stream in self._streams if is_encoding else ():
                if stream.update is not None and stream.is_pending and now >= stream.due_at(*self._patience()):
                    return self._repeat(stream, stream.update, now)
            if now >= min(self.negotiation.due, self.round_trip.due):
                return self._send_change(now)
        if now < self.heartbeats.due(is_engaged=is_engaged):
            return None
        is_encoding = is_engaged and is_encoding
        is_plain = not self.heartbeats.asks(now) and not self.heartbeats.reports(now)
        if is_encoding and is_plain and self._statistics.outgoing_loss > RESIDUAL:
            for stream in self._streams:  # an update says all that a heartbeat without question and report says
                if stream.update is not None and stream.can_be_carried(now):
                    return self._repeat(stream, stream.update, now, is_carried=True)
        return self.send_heartbeat(now, is_encoding=is_encoding)

    def _repeat(self, stream: OutgoingStream, update: Update, now: float, *, is_carried: bool = False) -> bytes:
        """The newest update again, with a new number and time stamp."""
        sequence, datagram = self._seal_update(stream, update, now)
        if stream.repeated(sequence, now, is_carried=is_carried):
            self.heartbeats.ask()
        self._statistics.repeats += 1
        return datagram

    def take_lost(self, now: float) -> list[int]:
        """Streams of which the peer needs a new state (`OutgoingStream.is_lost`)."""
        return [number for number, stream in enumerate(self._streams) if stream.is_lost(now)]

    def _patience(self) -> tuple[float, float]:
        """Round trip, and how long to wait for evidence that an update was lost [s]."""
        rtt = self.clock.rtt
        if rtt is None:
            return 0.0, UNMEASURED_RTT
        return rtt, rtt + self.clock.outgoing_jitter + SLACK + self.heartbeats.max_gap
