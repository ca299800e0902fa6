"""Bounded queues between an endpoint and its owner, and the counters of both."""

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Final

from weberlink.protocol.events import Address, Connected, DatagramDropped, DropReason, Event
from weberlink.protocol.wire import UPDATE_KINDS

QUEUED_DATAGRAMS: Final = 64
QUEUED_EVENTS: Final = 256


@dataclass(slots=True)
class Statistics:
    """Cumulative counters over all sessions of an endpoint, and the current measurements of the link.

    `sent` and `bytes_sent` count every datagram (UDP payload); `received` counts authentic ones. An update that was
    sent again counts under `repeats`, not under `updates_sent`.
    """

    sent: int = 0
    bytes_sent: int = 0
    received: int = 0
    bytes_received: int = 0
    updates_sent: list[int] = field(default_factory=lambda: [0] * len(UPDATE_KINDS))
    """By stream."""
    updates_received: list[int] = field(default_factory=lambda: [0] * len(UPDATE_KINDS))
    """By stream."""
    repeats: int = 0
    heartbeats: int = 0
    lost: int = 0
    """Datagrams of the peer that never came, from gaps in its sequence numbers."""
    copies: int = 0
    """Datagrams of the peer that had come by another of several paths already; neither received nor dropped."""
    overflowed: int = 0
    """Datagrams of ours that the owner did not fetch in time."""
    dropped: Counter[DropReason] = field(default_factory=Counter)
    """Datagrams received and dropped, by reason; `drops` is their sum."""
    drops: int = 0
    rtt: float | None = None
    """Round trip of the newest datagrams of the two directions [s]."""
    one_way: float | None = None
    """Delay of the newest datagram of the peer [s]."""
    incoming_loss: float = 0.0
    """Recent loss of the peer's datagrams, 0..1."""
    outgoing_loss: float = 0.0
    """Recent loss of our datagrams, as the peer measured it, 0..1."""
    incoming_burst: float = 0.0
    """Mean length of the recent runs of lost datagrams of the peer; 0 while fewer than three are known."""
    outgoing_burst: float = 0.0
    """The same of our datagrams, as the peer measured it."""


class Mailbox:
    """Datagrams to send, and events of one session at most; a full queue drops its oldest entry."""

    def __init__(self, statistics: Statistics) -> None:
        self._statistics = statistics
        self._datagrams: list[tuple[bytes, Address]] = []
        self._events: deque[Event] = deque()

    def post(self, datagram: bytes, address: Address) -> None:
        """Queue a datagram to be sent."""
        if len(self._datagrams) >= QUEUED_DATAGRAMS:
            del self._datagrams[0]
            self._statistics.overflowed += 1
        self._datagrams.append((datagram, address))
        self._statistics.sent += 1
        self._statistics.bytes_sent += len(datagram)

    def begin(self, event: Connected) -> None:
        """Begin a session: what has not been read of the one before is void."""
        self._events.clear()
        self._events.append(event)

    def tell(self, event: Event) -> None:
        """Queue an event."""
        if len(self._events) >= QUEUED_EVENTS:
            self._events.popleft()
        self._events.append(event)

    def count(self, data: bytes) -> None:
        """Count an authentic datagram."""
        self._statistics.received += 1
        self._statistics.bytes_received += len(data)

    def drop(self, reason: DropReason) -> None:
        """Count a dropped datagram; a flood of them fills half the queue at most, so other events are not lost."""
        self._statistics.dropped[reason] += 1
        self._statistics.drops += 1
        if len(self._events) < QUEUED_EVENTS // 2:
            self._events.append(DatagramDropped(reason))

    def datagrams(self) -> list[tuple[bytes, Address]]:
        """Take all datagrams, oldest first."""
        datagrams, self._datagrams = self._datagrams, []
        return datagrams

    def next_event(self) -> Event | None:
        """Take the oldest event; None if there is none."""
        return self._events.popleft() if self._events else None
