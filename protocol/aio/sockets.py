"""The UDP sockets below an endpoint: what carries its datagrams, and how a socket is kept open to its peer in a flood.

Once a peer has proved itself, a second socket on the same port is connected to its address. The kernel puts the peer's
datagrams into the buffer of that socket and all others into the first one, so a flood from elsewhere cannot push out
the peer's datagrams, and gets only a small share of the processor. Everything is sent from the first socket, whose own
address may change meanwhile.
"""

import asyncio
import socket
from collections.abc import Callable
from contextlib import suppress

from weberlink.protocol.aio.address import address_of, name_of
from weberlink.protocol.aio.hand_over import PathFacts
from weberlink.protocol.aio.queue import ReceiveQueue, Take, called_address
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import Address

PEER_SHARE = 0.3
"""Share of a processor for datagrams from the peer's address, or from anywhere while there is no peer."""
STRANGER_SHARE = 0.05
"""Share of a processor for other datagrams while there is a peer: it may have moved or restarted."""
ECN_BITS = 2
"""Lowest bits of the type-of-service octet (RFC 3168); the class of service is above them (RFC 2474)."""


class Wake:
    """What reading needs of the shell that drives an endpoint.

    Args:
        loop: wakes for datagrams.
        now: the clock of the endpoint [s].
        on_datagrams: called after datagrams were taken because the loop was woken.
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, now: Callable[[], float], on_datagrams: Callable[[], None]
    ) -> None:
        self.loop = loop
        self.now = now
        self.on_datagrams = on_datagrams


class Carrier:
    """Carries the datagrams of one endpoint.

    Attributes:
        paths: in use, in words; replaced when there is news.
        address: own address, once open; of use if there is only one.
    """

    def __init__(self, endpoint: Endpoint, dscp: int) -> None:
        """Prepare; `open` claims what is needed.

        Args:
            endpoint: takes what is received.
            dscp: class of service of what is sent, 0 to 63.
        """
        self.paths: tuple[PathFacts, ...] = ()
        self.address: Address = ("", 0)
        self._endpoint = endpoint
        self._dscp = dscp

    async def open(self, wake: Wake) -> None:
        """Listen.

        Raises:
            OSError: there is no such address, or it is in use.
        """
        raise NotImplementedError

    def read(self) -> bool:
        """Hand what the peer has sent to the endpoint, within the budget; returns whether there was anything."""
        raise NotImplementedError

    def follow(self) -> None:
        """Take note of the endpoint's state and of its peer's address, one of which may have changed."""
        raise NotImplementedError

    def send(self, data: bytes, address: Address) -> None:
        """Send a datagram; one that the system refuses is lost."""
        raise NotImplementedError

    def close(self) -> None:
        """Release all sockets; may be repeated."""
        raise NotImplementedError


class GuardedSocket:
    """A bound socket, and a second one that is connected to the peer.

    Attributes:
        dscp: class of service of the peer's datagrams as they arrive; None while unknown.
    """

    def __init__(self, bound: socket.socket, take: Take, wake: Wake, dscp: int, on_news: Callable[[], None]) -> None:
        """Listen.

        Args:
            bound: does not block; closed with this object.
            take: receives each datagram, its sender and the time.
            wake: of the shell.
            dscp: class of service of what is sent.
            on_news: called when the attribute `dscp` has changed.
        """
        self.dscp: int | None = None
        self._bound = bound
        self._take = take
        self._wake = wake
        self._on_news = on_news
        _mark(bound, dscp)
        # Set only now, so that the port had to be free. Only sockets that set the option too can share it from here on.
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        self._open = self._queue(bound, None)
        self._peer: ReceiveQueue | None = None
        self._own: tuple[Address, list[tuple[int, int, bytes]]] | None = None

    def guard(self, peer: Address) -> Address | None:
        """Receive from this address in a socket of its own; None if that fails, which leaves less protection.

        Returns:
            The address as it will be named as a source of datagrams.
        """
        self.unguard()
        called = self._open.called
        self._own = called if called is not None and called[0] == peer else None
        connected = socket.socket(self._bound.family, socket.SOCK_DGRAM)
        try:
            connected.setblocking(False)
            connected.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
            _stay_on_interface(connected, self._bound)
            own = self._bound.getsockname()
            # A socket on all addresses would take one of the system's choice, at which nothing of the peer arrives.
            if self._own is not None and "%" not in peer[0]:  # a link-local address needs its zone, which is not told
                own = called_address(self._own[1]), *own[1:]
            connected.bind(own)
            connected.connect(name_of(peer))
            reached = address_of(connected.getpeername())
        except OSError:
            connected.close()
            return None
        self._peer = self._queue(connected, self._found_dscp)
        self._open.limit(STRANGER_SHARE)
        return reached

    def unguard(self) -> None:
        """Receive everything in one socket again."""
        if self._peer is not None:
            self._peer.close()
            self._peer = None
            self._open.limit(PEER_SHARE)

    def read(self) -> bool:
        """Take what the peer has sent; the loop wakes by itself for other datagrams."""
        return (self._peer or self._open).read()

    def send(self, data: bytes, address: Address) -> None:
        name = name_of(address) if "%" in address[0] else address
        for called in (self._open.called, self._own):
            if called is not None and called[0] == address:  # a peer knows the address that it called alone
                with suppress(OSError):  # the host may have lost it since
                    self._bound.sendmsg((data,), called[1], 0, name)
                    return
        with suppress(OSError):  # refused by the system (peer not there, buffer full, no route): a lost datagram
            self._bound.sendto(data, name)

    def close(self) -> None:
        """Release both sockets; may be repeated, also from within `take`."""
        self.unguard()
        self._open.close()

    def _queue(self, bound: socket.socket, on_dscp: Callable[[int], None] | None) -> ReceiveQueue:
        wake = self._wake
        return ReceiveQueue(
            bound,
            loop=wake.loop,
            now=wake.now,
            take=self._take,
            on_datagrams=wake.on_datagrams,
            share=PEER_SHARE,
            on_dscp=on_dscp,
        )

    def _found_dscp(self, dscp: int) -> None:
        if dscp != self.dscp:
            self.dscp = dscp
            self._on_news()


def _mark(bound: socket.socket, dscp: int) -> None:
    """Ask for a class of service; a system that refuses it carries the datagrams all the same."""
    is_ipv6 = bound.family == socket.AF_INET6
    level, option = (socket.IPPROTO_IPV6, socket.IPV6_TCLASS) if is_ipv6 else (socket.IPPROTO_IP, socket.IP_TOS)
    with suppress(OSError):
        bound.setsockopt(level, option, dscp << ECN_BITS)


def _stay_on_interface(connected: socket.socket, bound: socket.socket) -> None:
    """Bind to the network interface to which the other socket is bound, if it is."""
    name = bound.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
    if name.strip(b"\0"):
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, name)
