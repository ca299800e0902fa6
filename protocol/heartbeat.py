"""When a heartbeat is due, and whether it asks for an answer. Knows no bytes, no clock and no state of the endpoint.

Any datagram shows that we are there, so heartbeats fill the gaps between updates. The peer may take part only while the
loop age (`protocol.liveness`) is within its limit. Without loss the loop age is at most the round trip and one interval
of each end, so the interval is half of what the round trip leaves.

How many datagrams loss takes beyond that depends on whether the peer can still ask: one that has heard nothing for
longer than it should asks, and is answered at once. Over a short path that mends a lost heartbeat, and few are needed;
over a long one the answer would come too late, and each half of the limit, less the round trip, must hold enough
datagrams that not all of them are lost by chance.
"""

from collections import deque
from math import floor, inf
from typing import NamedTuple

from protocol.liveness import UNITS
from protocol.loss import datagrams_needed

LONGEST_INTERVAL = 0.2
"""Longest gap between datagrams without loss [s]."""
LEAST_SHARE = 0.1
"""Shortest gap without loss, as a share of the silence limit: a limit too short for its path is not worth a flood."""
LATE_TICKS = 3
"""How late the two ends together may be with a heartbeat, in ticks."""
SHORTEST_INTERVAL = 0.002
INTRODUCTIONS = 5
INTRODUCTION_INTERVAL = 0.02
"""Pace of heartbeats until the peer was heard and as many again were sent, updates or not [s]: it can date none of our
updates before one of our reports."""
REPORT_INTERVAL = 1.0
"""A heartbeat goes out at least this often, however many updates do [s]."""
ASK_PACE = 0.004
"""Least time between two asks [s], so that a silence of 100 ms hears at most 25 of them."""
UNEVENNESS = 1.5
"""Longest gap, in units of the mean one, where a window must hold several datagrams: updates come in bursts."""
FALSE_ALARMS_PER_S = 1.0 / 3600.0
CHANCE_FADES_PER_S = 1.0 / 10.0
"""A fade that begins by chance ends with the next datagram; a false alarm ends the contact."""
_REMEMBERED = 64


class _Demand(NamedTuple):
    """So many datagrams in any window of this length, and no longer gap between two of them [s]."""

    least: int
    window: float
    gap: float


class HeartbeatSchedule:
    """The times of one direction's heartbeats."""

    __slots__ = (
        "_answer_wanted",
        "_answered_in",
        "_ask_after",
        "_asked_at",
        "_demands",
        "_due_engaged",
        "_fade",
        "_heard_at",
        "_interval",
        "_introductions",
        "_reported_at",
        "_sent",
        "_silence",
        "_tick_period",
    )

    def __init__(self, now: float, *, fade: float, silence: float, tick_period: float) -> None:
        """Begin with one that is due.

        Args:
            fade: loop age at which the owner at the other end begins to fade [s].
            silence: loop age at which it gives us up [s].
            tick_period: how late a heartbeat may be sent [s].
        """
        self._fade = fade
        self._silence = silence
        self._tick_period = tick_period
        self._introductions = INTRODUCTIONS
        self._answer_wanted = False
        self._heard_at = now
        self._asked_at = -inf
        self._reported_at = now - REPORT_INTERVAL
        self._sent = deque([self._reported_at] * _REMEMBERED, maxlen=_REMEMBERED)
        self._demands: tuple[_Demand, ...] = ()
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
        late = LATE_TICKS * self._tick_period + self._silence / UNITS
        self._interval = min(
            LONGEST_INTERVAL, max(LEAST_SHARE * self._silence, 0.5 * (self._fade - path - late), SHORTEST_INTERVAL)
        )
        self._ask_after = self._interval + jitter + 2.0 * self._tick_period
        self._answered_in = rtt + jitter + 2.0 * self._tick_period
        unanswered = 1.0 - (1.0 - outgoing) * (1.0 - incoming)
        demands = []
        for limit, rate in ((self._fade, CHANCE_FADES_PER_S), (self._silence, FALSE_ALARMS_PER_S)):
            window = max(self._interval, 0.5 * (limit - path) - self._tick_period)
            least = datagrams_needed(outgoing, window, rate, unanswered ** self._answers(window))
            if least > window / self._interval:  # else met by what is sent anyway
                demands.append(_Demand(least, window, UNEVENNESS * window / least))
        self._demands = tuple(demands)
        self._due_engaged = None

    @property
    def interval(self) -> float:
        """Longest gap between two datagrams without loss [s]."""
        return self._interval

    def _answers(self, window: float) -> int:
        """How often the peer, which knows the same link, can ask and be answered in a silence of that length."""
        left = window - self._ask_after - self._answered_in
        return 1 + floor(left / (ASK_PACE + self._tick_period)) if left >= 0.0 else 0

    def heard(self, now: float) -> None:
        """Something fresh came."""
        self._heard_at = now
        self._due_engaged = None

    def sent(self, now: float) -> None:
        """A datagram of any kind went out."""
        self._sent.append(now)
        self._answer_wanted = False
        self._due_engaged = None

    def reported(self, now: float, *, is_confirmed: bool) -> None:
        """That datagram was a heartbeat; `is_confirmed`: the peer was heard under these keys."""
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
        """Whether a heartbeat sent now asks for an answer: the peer is overdue, and can still be heard in time."""
        return self._ask_due() <= now <= self._heard_at + self._silence - self._answered_in

    def _ask_due(self) -> float:
        due = max(self._heard_at + self._ask_after, self._asked_at + ASK_PACE)
        return due if due + self._answered_in <= self._heard_at + self._silence else inf

    def due(self, *, is_engaged: bool) -> float:
        """When to send the next one, if nothing else goes out [s]."""
        if not is_engaged:
            return min(self._reported_at + REPORT_INTERVAL, self._sent[-1] + self._interval)
        if self._due_engaged is None:  # asked several times a tick, and changed by a datagram only
            self._due_engaged = self._find_due()
        return self._due_engaged

    def _find_due(self) -> float:
        sent = self._sent
        due = min(self._reported_at + REPORT_INTERVAL, sent[-1] + self._interval, self._ask_due())
        if self._answer_wanted:
            due = sent[-1]
        if self._introductions:
            due = min(due, self._reported_at + INTRODUCTION_INTERVAL)
        for least, window, gap in self._demands:
            needed = min(sent[-least] + window, sent[-1] + gap)
            due = min(due, max(needed, sent[-1] + SHORTEST_INTERVAL))
        return due
