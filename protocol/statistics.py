"""What an endpoint has counted and measured since it was made, over all its sessions."""

from collections import Counter
from dataclasses import dataclass, field

from weberlink.protocol.reasons import DropReason
from weberlink.protocol.wire import UPDATE_KINDS


@dataclass(slots=True)
class Statistics:
    """Cumulative counters, and the current measurements of the link.

    `sent` and `bytes_sent` count every datagram (UDP payload); `received` those that proved authentic. An update that
    was sent again counts under `repeats`, not under `updates_sent`.
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
    overflowed: int = 0
    """Datagrams of ours that the owner did not fetch in time."""
    dropped: Counter[DropReason] = field(default_factory=Counter)
    """Received and refused, by reason; `drops` is their sum."""
    drops: int = 0
    rtt: float | None = None
    """Round trip of the newest datagrams of the two directions [s]."""
    one_way: float | None = None
    """Delay of the newest datagram of the peer [s]."""
    incoming_loss: float = 0.0
    """Recent loss of the peer's datagrams, 0..1."""
    outgoing_loss: float = 0.0
    """Recent loss of our datagrams, as the peer measured it, 0..1."""
