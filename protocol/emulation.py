"""Emulate a faulty link, seeded: delay, jitter, loss, reordering, duplicates, bit errors, a rate limit, blackouts.

The same object serves virtual time and real sockets; random numbers are passed in.
"""

from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from math import inf
from typing import Generic, TypeVar

from weberlink.compiled import mypyc_attr

T = TypeVar("T")

REORDER_HOLD = 0.005  # how long a reordered datagram is held back, so that those behind it overtake [s]
QUEUE_S = 0.25  # a rate-limited link drops what would wait longer than this [s]
HEADER_BYTES = 28  # IPv4 and UDP headers, which count towards the rate
CAPACITY = 16_384  # datagrams under way; more are dropped


@dataclass(frozen=True, slots=True)
class Emulation:
    """Faults of a link; their ranges are those of `link.emulate` in a configuration, which validates them.

    Args:
        delay_s: least one-way delay [s].
        jitter_s: extra delay, uniform in [0, jitter_s]; as in a queue, it does not reorder [s].
        loss: share of datagrams lost, 0..1.
        burst: mean length of a run of losses; 1 for independent losses, more for a Gilbert-Elliott channel whose good
            state loses nothing and whose bad state loses everything.
        reorder: probability that a datagram is held back by `REORDER_HOLD`.
        duplicate: probability that it arrives twice.
        corrupt: probability that one of its bits is flipped.
        rate_bit_s: capacity, headers included; None for no limit [bit/s].
        blackouts: (start, duration) of times when nothing gets through, from the epoch of the link [s]; with a third
            number, (start, duration, period), repeated with that period: a link that flaps.
    """

    delay_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    burst: float = 1.0
    reorder: float = 0.0
    duplicate: float = 0.0
    corrupt: float = 0.0
    rate_bit_s: float | None = None
    blackouts: tuple[tuple[float, float] | tuple[float, float, float], ...] = ()


@mypyc_attr(allow_interpreted_subclasses=True)
class EmulatedLink(Generic[T]):
    """One direction of a faulty link; `T` is what the owner gets back with a datagram, such as an address."""

    def __init__(self, emulation: Emulation, uniform: Callable[[], float], epoch: float = 0.0) -> None:
        """`uniform` gives random numbers in [0, 1), from a seeded generator; blackouts count from the `epoch` [s]."""
        self._emulation = emulation
        self._uniform = uniform
        self._epoch = epoch
        self._flights: list[tuple[float, int, bytes, T]] = []
        self._numbers = count()
        self._in_burst = False
        self._last_due = -inf
        self._busy_until = -inf

    def change(self, emulation: Emulation) -> None:
        """Apply other faults to what is sent from now on. What is under way arrives as before, and is not overtaken."""
        self._emulation = emulation
        self._in_burst = self._in_burst and emulation.loss > 0.0

    def send(self, data: bytes, tag: T, now: float) -> None:
        since = now - self._epoch
        if self._is_lost() or any(
            since >= start and (since - start) % (period[0] if period else inf) < duration
            for start, duration, *period in self._emulation.blackouts
        ):
            return
        due = self._due(len(data), now)
        if due is None:
            return
        if self._happens(self._emulation.corrupt):
            bit = int(self._uniform() * 8 * len(data))
            flipped = bytearray(data)
            flipped[bit // 8] ^= 1 << bit % 8
            data = bytes(flipped)
        for _ in range(2 if self._happens(self._emulation.duplicate) else 1):
            heappush(self._flights, (due, next(self._numbers), data, tag))

    def receive(self, now: float) -> list[tuple[bytes, T]]:
        """Take the datagrams that have arrived by now, in order of arrival."""
        arrived = []
        while self._flights and self._flights[0][0] <= now:
            _, _, data, tag = heappop(self._flights)
            arrived.append((data, tag))
        return arrived

    def next_due(self) -> float | None:
        """Arrival of the next datagram [s]; None if none is under way."""
        return self._flights[0][0] if self._flights else None

    def _happens(self, probability: float) -> bool:
        return probability > 0.0 and self._uniform() < probability

    def _is_lost(self) -> bool:
        loss, burst = self._emulation.loss, self._emulation.burst
        if burst == 1.0 or loss in (0.0, 1.0):
            return self._happens(loss)
        # Leaving the bad state with 1 / burst makes runs of that mean length; entering it with the rate below makes
        # the share of time in it equal to the loss (Gilbert 1960).
        change = 1.0 / burst if self._in_burst else loss / (burst * (1.0 - loss))
        if self._happens(change):
            self._in_burst = not self._in_burst
        return self._in_burst

    def _due(self, size: int, now: float) -> float | None:
        """When a datagram that is sent now arrives [s]; None if the queue of the link is full."""
        emulation, due = self._emulation, now
        if len(self._flights) >= CAPACITY:
            return None
        if emulation.rate_bit_s is not None:
            begin = max(now, self._busy_until)
            if begin - now > QUEUE_S:
                return None
            due = self._busy_until = begin + 8.0 * (size + HEADER_BYTES) / emulation.rate_bit_s
        due += emulation.delay_s
        if emulation.jitter_s > 0.0:
            due += emulation.jitter_s * self._uniform()
        due = max(due, self._last_due)
        if self._happens(emulation.reorder):
            return due + REORDER_HOLD
        self._last_due = due
        return due
