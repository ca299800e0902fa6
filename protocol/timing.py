"""Map the clocks of the two ends to each other, from the time stamps of the datagrams.

Each end sees raw delays: arrival on its own clock minus departure on the other's. With o = peer's clock minus ours,

    inward = delay_in - o        outward = delay_out + o (measured by the peer, reported in its heartbeats)

so their sum is the round trip, and half their difference is the offset if the fastest datagrams of both directions
took equally long (the assumption of NTP, RFC 5905, section 8; an asymmetric path shifts it by half the asymmetry).
Queues only ever add delay, hence minima; they are taken over a sliding window, so that drifting clocks are followed: an
error of at most half the window times the drift, 0.1 ms at 50 ppm.

Clocks count seconds since the epoch of their owner.
"""

from math import floor, inf
from typing import Final

from weberlink.protocol.counters import expand

WINDOW: Final = 4.0  # length of the minimum filter [s]
_BUCKETS: Final = 8
_BUCKET: Final = WINDOW / _BUCKETS
STAMP_BITS: Final = 23
STAMP_UNIT: Final = 1e-5  # resolution of the time stamps [s]; 23 bits of it wrap every 84 s
_STAMP_MASK: Final = (1 << STAMP_BITS) - 1
_STAMPS_PER_S: Final = 1e5

EARLY_LIMIT: Final = 0.05  # a datagram that seems to arrive this much before it left is rejected [s]
_EARLY_LIMIT_UNMAPPED: Final = 5.0
LONGEST_RTT: Final = 60.0
_LEAST_RTT: Final = -0.001  # clocks drift between two reports, and stamps are cut off


class SlidingMinimum:
    """Minimum over the last `WINDOW` seconds, in steps of an eighth of it; constant work for each sample."""

    def __init__(self) -> None:
        self._minima = [inf] * _BUCKETS
        self._bucket = 0
        self._newest_at = -inf
        self.value = inf

    def is_expired(self, now: float) -> bool:
        return now - self._newest_at > WINDOW

    def record(self, sample: float, now: float) -> None:
        bucket = int(now // _BUCKET)
        if bucket != self._bucket:
            for passed in range(min(max(bucket - self._bucket, 0), _BUCKETS)):
                self._minima[(bucket - passed) % _BUCKETS] = inf
            self._bucket = bucket
            self.value = min(self._minima)
        index = bucket % _BUCKETS
        if sample < self._minima[index]:
            self._minima[index] = sample
            self.value = sample if sample < self.value else self.value
        self._newest_at = now


class Clock:
    """Our clock, and the mapping to the peer's. Of a direction that was not measured yet, times are None.

    Attributes:
        outgoing_jitter: by how much few of our datagrams exceed their least delay, as the peer measured it [s].
        incoming_jitter: the same of the peer's datagrams [s].
        jitter: the larger one of the two [s].
        rtt: round trip of the latest datagrams of the two directions [s].
        one_way: delay of the latest datagram of the peer [s], not negative.
    """

    def __init__(self, epoch: float, peer_clock: float, now: float) -> None:
        """Start from a first datagram whose departure on the peer's clock is known in full; `epoch` is our clock's 0
        [s]."""
        self._epoch = epoch
        self._inward = SlidingMinimum()
        self._excess = 0.0
        self._variation = 0.0
        self._latest = 0.0
        self._outward: float | None = None
        self._outward_latest = 0.0
        self._offset: float | None = None
        self._early_limit = _EARLY_LIMIT_UNMAPPED
        self.outgoing_jitter = self.incoming_jitter = self.jitter = 0.0
        self.rtt: float | None = None
        self.one_way: float | None = None
        self.record(peer_clock, now)

    def stamp(self, now: float) -> tuple[int, float]:
        """Time stamp of a datagram that leaves now, and our clock [s] as the peer reads it from that."""
        units = floor((now - self._epoch) * _STAMPS_PER_S)
        return units & _STAMP_MASK, units * STAMP_UNIT

    def departure(self, stamp: int, now: float) -> float | None:
        """Time on the peer's clock [s] of a stamp that has just arrived; None if a datagram cannot have left then, much
        later than it arrived.

        The true delay is at least 0, and the offset is wrong by at most half the least round trip. After a whole window
        without a plausible datagram any stamp is accepted: then a clock was stepped, not a datagram damaged."""
        arrived, inward = now - self._epoch, self._inward
        departure = expand(stamp, STAMP_BITS, int((arrived - inward.value) * _STAMPS_PER_S)) * STAMP_UNIT
        early = inward.value - (arrived - departure)
        return departure if early <= self._early_limit or inward.is_expired(now) else None

    def record(self, departure: float, now: float) -> None:
        """Update the mapping with the raw delay of a plausible datagram."""
        delay = now - self._epoch - departure
        inward = self._inward
        before = inward.value
        inward.record(delay, now)
        self._latest = delay
        minimum = inward.value
        excess = delay - minimum
        # The shape of RFC 6298: mean plus four mean deviations is a bound that few datagrams exceed.
        self._variation += (abs(excess - self._excess) - self._variation) / 16
        self._excess += (excess - self._excess) / 16
        self.incoming_jitter = (self._excess if self._excess > 0.0 else 0.0) + 4.0 * self._variation
        if minimum != before:
            self._map()
        self._measure()

    def report(self) -> tuple[float, float, float]:
        """Raw delays for the peer [s]: the least, and above it the latest and a bound that few datagrams exceed."""
        minimum = self._inward.value
        return minimum, self._latest - minimum, self.incoming_jitter

    def learn(self, minimum: float, latest: float, late: float) -> float | None:
        """Take the peer's report; returns the round trip that few datagrams of the two directions together exceed [s],
        or None, with nothing changed, if no real link can cause it."""
        least_rtt = self._inward.value + minimum
        if not _LEAST_RTT - EARLY_LIMIT <= least_rtt <= LONGEST_RTT:
            return None
        self._outward = minimum
        self._outward_latest = latest
        self.outgoing_jitter = min(late, LONGEST_RTT)
        self._map()
        self._measure()
        return max(0.0, least_rtt) + self.outgoing_jitter + self.incoming_jitter

    def peer_time(self, now: float) -> float | None:
        """The peer's clock now [s]; None until both directions are measured."""
        return None if self._offset is None else now - self._epoch + self._offset

    def latest_receivable_peer_time(self, now: float) -> float | None:
        """The peer's clock at the departure of a datagram that arrives now with the least delay [s]; None likewise."""
        return None if self._offset is None else now - self._epoch - self._inward.value

    def arrival_bound(self, sent_at: float) -> float | None:
        """Time on the peer's clock [s] by which nearly every datagram that we sent at `sent_at` [s] has arrived."""
        return None if self._outward is None else sent_at - self._epoch + self._outward + self.outgoing_jitter

    def _map(self) -> None:
        if self._outward is None:
            return
        inward = self._inward.value
        least_rtt = inward + self._outward
        if _LEAST_RTT - EARLY_LIMIT <= least_rtt <= LONGEST_RTT:
            self._offset = 0.5 * (self._outward - inward)
            self._early_limit = EARLY_LIMIT + max(0.0, least_rtt)
        else:  # two reports on either side of a stepped clock: no mapping until they agree again
            self._offset = None
            self._early_limit = _EARLY_LIMIT_UNMAPPED

    def _measure(self) -> None:
        """Compute what is read in every tick and changes with a datagram only."""
        incoming, outgoing = self.incoming_jitter, self.outgoing_jitter
        self.jitter = outgoing if outgoing > incoming else incoming
        if self._outward is None:
            self.rtt = None
        else:
            self.rtt = max(0.0, self._latest + self._outward + self._outward_latest)
        self.one_way = None if self._offset is None else max(0.0, self._latest + self._offset)
