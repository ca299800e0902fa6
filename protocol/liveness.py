"""Measure whether the two ends hear each other, on each end's own clock, against two limits; and schedule heartbeats.

Reception: something fresh of the peer has come within the silence limit S. This does not depend on the round trip.

Loop age: every datagram echoes the departure of the newest datagram that its sender has heard from the receiver, as a
time on the receiver's clock. So an end knows the time since the departure of its newest datagram that the peer is known
to have heard. It contains both delays, the wait at the peer and the time since, needs no common clock, and does not
depend on how the round trip divides. It bounds the age of whatever the peer has sent. It may be at most S + R, with the
round trip R that both ends have agreed on (`weberlink.protocol.negotiation`).

This is bidirectional forwarding detection (RFC 5880) with the ages of both directions added: hearing the peer is not
enough, the peer must hear this end too. All times that owners need are derived here, so that they compare with S alone.

The echo has 8 bits: the departure in units of 1/64 of S + R, rounded down, modulo 255; 255 if nothing was heard within
S. R may change in a session; a bit beside the echo, the generation, is the parity of the R that its sender uses. The
echo is unambiguous for almost four times S + R. It has to be for three: what counts is at most S + R old, is echoed for
at most S, and that echo is at most S + R old; R at most halves in a change.

Any datagram shows that this end is alive, so heartbeats fill the gaps between updates. An end sends early enough for
the loop age of the *peer*: what the newest datagram of this end echoed had arrived here at some time, and without loss
the loop age of the peer is at most the time since then plus the round trip. So the next datagram is due when that time
has become the largest echo age: what round trip, late ticks and questions leave of the largest loop age. If nothing new
has come from the peer, there is nothing new to echo; then a datagram is due one gap after the last, which the
extrapolation of motion and the reception limit allow. Two ends at rest need three datagrams per echo age together.

An end whose own loop age is larger than that, or which has heard nothing for longer than the gap of the peer, asks
every few milliseconds, and is answered at once. The number of questions for which echo age and gap leave room follows
from the measured loss, so a false alarm needs the loss of a datagram and of all questions after it. With independent
losses that happens at most `FALSE_ALARMS_PER_S` often.

Where the path is so long that an answer would come too late, the datagrams go out so densely that as many of them as
there would be questions fit before the limit.
"""

from collections.abc import Sequence
from math import ceil, floor, inf, log
from typing import Final

DEAF: Final = 255  # the echo of an end that has heard nothing within the limit
UNITS: Final = 64  # units of the echo in S + R; the loop age is overestimated by at most one
_MODULUS: Final = 255
FADE_SHARE: Final = 0.8  # share of the silence limit at which owners begin to fade force out
HORIZON_SHARE: Final = 0.6
"""Share of the silence limit for which a motion is extrapolated after the peer's encoder was last known to run."""

LONGEST_ECHO_AGE: Final = 0.4
LEAST_SHARE: Final = 0.1
"""Shortest gap, as a share of the silence limit: a limit too short for its path must not cause a flood."""
LATE_TICKS: Final = 3  # how late both ends together send their heartbeats [ticks]
INTRODUCTIONS: Final = 5
INTRODUCTION_INTERVAL: Final = 0.02
"""Pace of the first heartbeats, sent beside updates [s]: the peer cannot date our updates before it has a report."""
REPORT_INTERVAL: Final = 1.0  # a heartbeat with a report goes out at least this often, however many updates do [s]
DENSEST: Final = 0.005  # shortest echo age on a lossy link [s], so that at most 200 heartbeats a second are sent
ASK_PACE: Final = 0.004  # least time between two questions [s], so that at most 25 are sent in a silence of 100 ms
LEAST_QUESTIONS: Final = 2
"""Questions before the silence limit on a link that has lost nothing yet: the first loss must not end a contact."""
MOST_QUESTIONS: Final = 50
FALSE_ALARMS_PER_S: Final = 1.0 / 3600.0
CHANCE_FADES_PER_S: Final = 1.0 / 10.0
CHANCE_STOPS_PER_S: Final = 1.0
"""How often losses may cause a needless silence, a needless fade, and a needless stop of an extrapolated motion [1/s].
Fades and stops end with the next datagram; a false alarm ends the contact."""


class Liveness:
    """Both directions of one session. Times are in s; -inf (`generation_heard_at`: inf) stands for never.

    Attributes:
        heard_at: arrival of the newest fresh datagram.
        confirmed_at: departure of our newest datagram that the peer is known to have heard.
        encoder_heard_at: arrival of the newest fresh datagram that left while the peer's encoder ran, with no update
            known to be missing since its departure; a stream of which one is missing may lag behind another one by R.
        encodes_until: until when the peer's encoder counts as running.
        held_until: until when the peer's decoders count as current: S + R after the departure of the oldest of our
            updates that it is not known to hold, or to have replaced by a newer one; inf without one; -inf while it
            must first prove that it holds any.
        undelivered_at: when the updates of one direction count as undelivered: S + 2 R after that departure, or without
            all updates of a peer whose encoder says that it runs. So one that is sent again on evidence comes in time.
        proven_at: by stream of the peer, when this end was last known to hold all its updates.
        is_proven: whether an update of each stream of either end is known to have arrived at the other, or need not be;
            needed after an interruption, so that nobody gets a new limit's worth of motion by each.
        in_touch_at: the end is in touch until then, and fades as time passes since then.
        silent_at: when one of the limits is passed if nothing more is heard.
        silence: S.
        round_trip, generation: R that this end uses now, and its parity.
        limit: largest loop age, S + R; nothing is executed, and nothing is repeated, that is older.
        is_opening: whether nothing that left in this session was confirmed yet, and the path is so long that the first
            confirmation cannot be there in time. Then the session is given time for one round trip, but must not drive.
        opened_at: since when there is a round trip; a responder learns it from the first datagrams of the initiator.
        generation_heard_at: arrival of the first datagram that used the present round trip.
    """

    def __init__(
        self, epoch: float, silence: float, departure: float, now: float, confirmed_at: float = -inf, streams: int = 1
    ) -> None:
        """Begin with a handshake datagram of the peer, which left at `departure` on its clock and arrived at `now`.
        `confirmed_at` is the departure of our datagram that it answers; -inf if it answers none. The peer sends so many
        streams."""
        self._epoch = epoch
        self.silence = self.limit = silence
        self.round_trip = 0.0
        self._round_trips = [0.0, 0.0]
        self.generation = 0
        self.is_opening = False
        self.opened_at = -inf
        self.generation_heard_at = inf
        self._departure = departure
        self._newest = -1
        self.heard_at = now
        self.confirmed_at = confirmed_at
        self.encoder_heard_at = self.encodes_until = self.in_touch_at = -inf
        self.held_until = self.undelivered_at = self._unheld_since = self._runs_from = inf
        self._counts_from = -inf
        self.proven_at = [-inf] * streams
        self.is_proven = True
        self._update()

    def agree(self, round_trip: float, now: float) -> None:
        """Begin with this round trip [s], as generation 0."""
        self._round_trips = [round_trip, round_trip]
        self.is_opening = 2.0 * round_trip > self.silence
        self.opened_at = self.generation_heard_at = now
        self._counts_from = inf if self.is_opening else self._counts_from
        self._use(round_trip)

    def expect(self, round_trip: float) -> None:
        """Read echoes of the other generation with this round trip [s] from now on."""
        self._round_trips[1 - self.generation] = round_trip

    def switch(self) -> None:
        """Use the round trip of the other generation, which both ends have agreed on."""
        self.generation = 1 - self.generation
        self.generation_heard_at = inf
        self._use(self._round_trips[self.generation])

    def _use(self, round_trip: float) -> None:
        self.round_trip, self.limit = round_trip, self.silence + round_trip
        self._update()

    def _update(self) -> None:
        loop_from, heard_at = self.confirmed_at + self.round_trip, self.encoder_heard_at
        held_from = max(self._unheld_since, self._counts_from) + self.round_trip
        self.in_touch_at = min(loop_from, heard_at, held_from)
        self.held_until = held_from + self.silence if self.is_proven else -inf
        self.undelivered_at = min(held_from, max(heard_at, self._runs_from) + self.round_trip) + self.limit
        if self.is_opening:
            self.silent_at = self.opened_at + self.limit
        else:
            self.silent_at = min(self.heard_at, loop_from) + self.silence

    def is_fresh(self, age: float | None, generation: int) -> bool:
        """Whether a datagram of this age by the mapped clocks counts [s]; also while they are not mapped (None).

        The mapping errs by at most half the round trip, so the true age of a fresh datagram is at most S + R. R is the
        smaller one of both ends: otherwise an echo could wrap as R rises."""
        return age is None or age <= self.silence + 0.5 * min(self.round_trip, self._round_trips[generation])

    def echo(self, now: float) -> int:
        """The echo of a datagram that leaves now."""
        if now - self.heard_at > self.silence:
            return DEAF
        return floor(self._departure / (self.limit / UNITS)) % _MODULUS

    def confirmed_after(self, departure: float) -> float:
        """The least `confirmed_at` that shows that a datagram was heard which left after this one [s, our clock]."""
        unit = self.limit / UNITS
        return self._epoch + (floor(departure / unit) + 1) * unit

    def hear(self, departure: float, echo: int, generation: int, now: float) -> bool:
        """Take a fresh datagram; returns whether its loop age as it arrives is within the limit. `hold` follows, which
        derives `in_touch_at`, `held_until`, `undelivered_at` and `silent_at` anew."""
        self.heard_at = now
        self._departure = departure if departure > self._departure else self._departure
        if generation == self.generation and self.generation_heard_at == inf:
            self.generation_heard_at = now
        confirmed = -inf  # departure of our newest datagram that the sender of this echo had heard
        if echo != DEAF:
            unit = (self.silence + self._round_trips[generation]) / UNITS
            latest = floor((now - self._epoch) / unit) + 1  # a rounding may put an echo of just now ahead of now
            confirmed = self._epoch + (latest - (latest - echo) % _MODULUS) * unit
            confirmed = confirmed if confirmed < now else now
        if confirmed > self.confirmed_at:
            self.confirmed_at = confirmed
            if self.is_opening and confirmed + self.limit / UNITS >= self.opened_at:
                self.is_opening = False
                self.resume(now)
        return now - confirmed <= self.limit

    def hear_encoder(self, sequence: int, now: float, *, runs: bool, streams: Sequence[int] = ()) -> None:
        """Take what a fresh datagram of this number says of the peer's encoder: whether it ran, and of which streams
        this end holds all updates; `hold` follows. An update says so only if it is executed: otherwise somebody who
        holds updates back could keep an old one in use."""
        if sequence <= self._newest:
            return
        if not runs:
            self._newest = sequence
            self.encodes_until, self._runs_from = -inf, inf
            self.proven_at = [-inf] * len(self.proven_at)
        elif self._runs_from == inf:
            self._runs_from = now
        for stream in streams if runs else ():
            self._newest = sequence
            self.proven_at[stream] = now
            proven_at = min(max(self.proven_at), min(self.proven_at) + self.round_trip)
            if proven_at > -inf:
                self.encoder_heard_at, self.encodes_until = proven_at, proven_at + self.silence

    def hold(self, unheld_since: float, *, is_proven: bool) -> None:
        """The oldest of our updates that the peer is not known to hold left then [s], inf for none."""
        self._unheld_since, self.is_proven = unheld_since, is_proven
        self._update()

    def resume(self, now: float) -> None:
        """Each end hears the other from now on: what their encoders have sent before does not count as missing."""
        self._counts_from = now
        if self._runs_from < inf:
            self._runs_from = now
        self._update()

    def count_from(self, at: float) -> None:
        """What the peer holds of our updates counts from then on [s]: our encoder runs."""
        self._counts_from = at
        self._update()


class HeartbeatSchedule:
    """Times of the heartbeats of one direction, and whether one asks for an answer: `max_echo_age` after an arrival
    that was echoed, if there is a newer one, `max_gap` after our last datagram, `credit_interval` for new credit [s].
    Any datagram tells what is wanted: new credit (`is_credit_wanted`), or that this end is there (`is_answer_wanted`).
    """

    def __init__(self, liveness: Liveness, now: float, tick_period: float) -> None:
        """Begin with one that is due. A heartbeat may be late by a tick period."""
        silence = liveness.silence
        self._liveness, self._tick_period = liveness, tick_period
        self._fade, self._horizon = FADE_SHARE * silence, HORIZON_SHARE * silence
        self._limits = (self._fade, CHANCE_FADES_PER_S, 0), (silence, FALSE_ALARMS_PER_S, LEAST_QUESTIONS)
        self._introductions = INTRODUCTIONS
        self.is_answer_wanted = self.is_credit_wanted = self._must_ask = False
        self._echoed_at = now
        self._asked_at = -inf
        self._sent_at = self._heartbeat_at = self._reported_at = now - REPORT_INTERVAL
        self.adapt(0.0, 0.0, inf, 0.0)

    def adapt(self, outgoing: float, incoming: float, rtt: float, jitter: float) -> None:
        """Take new measurements of the link, and the round trip that both ends have agreed on: loss of each direction,
        0..1; measured round trip, infinite while unknown, and its jitter [s]."""
        path, round_trip = (0.0 if rtt == inf else rtt) + jitter, self._liveness.round_trip
        late = LATE_TICKS * self._tick_period
        overhead = path + late + self._liveness.limit / UNITS
        unanswered = 1.0 - (1.0 - outgoing) * (1.0 - incoming)
        shortest = LEAST_SHARE * self._liveness.silence
        age = min(LONGEST_ECHO_AGE, self._fade + round_trip - overhead)
        for limit, rate, least in self._limits:
            needed = max(least, questions_needed(unanswered, rate * shortest))
            age = min(age, self._longest_pause(limit + round_trip - overhead, needed, needed, path))
        self.max_echo_age = max(min(DENSEST, 2.0 * shortest) if unanswered > 0.0 else 2.0 * shortest, age)
        self.credit_interval = max(shortest, 0.5 * self.max_echo_age)
        self.max_gap = self._longest_gap(outgoing, unanswered, shortest, path, jitter)
        self._ask_after = self.max_echo_age + overhead
        self._ask_after_quiet = self._longest_gap(incoming, unanswered, shortest, path, jitter) + jitter + late
        self._answered_in = rtt + jitter + 2.0 * self._tick_period

    def _longest_pause(self, room: float, losses: int, questions: int, path: float) -> float:
        """Longest pause between two datagrams with which a limit that leaves this room for pauses holds, although so
        many datagrams in a row are lost, and so many questions, whose answers take this path [s]."""
        asking = questions * (ASK_PACE + self._tick_period) + path
        return max(room - asking, room / (1 + losses))

    def _longest_gap(self, loss: float, unanswered: float, shortest: float, path: float, jitter: float) -> float:
        """Longest time between two datagrams of a direction with this loss, so that its receiver stays in touch [s]."""
        late = LATE_TICKS * self._tick_period
        stops = min(1.0, CHANCE_STOPS_PER_S * self.credit_interval)
        gap = (self._horizon - jitter - late) / (1 + questions_needed(loss, stops))
        for limit, rate, least in self._limits:
            losses = max(least, questions_needed(loss, rate * shortest))
            questions = max(least, questions_needed(unanswered, rate * shortest))
            gap = min(gap, self._longest_pause(limit - jitter - late, losses, questions, path))
        return min(self.max_echo_age, max(shortest, gap))

    def sent(self, now: float) -> None:
        """A datagram of any kind went out, with the present credit and the echo of the newest one that was heard."""
        self._sent_at, self._echoed_at = now, self._liveness.heard_at
        self.is_answer_wanted = self.is_credit_wanted = False

    def sent_heartbeat(self, now: float, *, has_reported: bool, is_confirmed: bool) -> None:
        """The datagram was a heartbeat; `is_confirmed` if the peer was heard under these keys."""
        if now >= self._ask_due():
            self._asked_at = now
        self._heartbeat_at = now
        self._must_ask = False
        if has_reported:
            self._reported_at = now
        self._introductions -= is_confirmed and self._introductions > 0

    def ask(self) -> None:
        """Ask the peer at once for an answer, whatever was heard."""
        self._must_ask = self.is_answer_wanted = True

    def asks(self, now: float) -> bool:
        """Whether a heartbeat sent now asks for an answer: a datagram is missing, and an answer can be in time."""
        liveness = self._liveness
        last = max(liveness.confirmed_at + liveness.round_trip, liveness.heard_at) + liveness.silence
        return self._must_ask or self._ask_due() <= now <= last - self._answered_in

    def reports(self, now: float) -> bool:
        """Whether a heartbeat sent now must report."""
        return self._introductions > 0 or now >= self._reported_at + REPORT_INTERVAL

    def due(self, *, is_engaged: bool) -> float:
        """Time of the next heartbeat if nothing else is sent [s]."""
        if not is_engaged:
            return min(self._reported_at + REPORT_INTERVAL, self._sent_at + self.credit_interval)
        if self.is_answer_wanted:
            return self._sent_at
        due = min(self._reported_at + REPORT_INTERVAL, self._sent_at + self.max_gap, self._ask_due())
        if self._liveness.heard_at > self._echoed_at:
            due = min(due, self._echoed_at + self.max_echo_age)
        if self.is_credit_wanted:
            due = min(due, self._sent_at + self.credit_interval)
        return min(due, self._heartbeat_at + INTRODUCTION_INTERVAL) if self._introductions else due

    def _ask_due(self) -> float:
        """When a datagram is missing that was due by either limit, if an answer can come before that limit."""
        liveness, paced = self._liveness, self._asked_at + ASK_PACE
        confirmed_at, heard_at = liveness.confirmed_at, liveness.heard_at
        loop, quiet = max(confirmed_at + self._ask_after, paced), max(heard_at + self._ask_after_quiet, paced)
        loop_ends, quiet_ends = confirmed_at + liveness.limit, heard_at + liveness.silence
        return min(
            loop if loop + self._answered_in <= loop_ends else inf,
            quiet if quiet + self._answered_in <= quiet_ends else inf,
        )


def questions_needed(unanswered: float, rate: float) -> int:
    """The least number of questions for which all of them stay unanswered more rarely than `rate` per interval, if
    losses are independent. Bursts longer than the questions are not covered: no datagram arrives during them."""
    if unanswered <= rate:
        return 0
    return MOST_QUESTIONS if unanswered >= 1.0 else min(MOST_QUESTIONS, ceil(log(rate) / log(unanswered)) - 1)
