"""Schedule heartbeats, and decide whether one asks for an answer.

Any datagram shows that this end is alive, so heartbeats fill the gaps between updates. Without loss the loop age
(`weberlink.protocol.liveness`) is at most the round trip and one interval of each end. An end whose loop age is larger
asks every few milliseconds, and is answered at once: each answered question brings the loop age back to the round trip.
So the interval is half of what round trip and questions leave of the silence limit, and the number of questions follows
from the measured loss.
"""

from math import ceil, inf, log

from weberlink.protocol.liveness import FADE_SHARE, UNITS

LONGEST_INTERVAL = 0.2
"""Longest gap between datagrams without loss [s]."""
LEAST_SHARE = 0.1
"""Shortest gap, as a share of the silence limit: a limit too short for its path must not cause a flood."""
ROUND_TRIP_SHARE = 0.4
"""Largest round trip, as a share of the silence limit, that is advised. Two round trips pass before the first echo of a
session; where these take longer than the limit, it falls silent for some ticks as it begins."""
LATE_TICKS = 3
"""How late both ends together send their heartbeats [ticks]."""
INTRODUCTIONS = 5
INTRODUCTION_INTERVAL = 0.02
"""Pace of the first heartbeats, sent beside updates [s]: the peer cannot date our updates before it has a report."""
REPORT_INTERVAL = 1.0
"""A heartbeat goes out at least this often, however many updates do [s]."""
ASK_PACE = 0.004
"""Least time between two questions [s], so that at most 25 are sent in a silence of 100 ms."""
LEAST_QUESTIONS = 2
"""Questions before the silence limit on a link that has lost nothing yet: the first loss must not end a contact."""
MOST_QUESTIONS = 50
FALSE_ALARMS_PER_S = 1.0 / 3600.0
CHANCE_FADES_PER_S = 1.0 / 10.0
"""How often losses may cause a needless silence, and a needless fade [1/s]. A fade ends with the next datagram; a false
alarm ends the contact."""


class HeartbeatSchedule:
    """Times of the heartbeats of one direction.

    Attributes:
        interval: longest gap between two datagrams without loss [s].
    """

    def __init__(self, now: float, *, silence: float, tick_period: float) -> None:
        """Begin with one that is due.

        Args:
            silence: loop age at which the peer declares us silent [s].
            tick_period: how late a heartbeat may be sent [s].
        """
        self._fade = FADE_SHARE * silence
        self._silence = silence
        self._tick_period = tick_period
        self._introductions = INTRODUCTIONS
        self._answer_wanted = False
        self._confirmed_at = now
        self._asked_at = -inf
        self._sent_at = self._reported_at = now - REPORT_INTERVAL
        self._due_engaged: float | None = None
        self.adapt(0.0, 0.0, inf, 0.0)

    def adapt(self, outgoing: float, incoming: float, rtt: float, jitter: float) -> None:
        """Take new measurements of the link.

        Args:
            outgoing, incoming: loss of each direction, 0..1.
            rtt: round trip [s]; infinity while unknown.
            jitter: by how much few datagrams exceed their least delay [s].
        """
        path = (0.0 if rtt == inf else rtt) + jitter
        overhead = path + LATE_TICKS * self._tick_period + self._silence / UNITS
        unanswered = 1.0 - (1.0 - outgoing) * (1.0 - incoming)
        shortest = LEAST_SHARE * self._silence
        clean = max(shortest, min(LONGEST_INTERVAL, 0.5 * (self._fade - overhead)))
        self.interval = clean
        for limit, rate, least in (
            (self._fade, CHANCE_FADES_PER_S, 0),
            (self._silence, FALSE_ALARMS_PER_S, LEAST_QUESTIONS),
        ):
            questions = max(least, questions_needed(unanswered, rate * clean))
            asking = questions * (ASK_PACE + self._tick_period) + (path if questions else 0.0)
            self.interval = max(shortest, min(self.interval, 0.5 * (limit - overhead - asking)))
        self._ask_after = 2.0 * self.interval + overhead
        self._answered_in = rtt + jitter + 2.0 * self._tick_period
        self._due_engaged = None

    def confirmed(self, at: float) -> None:
        """The peer is known to have heard what left then [s]."""
        self._confirmed_at = at
        self._due_engaged = None

    def sent(self, now: float) -> None:
        """A datagram of any kind went out."""
        self._sent_at = now
        self._answer_wanted = False
        self._due_engaged = None

    def reported(self, now: float, *, is_confirmed: bool) -> None:
        """The datagram was a heartbeat; `is_confirmed`: whether the peer was heard under these keys."""
        if now >= self._ask_due():
            self._asked_at = now
        self._reported_at = now
        self._introductions -= is_confirmed and self._introductions > 0
        self._due_engaged = None

    def asked(self) -> None:
        """The peer wants to hear something; any datagram is an answer."""
        self._answer_wanted = True
        self._due_engaged = None

    def asks(self, now: float) -> bool:
        """Whether a heartbeat sent now asks for an answer: the loop age is too large, and an answer can be in time."""
        return self._ask_due() <= now <= self._confirmed_at + self._silence - self._answered_in

    def _ask_due(self) -> float:
        due = max(self._confirmed_at + self._ask_after, self._asked_at + ASK_PACE)
        return due if due + self._answered_in <= self._confirmed_at + self._silence else inf

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
        due = min(self._reported_at + REPORT_INTERVAL, self._sent_at + self.interval, self._ask_due())
        return min(due, self._reported_at + INTRODUCTION_INTERVAL) if self._introductions else due


def questions_needed(unanswered: float, rate: float) -> int:
    """The least number of questions for which all of them stay unanswered more rarely than `rate`.

    Losses are taken as independent. Bursts longer than the questions are not covered: no datagram arrives during them.

    Args:
        unanswered: share of questions whose answer does not come, 0..1.
        rate: failures allowed per interval.
    """
    if unanswered <= rate:
        return 0
    return MOST_QUESTIONS if unanswered >= 1.0 else min(MOST_QUESTIONS, ceil(log(rate) / log(unanswered)) - 1)
