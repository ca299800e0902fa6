"""What a record says of the link: the part that both sides fill in alike, read off an endpoint's statistics."""

from math import nan
from typing import Protocol


class LinkStatistics(Protocol):
    """The counters and measurements that are recorded; times in seconds, None while unknown.

    Updates are counted by stream: the first is what `counters` speaks of, the second is the rotation.
    """

    sent: int
    received: int
    lost: int
    bytes_sent: int
    updates_sent: list[int]
    updates_received: list[int]
    repeats: int
    heartbeats: int
    drops: int
    rtt: float | None
    one_way: float | None


COUNTERS = (
    "datagrams_sent",
    "datagrams_received",
    "datagrams_lost",
    "datagrams_dropped",
    "bytes_sent",
    "updates_sent",
    "updates_received",
    "repeats",
    "heartbeats",
)
"""Fields of a record that `counters` fills in, in this order."""


def counters(statistics: LinkStatistics) -> tuple[int, ...]:
    """The values of `COUNTERS`; a plain tuple, since it is made in every tick."""
    return (
        statistics.sent,
        statistics.received,
        statistics.lost,
        statistics.drops,
        statistics.bytes_sent,
        statistics.updates_sent[0],
        statistics.updates_received[0],
        statistics.repeats,
        statistics.heartbeats,
    )


def delays(statistics: LinkStatistics) -> tuple[float, float]:
    """Round trip and one way of a record [us]; NaN while unknown."""
    rtt, one_way = statistics.rtt, statistics.one_way
    return (nan if rtt is None else rtt * 1e6, nan if one_way is None else one_way * 1e6)
