"""What a record says of the link: the part that both sides fill in alike, read off an endpoint's statistics."""

from collections.abc import Mapping
from math import nan
from typing import Any, NamedTuple, Protocol


class LinkStatistics(Protocol):
    """The counters and measurements that are recorded; times in seconds, None while unknown."""

    sent: int
    received: int
    lost: int
    bytes_sent: int
    updates_sent: int
    updates_received: int
    repeats: int
    heartbeats: int
    rtt: float | None
    one_way: float | None

    @property
    def dropped(self) -> Mapping[Any, int]:
        """Received and refused, by reason."""
        ...


class Counters(NamedTuple):
    """The counters of a record, in its order."""

    datagrams_sent: int
    datagrams_received: int
    datagrams_lost: int
    datagrams_dropped: int
    bytes_sent: int
    updates_sent: int
    updates_received: int
    repeats: int
    heartbeats: int


class Delays(NamedTuple):
    """The delays of a record, in its order; NaN while unknown."""

    rtt_us: float
    one_way_us: float


def counters(statistics: LinkStatistics) -> Counters:
    return Counters(
        statistics.sent,
        statistics.received,
        statistics.lost,
        sum(statistics.dropped.values()),
        statistics.bytes_sent,
        statistics.updates_sent,
        statistics.updates_received,
        statistics.repeats,
        statistics.heartbeats,
    )


def delays(statistics: LinkStatistics) -> Delays:
    rtt, one_way = statistics.rtt, statistics.one_way
    return Delays(nan if rtt is None else rtt * 1e6, nan if one_way is None else one_way * 1e6)
