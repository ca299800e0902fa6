"""UDP sockets: their addresses and options, as the system takes them, and reading them in bounded processor time.

While the budget of a socket is used up, the event loop is not woken for it: datagrams wait in the kernel, and are
dropped there when its buffer is full.

An address of an endpoint is a host and a port. The host of a link-local IPv6 address has its zone behind it, as a
number: "fe80::1%2" (RFC 4007 section 11). The same address may be there in every zone, one for each network interface,
and the system takes it with its zone only.
"""

import asyncio
import select
import socket
from collections.abc import Callable
from contextlib import suppress
from errno import EADDRINUSE
from math import inf
from typing import Any, Final

from weberlink.compiled import mypyc_attr
from weberlink.protocol.events import Address
from weberlink.protocol.wire import LONGEST_DATAGRAM

Ancillary = list[tuple[int, int, bytes]]  # level, kind and data of what the system gives or takes beside a datagram
Take = Callable[[bytes, Address, Ancillary, float], None]  # a datagram, its sender, what is beside it, arrival [s]
_NOTHING: Final[Ancillary] = []
ANCILLARY_BYTES: Final = socket.CMSG_SPACE(20)  # enough for a class of service or a called address
ECN_BITS: Final = 2
"""Lowest bits of the type-of-service octet (RFC 3168); the class of service is above them (RFC 2474)."""
SLICE_S: Final = 2e-4
"""Longest time spent on datagrams before the event loop does other work [s]; a single datagram may take longer."""
MOST_S: Final = 2e-3  # largest balance of the budget [s], for the datagrams of a peer that wait after a stall
WAKE_S: Final = 5e-6  # what waking the event loop for a datagram costs beside taking it [s]
CLASS_LOOK_S: Final = 1.0
"""Time between two looks at what the system gives beside the datagrams of a connected socket [s]: a read without it
takes half as long."""
_LONGEST_READ: Final = LONGEST_DATAGRAM + 5  # more than the longest datagram in the header of a relay [bytes]
_PKTINFO: Final = 8  # IP_PKTINFO of <netinet/in.h>, which Python 3.11 does not name


@mypyc_attr(native_class=False)
class AddressInUseError(OSError):
    """Another program holds the UDP port."""


def address_of(name: Any) -> Address:
    """The address of a socket's name, as the system gives it: (host, port), or (host, port, flow, zone) for IPv6."""
    if len(name) == 4 and name[3]:
        return f"{name[0].partition('%')[0]}%{name[3]}", name[1]
    return name[0], name[1]


def name_of(address: Address) -> Any:
    """The name of a socket at an address, as the system takes it."""
    host, percent, zone = address[0].partition("%")
    return (host, address[1], 0, int(zone)) if percent else address


def numeric(address: Address) -> str:
    """An address for people: host:port."""
    host, port = address
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


async def resolve(
    loop: asyncio.AbstractEventLoop, address: Address, family: int, *, passive: bool
) -> tuple[socket.AddressFamily, Address]:
    """The family and the numeric address of a name; `passive` to listen there. OSError if it does not resolve."""
    host, port = address
    flags = socket.AI_PASSIVE if passive else 0
    try:
        try:  # a number needs no look-up: uvloop would start four threads for it, with 32 MB of stacks, and drop a zone
            as_number = flags | socket.AI_NUMERICHOST
            found = socket.getaddrinfo(host or None, port, family, socket.SOCK_DGRAM, flags=as_number)
        except socket.gaierror:
            found = await loop.getaddrinfo(host or None, port, family=family, type=socket.SOCK_DGRAM, flags=flags)
    except socket.gaierror as problem:
        raise OSError(f"{host}:{port} cannot be resolved: {problem.strerror}") from None
    # IPv4 first: a wildcard must take callers of the kind that most configurations name.
    chosen = min(found, key=lambda entry: entry[0] != socket.AF_INET)
    return chosen[0], address_of(chosen[4])


def bind(family: socket.AddressFamily, local: Address) -> socket.socket:
    """A socket at this address of this host; AddressInUseError or OSError says why there is none."""
    bound = socket.socket(family, socket.SOCK_DGRAM)
    try:
        bound.bind(name_of(local))
    except OSError as problem:
        bound.close()
        host, port = local
        if problem.errno != EADDRINUSE:
            raise OSError(problem.errno, f"UDP {host}:{port} cannot be listened on: {problem.strerror}") from None
        raise AddressInUseError(
            EADDRINUSE,
            f"UDP {host}:{port} is in use: stop the program that holds it (ss -lunp shows which), "
            "or choose another port to listen on",
        ) from None
    return bound


def connected_twin(bound: socket.socket, own_host: str, peer: Address) -> socket.socket:
    """A second socket on the port and the network interface of a bound one, connected to a peer; OSError if the system
    refuses it. `own_host` is the address of this host that the peer knows, "" for that of the first socket."""
    twin = socket.socket(bound.family, socket.SOCK_DGRAM)
    try:
        twin.setblocking(False)
        twin.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        interface = bound.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
        if interface.strip(b"\0"):
            twin.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface)
        own = bound.getsockname()
        twin.bind((own_host, *own[1:]) if own_host else own)
        twin.connect(name_of(peer))
    except OSError:
        twin.close()
        raise
    return twin


def set_option(of: socket.socket, ipv4: int, ipv6: int, value: int) -> None:
    """Set an option of IP; a system that refuses it carries the datagrams all the same."""
    level, option = (socket.IPPROTO_IPV6, ipv6) if of.family == socket.AF_INET6 else (socket.IPPROTO_IP, ipv4)
    with suppress(OSError):
        of.setsockopt(level, option, value)


def ask_for_destination(bound: socket.socket) -> None:
    """Have the called address delivered with each datagram, if the socket is bound to all addresses."""
    if bound.getsockname()[0] in ("0.0.0.0", "::"):  # noqa: S104 - asks
        set_option(bound, _PKTINFO, socket.IPV6_RECVPKTINFO, 1)


def answering(ancillary: Ancillary) -> tuple[str, Ancillary]:
    """The address of this host that was called, and what is sent beside an answer so that it leaves from there."""
    ((level, kind, value),) = ancillary
    # The interface is left to the system: 4 bytes before the address, behind it in IPv6.
    if level == socket.IPPROTO_IPV6:
        return socket.inet_ntop(socket.AF_INET6, value[:16]), [(level, kind, value[:16] + bytes(4))]
    return socket.inet_ntop(socket.AF_INET, value[8:12]), [(level, kind, bytes(4) + value[4:])]


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

    def spend(self, seconds: float, now: float) -> float:
        """Subtract a piece of work that ended now [s]; returns the time until the balance is positive [s]."""
        self._left = max(self.left(now) - seconds, -self._most)
        return max(0.0, -self._left / self.share)


class ReceiveQueue:
    """Reads one socket, which does not block and is closed with the queue."""

    def __init__(
        self,
        bound: socket.socket,
        *,
        loop: asyncio.AbstractEventLoop,
        now: Callable[[], float],
        take: Take,
        is_due: Callable[[], bool],
        on_datagrams: Callable[[], None],
        share: float,
        source: Address | None = None,
    ) -> None:
        """Listen. `take` is given each datagram with its sender and what the system gives beside it; `is_due` says
        whether something else comes first, so that a datagram waits; `on_datagrams` is called after the loop was woken
        and a datagram was taken; `share` of a processor is what reading may cost; `source` is whom the socket is
        connected to: what the system gives beside is then there once in `CLASS_LOOK_S`."""
        self.socket = bound
        self.is_open = True
        self.budget = WorkBudget(share, MOST_S, now())
        self._loop = loop
        self._now = now
        self._take = take
        self._is_due = is_due
        self._on_datagrams = on_datagrams
        self._source = source
        self._look_at = -inf
        self._looks = True  # whether the next read is one with what the system gives beside
        self._resume: asyncio.TimerHandle | None = None
        waiting = select.poll()
        waiting.register(bound.fileno(), select.POLLIN)
        self._waiting = waiting.poll
        # That of uvloop returns None and not the bool of its type, which compiled code would check.
        self._forget: Callable[[int], object] = loop.remove_reader
        loop.add_reader(bound.fileno(), self._on_readable)

    def read(self) -> bool:
        """Take the datagrams that wait, until a slice or the budget is used up; returns whether there were any."""
        # To ask first costs a third of a read that finds nothing and raises an exception.
        return self._resume is None and bool(self._waiting(0)) and self._take_some(SLICE_S, 0.0)

    def _take_some(self, slice_s: float, cost_s: float) -> bool:
        """Take one datagram, and others for so long (-inf: none); whether there were any. `cost_s` was spent before."""
        began = now = -inf
        found = False
        while True:
            data: bytes | None = None
            source: Any = self._source
            ancillary: Any = _NOTHING
            try:
                if self._looks:
                    data, ancillary, _, name = self.socket.recvmsg(_LONGEST_READ, ANCILLARY_BYTES)
                    source = source or address_of(name)
                else:
                    data = self.socket.recv(_LONGEST_READ)
            except BlockingIOError:
                break
            except OSError:  # such as an ICMP error of an earlier send: it costs time as a datagram does
                pass
            now = self._now()
            if began == -inf:
                began = now
            if data is not None:
                found = True
                if self._looks:
                    self._look_at = now + CLASS_LOOK_S
                self._looks = self._source is None or now >= self._look_at
                self._take(data, source, ancillary, now)
                now = self._now()
            if now - began > slice_s or not (self.is_open and self._waiting(0)):
                break
        if began > -inf:
            self._spend(now - began + cost_s, now)
        return found

    def _spend(self, seconds: float, now: float) -> None:
        wait = self.budget.spend(seconds, now)
        if wait > 0.0 and self.is_open:
            self._forget(self.socket.fileno())
            self._resume = self._loop.call_later(wait, self._go_on)

    def _go_on(self) -> None:
        self._resume = None
        self._loop.add_reader(self.socket.fileno(), self._on_readable)

    def _on_readable(self) -> None:
        """Take a datagram without asking whether there is one; the loop wakes again for the next."""
        if not self._is_due() and self._take_some(-inf, WAKE_S):
            self._on_datagrams()

    def close(self) -> None:
        """Stop listening and release the socket; may be repeated, also from within `take`."""
        if self._resume is not None:
            self._resume.cancel()
            self._resume = None
        if self.is_open:
            self.is_open = False
            if not self._loop.is_closed():
                self._forget(self.socket.fileno())
            self.socket.close()
