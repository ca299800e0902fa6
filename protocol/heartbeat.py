"""Schedule heartbeats, and decide whether one asks for an answer.

Any datagram shows that this end is alive, so heartbeats fill the gaps between updates. An end sends early enough for
the loop age of the *peer* (`weberlink.protocol.liveness`): what the newest datagram of this end echoed had arrived here
at some time, and without loss the loop age of the peer is at most the time since then plus the round trip. So the next
datagram is due when that time has become the reach: what round trip, late ticks and questions leave of the largest loop
age. If nothing new has come from the peer, there is nothing new to echo; then a datagram is due one gap after the last,
which the extrapolation of motion and the reception limit allow. Two ends at rest need three datagrams per reach
together.

An end whose own loop age is larger than that, or which has heard nothing for longer than the gap of the peer, asks
every few milliseconds, and is answered at once. The number of questions for which reach and gap leave room follows from
the measured loss, so a false alarm needs the loss of a datagram and of all questions after it. With independent losses
that happens at most `FALSE_ALARMS_PER_S` often.

Where the path is so long that an answer would come too late, the datagrams go out so densely that as many of them as
there would be questions fit before the limit.
"""

from math import ceil, inf, log
from typing import Final

from weberlink.protocol.liveness import FADE_SHARE, HORIZON_SHARE, UNITS

LONGEST_REACH: Final = 0.4
"""Longest reach [s]."""
LEAST_SHARE: Final = 0.1
"""Shortest gap, as a share of the silence limit: a limit too short for its path must not cause a flood."""
LATE_TICKS: Final = 3
"""How late both ends together send their heartbeats [ticks]."""
INTRODUCTIONS: Final = 5
INTRODUCTION_INTERVAL: Final = 0.02
"""Pace of the first heartbeats, sent beside updates [s]: the peer cannot date our updates before it has a report."""
REPORT_INTERVAL: Final = 1.0
"""A heartbeat with a report goes out at least this often, however many updates do [s]."""
DENSEST: Final = 0.005
"""Shortest reach on a lossy link [s], so that at most 200 heartbeats a second are sent."""
ASK_PACE: Final = 0.004
"""Least time between two questions [s], so that at most 25 are sent in a silence of 100 ms."""
LEAST_QUESTIONS: Final = 2
"""Questions before the silence limit on a link that has lost nothing yet: the first loss must not end a contact."""
MOST_QUESTIONS: Final = 50
FALSE_ALARMS_PER_S: Final = 1.0 / 3600.0
CHANCE_FADES_PER_S: Final = 1.0 / 10.0
CHANCE_STOPS_PER_S: Final = 1.0
"""How often losses may cause a needless silence, a needless fade, and a needless stop of an extrapolated motion [1/s].
Fades and stops end with the next datagram; a false alarm ends the contact."""


class HeartbeatSchedule:
    """Times of the heartbeats of one direction.

    Attributes:
        reach: longest time from an arrival that was echoed to our next datagram, if there is a newer one [s].
        gap: longest time between two of our datagrams [s].
        interval: time in which energy that was granted is told [s].
    """

    def __init__(self, now: float, *, silence: float, tick_period: float) -> None:
        """Begin with one that is due. A heartbeat may be late by a tick period."""
        self._fade = FADE_SHARE * silence
        self._horizon = HORIZON_SHARE * silence
        self._silence = silence
        self._tick_period = tick_period
        self._introductions = INTRODUCTIONS
        self._answer_wanted = False
        self._confirmed_at = self._heard_at = self._echoed_at = now
        self._round_trip = 0.0
        self._told = self._credit = 0
        self._asked_at = -inf
        self._sent_at = self._pulsed_at = self._reported_at = now - REPORT_INTERVAL
        self._due_engaged: float | None = None
        self.adapt(0.0, 0.0, inf, 0.0, 0.0)

    def adapt(self, outgoing: float, incoming: float, rtt: float, jitter: float, round_trip: float) -> None:
        """Take new measurements of the link: loss of each direction, 0..1; measured round trip, infinite while unknown,
        and its jitter; the round trip that both ends have agreed on [s]."""
        path = (0.0 if rtt == inf else rtt) + jitter
        late = LATE_TICKS * self._tick_period
        overhead = path + late + (self._silence + round_trip) / UNITS
        unanswered = 1.0 - (1.0 - outgoing) * (1.0 - incoming)
        shortest = LEAST_SHARE * self._silence
        reach = min(LONGEST_REACH, self._fade + round_trip - overhead)
        for limit, rate, least in (
            (self._fade, CHANCE_FADES_PER_S, 0),
            (self._silence, FALSE_ALARMS_PER_S, LEAST_QUESTIONS),
        ):
            needed = max(least, questions_needed(unanswered, rate * shortest))
            reach = min(reach, self._longest_pause(limit + round_trip - overhead, needed, needed, path))
        self.reach = max(min(DENSEST, 2.0 * shortest) if unanswered > 0.0 else 2.0 * shortest, reach)
        self.interval = max(shortest, 0.5 * self.reach)
        self.gap = self._gap(outgoing, unanswered, shortest, path, jitter)
        self._round_trip = round_trip
        self._ask_after = self.reach + overhead
        self._ask_after_quiet = self._gap(incoming, unanswered, shortest, path, jitter) + jitter + late
        self._answered_in = rtt + jitter + 2.0 * self._tick_period
        self._due_engaged = None

    def _longest_pause(self, room: float, losses: int, questions: int, path: float) -> float:
        """Longest pause between two datagrams with which a limit that leaves this room for pauses holds, although so
        many datagrams in a row are lost, and so many questions, whose answers take this path [s]."""
        asking = questions * (ASK_PACE + self._tick_period) + (path if questions else 0.0)
        return max(room - asking, room / (1 + losses))

    def _gap(self, loss: float, unanswered: float, shortest: float, path: float, jitter: float) -> float:
        """Longest time between two datagrams of a direction with this loss, so that its receiver stays in touch [s]."""
        late = LATE_TICKS * self._tick_period
        stops = min(1.0, CHANCE_STOPS_PER_S * self.interval)
        gap = (self._horizon - jitter - late) / (1 + questions_needed(loss, stops))
        for limit, rate, least in (
            (self._fade, CHANCE_FADES_PER_S, 0),
            (self._silence, FALSE_ALARMS_PER_S, LEAST_QUESTIONS),
        ):
            losses = max(least, questions_needed(loss, rate * shortest))
            questions = max(least, questions_needed(unanswered, rate * shortest))
            gap = min(gap, self._longest_pause(limit - jitter - late, losses, questions, path))
        return min(self.reach, max(shortest, gap))

    def heard(self, now: float, confirmed_at: float) -> None:
        """A fresh datagram of the peer came, and the peer is known to have heard what left at `confirmed_at` [s]."""
        self._heard_at = now
        self._confirmed_at = confirmed_at
        self._due_engaged = None

    def granted(self, credit: int) -> None:
        """The credit granted to the peer so far, in a session that carries it."""
        if credit != self._credit:
            self._credit = credit
            self._due_engaged = None

    def sent(self, now: float, heard_at: float, credit: int) -> None:
        """A datagram of any kind went out, echoing one that came at `heard_at`, with this credit."""
        self._sent_at = now
        self._echoed_at = heard_at
        self._told = credit
        self._answer_wanted = False
        self._due_engaged = None

    def pulsed(self, now: float, *, has_reported: bool, is_confirmed: bool) -> None:
        """The datagram was a heartbeat; `is_confirmed` if the peer was heard under these keys."""
        if now >= self._ask_due():
            self._asked_at = now
        self._pulsed_at = now
        if has_reported:
            self._reported_at = now
        self._introductions -= is_confirmed and self._introductions > 0
        self._due_engaged = None

    def asked(self) -> None:
        """The peer wants to hear something; any datagram is an answer."""
        self._answer_wanted = True
        self._due_engaged = None

    def asks(self, now: float) -> bool:
        """Whether a heartbeat sent now asks for an answer: a datagram is missing, and an answer can be in time."""
        last = max(self._confirmed_at + self._round_trip, self._heard_at) + self._silence - self._answered_in
        return self._ask_due() <= now <= last

    def reports(self, now: float) -> bool:
        """Whether a heartbeat sent now must report."""
        return self._introductions > 0 or now >= self._reported_at + REPORT_INTERVAL

    def _ask_due(self) -> float:
        """When a datagram is missing that was due by either limit, if an answer can come before that limit."""
        paced, silence = self._asked_at + ASK_PACE, self._silence
        loop = max(self._confirmed_at + self._ask_after, paced)
        quiet = max(self._heard_at + self._ask_after_quiet, paced)
        loop_ends, quiet_ends = self._confirmed_at + silence + self._round_trip, self._heard_at + silence
        return min(
            loop if loop + self._answered_in <= loop_ends else inf,
            quiet if quiet + self._answered_in <= quiet_ends else inf,
        )

    def due(self, *, is_engaged: bool) -> float:
        """Time of the next heartbeat if nothing else is sent [s]."""
        if not is_engaged:
            return min(self._reported_at + REPORT_INTERVAL, self._sent_at + self.interval)
        if self._due_engaged is None:  # read several times a tick, changed by a datagram only
            self._due_engaged = self._find_due()
        return self._due_engaged

    def _find_due(self) -> float:
        if self._answer_wanted:
            return self._sent_at
        due = min(self._reported_at + REPORT_INTERVAL, self._sent_at + self.gap, self._ask_due())
        if self._heard_at > self._echoed_at:
            due = min(due, self._echoed_at + self.reach)
        if self._credit != self._told:
            due = min(due, self._sent_at + self.interval)
        return min(due, self._pulsed_at + INTRODUCTION_INTERVAL) if self._introductions else due


def questions_needed(unanswered: float, rate: float) -> int:
    """The least number of questions for which all of them stay unanswered more rarely than `rate` per interval.

    Losses are taken as independent. Bursts longer than the questions are not covered: no datagram arrives during them.
    """
    if unanswered <= rate:
        return 0
    return MOST_QUESTIONS if unanswered >= 1.0 else min(MOST_QUESTIONS, ceil(log(rate) / log(unanswered)) - 1)
