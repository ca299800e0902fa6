"""Read the datagrams of one socket in bounded processor time, however many arrive.

While the budget is used up, the event loop is not woken for this socket: datagrams wait in the kernel, and are dropped
there when its buffer is full.
"""

import asyncio
import select
import socket
from collections.abc import Callable
from math import inf
from typing import Any, Final

from weberlink.protocol.aio.sockets import ANCILLARY_BYTES, Ancillary, address_of
from weberlink.protocol.events import Address
from weberlink.protocol.wire import LONGEST_DATAGRAM

SLICE_S: Final = 2e-4
"""Longest time spent on datagrams before the event loop does other work [s]; a single datagram may take longer."""
MOST_S: Final = 2e-3
"""Largest balance of the budget [s], for the datagrams of a peer that wait after a stall."""
_LONGEST_READ: Final = LONGEST_DATAGRAM + 5
"""More than the longest datagram in the header of a relay [bytes]."""


class WorkBudget:
    """Processor time that may be spent: a share of the time that passes, saved up to a limit (token bucket).

    It counts time and not datagrams, because a datagram of the peer costs several times as much as a foreign one. The
    debt is bounded too: otherwise, after a stall, the peer would not be heard for several times as long as it lasted.
    """

    def __init__(self, share: float, most: float, now: float) -> None:
        self.share = share
        self._most = most
        self._left = most
        self._updated_at = now

    def left(self, now: float) -> float:
        """Balance [s]; negative after a piece of work that took longer than was left."""
        self._left = min(self._most, self._left + self.share * max(0.0, now - self._updated_at))
        self._updated_at = now
        return self._left

    def spend(self, seconds: float, now: float) -> None:
        """Subtract a piece of work that ended now [s]."""
        self._left = max(self.left(now) - seconds, -self._most)

    def wait(self) -> float:
        """Time until the balance is positive [s]."""
        return max(0.0, -self._left / self.share)


class ReceiveQueue:
    """Reads one socket, which does not block and is closed with the queue."""

    def __init__(
        self,
        bound: socket.socket,
        *,
        loop: asyncio.AbstractEventLoop,
        now: Callable[[], float],
        take: Callable[[bytes, Address, float], None],
        on_datagrams: Callable[[], None],
        share: float,
        on_ancillary: Callable[[Address, Ancillary], None] | None = None,
        look_every: float = 0.0,
    ) -> None:
        """Listen.

        Args:
            on_datagrams: called after the loop was woken by the socket and datagrams were taken.
            share: of a processor that reading may cost, in (0, 1].
            on_ancillary: told what the system gives beside a datagram, at most once in `look_every` [s].
        """
        self.socket = bound
        self.is_open = True
        self.budget = WorkBudget(share, MOST_S, now())
        self._loop = loop
        self._now = now
        self._take = take
        self._on_datagrams = on_datagrams
        self._on_ancillary = on_ancillary
        self._look_every = look_every
        self._look_at = -inf
        self._resume: asyncio.TimerHandle | None = None
        waiting = select.poll()
        waiting.register(bound.fileno(), select.POLLIN)
        self._waiting = waiting.poll
        # That of uvloop returns None and not the bool of its type, which compiled code would check.
        self._forget: Callable[[int], object] = loop.remove_reader
        loop.add_reader(bound.fileno(), self._on_readable)

    def read(self) -> bool:
        """Take the datagrams that wait, within the budget; returns whether there were any."""
        # To ask first costs a third of a read that finds nothing and raises an exception.
        if self._resume is not None or not self._waiting(0):
            return False
        return self._drain()

    def _drain(self) -> bool:
        """Take datagrams until none are left or a slice is over; returns whether there were any."""
        began = now = -inf
        found, data = False, b""
        while self.is_open:
            source: Any = None
            ancillary: Any = None
            try:
                data, ancillary, _, source = self.socket.recvmsg(_LONGEST_READ, ANCILLARY_BYTES)
            except BlockingIOError:
                break
            except OSError:  # such as an ICMP error of an earlier send: it costs time as a datagram does
                pass
            if began == -inf:
                began = now = self._now()
            if source is not None:
                found = True
                if ancillary and now >= self._look_at and self._on_ancillary is not None:
                    self._look_at = now + self._look_every
                    self._on_ancillary(address_of(source), ancillary)
                self._take(data, address_of(source), now)
            now = self._now()
            if now - began > SLICE_S or not (self.is_open and self._waiting(0)):
                break
        if began == -inf:
            return False
        self.budget.spend(now - began, now)
        if self.is_open and self.budget.left(now) < 0.0:
            self._forget(self.socket.fileno())
            self._resume = self._loop.call_later(self.budget.wait(), self._go_on)
        return found

    def _go_on(self) -> None:
        self._resume = None
        self._loop.add_reader(self.socket.fileno(), self._on_readable)

    def _on_readable(self) -> None:
        if self._resume is None and self._drain():
            self._on_datagrams()

    def close(self) -> None:
        """Stop listening and release the socket; may be repeated, also from within `take`."""
        if self._resume is not None:
            self._resume.cancel()
            self._resume = None
        if not self.is_open:
            return
        self.is_open = False
        if not self._loop.is_closed():
            self._forget(self.socket.fileno())
        self.socket.close()
