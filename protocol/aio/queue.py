"""Read the datagrams of one socket in bounded processor time, however many arrive.

While the budget is used up, the event loop is not woken for this socket: datagrams wait in the kernel, and are dropped
there when its buffer is full.
"""

import asyncio
import select
import socket
import sys
from collections.abc import Callable
from math import inf
from typing import Any, Final

from weberlink.protocol.aio.address import address_of
from weberlink.protocol.events import Address
from weberlink.protocol.wire import LONGEST_DATAGRAM

SLICE_S: Final = 2e-4
"""Longest time spent on datagrams before the event loop does other work [s]; a single datagram may take longer."""
MOST_S: Final = 2e-3
"""Largest balance of the budget [s], for the datagrams of a peer that wait after a stall."""
SAMPLE_S: Final = 1.0
"""Time between two looks at the class of service with which datagrams arrive [s]."""
_LONGEST_READ: Final = LONGEST_DATAGRAM + 5
"""More than the longest datagram in the header of a relay [bytes]."""
_ANCILLARY_BYTES: Final = socket.CMSG_SPACE(4)
_PKTINFO: Final = 8
"""IP_PKTINFO of <netinet/in.h>, which Python 3.11 does not name."""
_PKTINFO_BYTES: Final = 20

Take = Callable[[bytes, Address, float], None]


class WorkBudget:
    """Processor time that may be spent: a share of the time that passes, saved up to a limit (token bucket).

    It counts time and not datagrams, because a datagram of the peer costs several times as much as a foreign one. The
    debt is bounded too: otherwise, after a stall, the peer would not be heard for several times as long as it lasted.

    Args:
        share: of one processor, in (0, 1].
        most: largest balance, and largest debt [s].
        now: [s].
    """

    def __init__(self, share: float, most: float, now: float) -> None:
        self._share = share
        self._most = most
        self._left = most
        self._updated_at = now

    def left(self, now: float) -> float:
        """Balance [s]; negative after a piece of work that took longer than was left."""
        self._left = min(self._most, self._left + self._share * max(0.0, now - self._updated_at))
        self._updated_at = now
        return self._left

    def spend(self, seconds: float, now: float) -> None:
        """Subtract a piece of work that ended now [s]."""
        self._left = max(self.left(now) - seconds, -self._most)

    def limit(self, share: float) -> None:
        """Change the share from now on."""
        self._share = share

    def wait(self) -> float:
        """Time until the balance is positive [s]."""
        return max(0.0, -self._left / self._share)


class ReceiveQueue:
    """Reads one socket.

    Attributes:
        socket: non-blocking and bound; closed with the queue.
        is_open: False once `close` was called.
        called: sender of the newest datagram, and ancillary data with which an answer leaves from the address that was
            called; None where the socket has one address alone.
    """

    def __init__(
        self,
        bound: socket.socket,
        *,
        loop: asyncio.AbstractEventLoop,
        now: Callable[[], float],
        take: Take,
        on_datagrams: Callable[[], None],
        share: float,
        on_dscp: Callable[[int], None] | None = None,
    ) -> None:
        """Listen.

        Args:
            now: the clock of the owner [s].
            take: receives each datagram, its sender and the time.
            on_datagrams: called after the loop was woken by the socket and datagrams were taken.
            share: of a processor that reading may cost, in (0, 1].
            on_dscp: told now and then with which class of service datagrams arrive (RFC 2474).
        """
        self.socket = bound
        self.is_open = True
        self._loop = loop
        self._now = now
        self._take = take
        self._on_datagrams = on_datagrams
        self._budget = WorkBudget(share, MOST_S, now())
        self._resume: asyncio.TimerHandle | None = None
        self._receive: Callable[[int], tuple[bytes, Any]] = bound.recvfrom
        self.called: tuple[Address, list[tuple[int, int, bytes]]] | None = None
        self._on_dscp = on_dscp
        self._sample_at = inf
        if on_dscp is None and _ask_for_destination(bound):
            self._receive = self._receive_called
        if on_dscp is not None and _ask_for_class(bound):
            self._sample_at = -inf
        waiting = select.poll()
        waiting.register(bound.fileno(), select.POLLIN)
        self._waiting = waiting.poll
        # That of uvloop returns None and not the bool of its type, which compiled code would check.
        self._forget: Callable[[int], object] = loop.remove_reader
        loop.add_reader(bound.fileno(), self._on_readable)

    def limit(self, share: float) -> None:
        """Change the share of a processor."""
        self._budget.limit(share)

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
            try:
                data, source = self._receive(_LONGEST_READ)
            except BlockingIOError:
                break
            except OSError:  # such as an ICMP error of an earlier send: it costs time as a datagram does
                pass
            if began == -inf:
                began = now = self._now()
            if source is not None:
                found = True
                self._take(data, address_of(source), now)
            now = self._now()
            if now - began > SLICE_S or not (self.is_open and self._waiting(0)):
                break
        if began == -inf:
            return False
        self._budget.spend(now - began, now)
        if now >= self._sample_at:
            self._receive = self._sample
        if self.is_open and self._budget.left(now) < 0.0:
            self._pause()
        return found

    def _sample(self, longest: int) -> tuple[bytes, Any]:
        """Receive one datagram, and look at its class of service."""
        data, ancillary, _, source = self.socket.recvmsg(longest, _ANCILLARY_BYTES)
        self._receive, self._sample_at = self.socket.recvfrom, self._now() + SAMPLE_S
        for _level, _kind, value in ancillary:  # IPv4 gives one octet, IPv6 an integer
            if self._on_dscp is not None:
                self._on_dscp(int.from_bytes(value, sys.byteorder) >> 2)
        return data, source

    def _receive_called(self, longest: int) -> tuple[bytes, Any]:
        """Receive one datagram, and note which address it called."""
        data, ancillary, _, source = self.socket.recvmsg(longest, socket.CMSG_SPACE(_PKTINFO_BYTES))
        for level, kind, value in ancillary:  # the interface is left to the system: 4 bytes before, behind in IPv6
            own = value[:16] + bytes(4) if level == socket.IPPROTO_IPV6 else bytes(4) + value[4:]
            self.called = address_of(source), [(level, kind, own)]
        return data, source

    def _pause(self) -> None:
        self._forget(self.socket.fileno())
        self._resume = self._loop.call_later(self._budget.wait(), self._go_on)

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


def called_address(ancillary: list[tuple[int, int, bytes]]) -> str:
    """The address of this host that was called."""
    ((level, _, value),) = ancillary
    is_ipv6 = level == socket.IPPROTO_IPV6
    return socket.inet_ntop(socket.AF_INET6 if is_ipv6 else socket.AF_INET, value[:16] if is_ipv6 else value[8:12])


def _ask_for_class(bound: socket.socket) -> bool:
    """Have the class of service delivered with each datagram; whether the system does."""
    is_ipv6 = bound.family == socket.AF_INET6
    try:
        if is_ipv6:
            bound.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_RECVTCLASS, 1)
        else:
            bound.setsockopt(socket.IPPROTO_IP, socket.IP_RECVTOS, 1)
    except OSError:
        return False
    return True


def _ask_for_destination(bound: socket.socket) -> bool:
    """Have the called address delivered with each datagram, if the socket is bound to all; whether the system does."""
    if bound.getsockname()[0] not in ("0.0.0.0", "::"):  # noqa: S104 - asks
        return False
    is_ipv6 = bound.family == socket.AF_INET6
    level, option = (socket.IPPROTO_IPV6, socket.IPV6_RECVPKTINFO) if is_ipv6 else (socket.IPPROTO_IP, _PKTINFO)
    try:
        bound.setsockopt(level, option, 1)
    except OSError:
        return False
    return True
