"""When a heartbeat is due. Knows no bytes, no peer's clock and no state of the endpoint.

Any datagram shows that we are there, so heartbeats fill the gaps between updates; what only a heartbeat carries goes
out once a second all the same.
"""

from math import inf

from protocol.loss import CLEAN_INTERVAL, heartbeat_interval

INTRODUCTIONS = 5
INTRODUCTION_INTERVAL = 0.02
"""Pace of heartbeats until the peer was heard and as many again were sent, updates or not [s]: it can date none of our
updates before one of our reports."""
REPORT_INTERVAL = 1.0
"""A heartbeat goes out at least this often, however many updates do [s]."""


class HeartbeatSchedule:
    """The times of one direction's heartbeats."""

    __slots__ = (
        "_acknowledge_by",
        "_interval",
        "_introductions",
        "_reported_at",
        "_sent_at",
        "_tick_period",
        "_window",
    )

    def __init__(self, now: float, window: float, tick_period: float) -> None:
        """Begin with one that is due.

        Args:
            window: silence that must not come about by chance [s].
            tick_period: how late a heartbeat may be sent [s].
        """
        self._window = window
        self._tick_period = tick_period
        self._introductions = INTRODUCTIONS
        self._acknowledge_by = inf
        self._sent_at = self._reported_at = now - REPORT_INTERVAL
        self._interval = CLEAN_INTERVAL
        self.adapt(0.0)

    def adapt(self, loss: float) -> None:
        """Take the loss that the peer has measured."""
        self._interval = heartbeat_interval(loss, self._window, self._tick_period)

    def sent(self, now: float) -> None:
        """A datagram of any kind went out; it acknowledges what there is to be acknowledged."""
        self._sent_at = now
        self._acknowledge_by = inf

    def reported(self, now: float, *, is_confirmed: bool) -> None:
        """That datagram was a heartbeat; `is_confirmed`: the peer was heard under these keys."""
        self._reported_at = now
        self._introductions -= is_confirmed and self._introductions > 0

    def acknowledge_by(self, deadline: float) -> None:
        """Something came that is to be acknowledged by then [s]."""
        self._acknowledge_by = min(self._acknowledge_by, deadline)

    def due(self, *, is_engaged: bool) -> float:
        """When to send the next one, if nothing else goes out [s]."""
        due = self._reported_at + REPORT_INTERVAL
        if not is_engaged:
            return min(due, self._sent_at + CLEAN_INTERVAL)
        due = min(due, self._sent_at + self._interval, self._acknowledge_by)
        return min(due, self._reported_at + INTRODUCTION_INTERVAL) if self._introductions else due
