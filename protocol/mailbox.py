"""What waits between an endpoint and its owner: datagrams to send, and events. Bounded, and counted."""

from collections import deque

from weberlink.protocol.events import Address, DatagramDropped, Event
from weberlink.protocol.reasons import DropReason
from weberlink.protocol.statistics import Statistics

QUEUED_DATAGRAMS = 64
QUEUED_EVENTS = 256


class Mailbox:
    """Two queues that lose their oldest entries when the owner does not come."""

    __slots__ = ("_datagrams", "_events", "_statistics")

    def __init__(self, statistics: Statistics) -> None:
        self._statistics = statistics
        self._datagrams: deque[tuple[bytes, Address]] = deque()
        self._events: deque[Event] = deque()

    def post(self, datagram: bytes, address: Address) -> None:
        """Queue a datagram to be sent."""
        if len(self._datagrams) >= QUEUED_DATAGRAMS:
            self._datagrams.popleft()
            self._statistics.overflowed += 1
        self._datagrams.append((datagram, address))
        self._statistics.sent += 1
        self._statistics.bytes_sent += len(datagram)

    def tell(self, event: Event) -> None:
        """Queue an event."""
        if len(self._events) >= QUEUED_EVENTS:
            self._events.popleft()
        self._events.append(event)

    def count(self, data: bytes) -> None:
        """Count a datagram that proved authentic."""
        self._statistics.received += 1
        self._statistics.bytes_received += len(data)

    def drop(self, reason: DropReason) -> None:
        """Count a datagram of no use; a flood of them gets half the queue, so that it pushes out nothing else."""
        self._statistics.dropped[reason] += 1
        self._statistics.drops += 1
        if len(self._events) < QUEUED_EVENTS // 2:
            self._events.append(DatagramDropped(reason))

    def datagrams(self) -> list[tuple[bytes, Address]]:
        """All datagrams, oldest first; the queue is empty then."""
        if not self._datagrams:
            return []
        datagrams = list(self._datagrams)
        self._datagrams.clear()
        return datagrams

    def next_event(self) -> Event | None:
        """The oldest event, or None."""
        return self._events.popleft() if self._events else None
