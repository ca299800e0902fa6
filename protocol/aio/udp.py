"""Run one endpoint on UDP sockets and an asyncio event loop.

The owner calls `service(now)` before the work of a tick and `flush(now)` after it. Between ticks the sockets and one
timer wake the loop, so an owner that ticks slowly, or not at all, loses nothing.

The datagrams take one path, from a port of this host, or several that another process finds. A path is a bound socket,
and once the peer is known a second one on the same port that is connected to it. The kernel puts the peer's datagrams
into the buffer of the second socket and all others into that of the first, so a flood from elsewhere cannot push out
the peer's datagrams, and gets only a small share of the processor. Everything is sent from the first socket, whose own
address may change meanwhile.
"""

import asyncio
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from math import inf
from typing import Final

from weberlink.compiled import mypyc_attr
from weberlink.protocol.aio.sockets import (
    ECN_BITS,
    Ancillary,
    ReceiveQueue,
    Take,
    address_of,
    answering,
    ask_for_destination,
    bind,
    connected_twin,
    name_of,
    numeric,
    resolve,
    set_option,
)
from weberlink.protocol.emulation import EmulatedLink
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import Address
from weberlink.protocol.paths import LinkPath
from weberlink.protocol.states import State

PEER_SHARE: Final = 0.3
"""Share of a processor for datagrams from the peer's address, or from anywhere while there is no peer."""
STRANGER_SHARE: Final = 0.05
"""Share of a processor for other datagrams while there is a peer: it may have moved or restarted."""
TIMER_STEP_S: Final = 1e-3
"""Resolution of the timers of uvloop [s]: rounded down, a timer would fire again and again until it is due."""
LONGEST_HANDLING_S: Final = 1e-4
"""How long before a tick a datagram waits for it at most [s], as the newest one took as long."""


def peer_address(name: str) -> Address:
    """The address of a peer on whatever paths are found to it; names it in an endpoint."""
    return name, 0


@mypyc_attr(allow_interpreted_subclasses=True)
class Path:
    """One path.

    Attributes:
        remote: where the peer is, as the sources of its datagrams are named; None while unknown.
        changes: how often this place had another path or remote before.
        is_open: until `close`.
    """

    def __init__(self, facts: LinkPath, bound: socket.socket, owner: "Paths", loop: asyncio.AbstractEventLoop) -> None:
        """Listen on a bound socket; `facts` say which path it is."""
        self.remote: Address | None = None
        self.changes = 0
        self.is_open = True
        self._facts = facts
        self._owner = owner
        self._loop = loop
        self._dscp: int | None = None
        # Sender of the newest datagram, and which address of this host it called; then the same of the peer.
        self._called: list[tuple[Address, str, Ancillary]] = []
        self._bound = bound
        bound.setblocking(False)
        set_option(bound, socket.IP_TOS, socket.IPV6_TCLASS, owner.shell.dscp << ECN_BITS)
        ask_for_destination(bound)
        # Set only now, so that the port had to be free. Only sockets that set the option too can share it from here on.
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        self._open = self._queue(bound, self._take_from_anywhere)
        self._peer: ReceiveQueue | None = None

    def _queue(self, bound: socket.socket, take: Take, source: Address | None = None) -> ReceiveQueue:
        shell = self._owner.shell
        return ReceiveQueue(
            bound, loop=self._loop, now=shell.now, take=take, is_due=shell.is_due, on_datagrams=shell.on_datagrams,
            share=PEER_SHARE, source=source,
        )  # fmt: skip

    def guard(self, peer: Address) -> None:
        """Receive from this address in a socket of its own, and send to it. Without that socket there is less
        protection."""
        if self._peer is not None:
            self._peer.close()
            self._peer = None
        self.remote = peer
        called = [each for each in self._called[:1] if each[0] == peer]
        self._called = self._called[:1] + called
        # A socket on all addresses would take one of the system's choice, at which nothing of the peer arrives. A
        # link-local address needs its zone, which is not told.
        own_host = called[0][1] if called and "%" not in peer[0] else ""
        try:
            connected = connected_twin(self._bound, own_host, peer)
        except OSError:
            self._open.budget.share = PEER_SHARE
            return
        self.remote = address_of(connected.getpeername())
        set_option(connected, socket.IP_RECVTOS, socket.IPV6_RECVTCLASS, 1)
        self._peer = self._queue(connected, self._take_from_peer, self.remote)
        self._open.budget.share = STRANGER_SHARE

    def read(self) -> bool:
        """Take what the peer has sent; the loop wakes by itself for other datagrams."""
        return (self._peer or self._open).read()

    def send_to(self, data: bytes, address: Address) -> None:
        """Send a datagram; one that the system refuses (peer not there, buffer full, no route) is lost."""
        name = name_of(address) if "%" in address[0] else address
        for source, _, ancillary in self._called:
            if source == address:  # a peer knows the address that it called alone
                with suppress(OSError):  # the host may have lost it since
                    self._bound.sendmsg((data,), ancillary, 0, name)
                    return
        with suppress(OSError):
            self._bound.sendto(data, name)

    def facts(self, note: str = "") -> LinkPath:
        remote = "" if self.remote is None else numeric(self.remote)
        return self._facts._replace(remote=remote, changes=self.changes, note=note, dscp=self._dscp)

    def close(self) -> None:
        """Release both sockets; may be repeated, also while a datagram is taken."""
        self.is_open = False
        if self._peer is not None:
            self._peer.close()
        self._open.close()

    def _take_from_anywhere(self, data: bytes, source: Address, ancillary: Ancillary, now: float) -> None:
        if ancillary:
            self._called[:1] = [(source, *answering(ancillary))]
        self._owner.on_datagram(data, source, now, self)

    def _take_from_peer(self, data: bytes, source: Address, ancillary: Ancillary, now: float) -> None:
        if ancillary:
            ((_, _, value),) = ancillary  # IPv4 gives one octet, IPv6 an integer
            dscp = int.from_bytes(value, sys.byteorder) >> ECN_BITS
            if dscp != self._dscp:
                self._dscp = dscp
                self._owner.tell()
        self._owner.on_datagram(data, source, now, self)


@mypyc_attr(allow_interpreted_subclasses=True)
class Paths:
    """The only path of an endpoint with a port of this host, which leads to an address that is known or that calls.

    Attributes:
        facts: of the paths in use, in words; replaced when there is news.
        address: own address, once open.
    """

    def __init__(self, shell: "UdpShell") -> None:
        self.shell = shell
        self.endpoint = shell.endpoint
        self.address: Address = ("", 0)
        self.facts: tuple[LinkPath, ...] = ()
        self.all: tuple[Path, ...] = ()
        self._numeric: Address | None = None  # address of the peer that the endpoint knows by a name
        self._guarded: Address | None = None
        self.tell()

    async def open(self, loop: asyncio.AbstractEventLoop, listen: Address) -> None:
        """Resolve names, claim the port and listen; raises as `UdpShell.open`."""
        peer = self.endpoint.peer
        family, local = await resolve(loop, listen, socket.AF_UNSPEC, passive=True)
        if peer is not None:
            family, self._numeric = await resolve(loop, peer, family if listen[0] else socket.AF_UNSPEC, passive=False)
            if not listen[0]:
                _, local = await resolve(loop, listen, family, passive=True)
        bound = bind(family, local)
        self.address = address_of(bound.getsockname())
        self.all = (Path(LinkPath(), bound, self, loop),)

    def read(self) -> bool:
        """Hand what the peer has sent to the endpoint, within the budget; returns whether there was anything."""
        was_any = False
        for path in self.all:
            was_any = path.read() or was_any
        return was_any

    def on_datagram(self, data: bytes, source: Address, now: float, path: Path) -> None:  # noqa: ARG002 - of several
        """Take a datagram that came on a path."""
        peer = self.endpoint.peer if source == self._numeric else None
        self.endpoint.receive_datagram(data, source if peer is None else peer, now)

    def follow(self) -> None:
        """Take note of the endpoint's state and of its peer's address, one of which may have changed."""
        peer = self.endpoint.peer
        if peer is None or self.endpoint.state is not State.ENGAGED:
            return
        address = self._numeric or peer
        if address != self._guarded:
            for path in self.all:
                path.changes += self._guarded is not None
                path.guard(address)
            self._guarded = address
            self.tell()

    def send(self, data: bytes, address: Address) -> None:
        for path in self.all:
            path.send_to(data, self._numeric or address)

    def tell(self) -> None:
        """Say anew which paths are in use."""
        peer = self.endpoint.peer
        known = [path for path in self.all if path.remote is not None]
        self.facts = tuple(path.facts() for path in known) or (LinkPath(remote="" if peer is None else numeric(peer)),)

    def close(self) -> None:
        """Release all sockets; may be repeated."""
        for path in self.all:
            path.close()
        self.all = ()


class UdpShell:
    """Drives one endpoint over UDP."""

    def __init__(
        self,
        endpoint: Endpoint,
        *,
        now: Callable[[], float],
        listen: Address = ("", 0),
        link: EmulatedLink[Address] | None = None,
        dscp: int = 0,
        paths: "Callable[[UdpShell], Paths]" = Paths,
        on_no_path: Callable[[str], None] = lambda _why: None,
    ) -> None:
        """Prepare; `open` claims the port.

        Args:
            now: the clock of the endpoint [s], such as `time.monotonic`.
            listen: own host and port; "" for all interfaces, 0 for any port.
            link: applies faults to what is sent; None for none.
            dscp: class of service of what is sent, 0 to 63 (RFC 2474).
            paths: what carries the datagrams; a port of this host, or what a path finder makes. There an endpoint that
                calls has the peer `peer_address(name)`.
            on_no_path: told in one line why there will be no session, once at most.
        """
        self.endpoint = endpoint
        self.now = now
        self._link = link
        self._listen = listen
        self.dscp = dscp
        self.on_no_path = on_no_path
        self._loop: asyncio.AbstractEventLoop | None = None
        self._state: State | None = None
        self._peer: Address | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._timer_at = inf
        self._tick_at = inf
        # When the loop was woken for the newest datagram, and how long that took then [s].
        self._woken_at = self._handling = 0.0
        self._paths = paths(self)

    @property
    def address(self) -> Address:
        """Own address, once open."""
        return self._paths.address

    @property
    def paths(self) -> tuple[LinkPath, ...]:
        """The paths in use, in words; another tuple when there is news."""
        return self._paths.facts

    async def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Resolve names, claim the port and listen.

        Raises:
            AddressInUseError: if another program has the port.
            OSError: if a name does not resolve or is not an address of this host.
        """
        await self._paths.open(loop, self._listen)
        self._loop = loop
        self.flush(self.now())

    def close(self) -> None:
        """Send what is still waiting, then release the sockets; also if `open` did not finish."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer, self._timer_at = None, inf
        if self._loop is not None:
            for data, address in self.endpoint.datagrams_to_send():
                self._paths.send(data, address)
            for data, address in self._link.receive(inf) if self._link is not None else ():
                self._paths.send(data, address)  # sooner than the emulated delay, which ends with this process
            self._loop = None
        self._paths.close()

    def service(self, now: float | None = None) -> None:
        """Receive datagrams from the peer, and run timers that have expired by `now`, or when all is read.

        The loop wakes by itself for other datagrams. One slice is read; if the peer would count as silent, as much as
        the budget allows: after a stall of this process the oldest datagrams come first, and are too old to count."""
        while self._paths.read():
            self._tell_paths()
            if self.now() < self.endpoint.silent_at:
                break
        self.endpoint.handle_timer(self.now() if now is None else now)

    def flush(self, now: float, tick_at: float | None = None) -> None:
        """Send what the endpoint and the emulated link have ready, and set the timer for what is due next.

        The owner reads at `tick_at` itself: a datagram that comes so shortly before that it would delay it waits."""
        if tick_at is not None:
            self._tick_at = tick_at
        self._tell_paths()
        link = self._link
        if self._loop is None:
            return  # what is said before the sockets are open waits for them
        for data, address in self.endpoint.datagrams_to_send():
            if link is None:
                self._paths.send(data, address)
            else:
                link.send(data, address, now)
        due = self.endpoint.next_timer()
        if link is not None:
            for data, address in link.receive(now):
                self._paths.send(data, address)
            if (arrival := link.next_due()) is not None:
                due = arrival if due is None else min(due, arrival)
        if due is None or due >= self._timer_at:
            return  # a timer that fires too early only arms the next one
        if self._timer is not None:
            self._timer.cancel()
        self._timer_at = due
        self._timer = self._loop.call_later(max(0.0, due - now) + TIMER_STEP_S, self._on_timer)

    def _on_timer(self) -> None:
        self._timer, self._timer_at = None, inf
        self.service()  # reads first, so that a stall of this end does not pass for silence of the other
        self.flush(self.now())

    def is_due(self) -> bool:
        """Whether a datagram for which the loop is woken now waits for a tick."""
        self._woken_at = self.now()
        return self._tick_at - self._woken_at < self._handling

    def on_datagrams(self) -> None:
        """What the loop was woken for has been read."""
        self.flush(self.now())
        self._handling = min(self.now() - self._woken_at, LONGEST_HANDLING_S)

    def _tell_paths(self) -> None:
        """Tell the sockets of a new state or peer."""
        endpoint = self.endpoint
        if endpoint.state is not self._state or endpoint.peer is not self._peer:
            self._state, self._peer = endpoint.state, endpoint.peer
            self._paths.follow()


MakePaths = Callable[[UdpShell], Paths]  # what makes the paths of a shell
