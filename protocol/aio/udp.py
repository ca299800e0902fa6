"""Run one endpoint on a UDP port and an asyncio event loop.

The owner calls `service(now)` before the work of a tick and `flush(now)` after it. Between ticks the sockets and one
timer wake the loop, so an owner that ticks slowly, or not at all, loses nothing.

Once a peer has proved itself, a second socket on the same port is connected to its address. The kernel puts the peer's
datagrams into the buffer of that socket and all others into the first one, so a flood from elsewhere cannot push out
the peer's datagrams, and gets only a small share of the processor. Everything is sent from the first socket, whose own
address may change meanwhile.
"""

import asyncio
import socket
from collections.abc import Callable
from errno import EADDRINUSE
from math import inf
from typing import Final

from weberlink.compiled import mypyc_attr
from weberlink.protocol.aio.queue import ReceiveQueue
from weberlink.protocol.emulation import EmulatedLink
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import Address
from weberlink.protocol.states import State

PEER_SHARE = 0.3
"""Share of a processor for datagrams from the peer's address, or from anywhere while there is no peer."""
STRANGER_SHARE = 0.05
"""Share of a processor for other datagrams while there is a peer: it may have moved or restarted."""
TIMER_STEP_S: Final = 1e-3
"""Resolution of the timers of uvloop [s]: rounded down, a timer would fire again and again until it is due."""
_ANY_PORT: Address = ("", 0)


@mypyc_attr(native_class=False)
class AddressInUseError(OSError):
    """Another program holds the UDP port."""


class UdpShell:
    """Drives one endpoint over UDP."""

    def __init__(
        self,
        endpoint: Endpoint,
        *,
        now: Callable[[], float],
        listen: Address = _ANY_PORT,
        link: EmulatedLink[Address] | None = None,
    ) -> None:
        """Prepare; `open` claims the port.

        Args:
            now: the clock of the endpoint [s], such as `time.monotonic`.
            listen: own host and port; "" for all interfaces, 0 for any port.
            link: applies faults to what is sent; None for none.
        """
        self._endpoint = endpoint
        self._now = now
        self._listen = listen
        self._link = link
        self._loop: asyncio.AbstractEventLoop | None = None
        self._open: ReceiveQueue | None = None
        self._peer: ReceiveQueue | None = None
        self._peer_address: Address | None = None
        self._names: dict[Address, Address] = {}
        self._numeric: dict[Address, Address] = {}
        self._timer: asyncio.TimerHandle | None = None
        self._timer_at = inf

    @property
    def address(self) -> Address:
        """Own address, once open."""
        assert self._open is not None
        host, port = self._open.socket.getsockname()[:2]
        return host, port

    async def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Resolve names, claim the port and listen.

        Raises:
            AddressInUseError: if another program has the port.
            OSError: if a name does not resolve or is not an address of this host.
        """
        self._loop = loop
        family, local = await self._resolve(loop, self._listen, socket.AF_UNSPEC, passive=True)
        if self._endpoint.peer is not None:
            wanted = family if self._listen[0] else socket.AF_UNSPEC
            family, peer = await self._resolve(loop, self._endpoint.peer, wanted, passive=False)
            if not self._listen[0]:
                _, local = await self._resolve(loop, self._listen, family, passive=True)
            self._names[peer] = self._endpoint.peer
            self._numeric[self._endpoint.peer] = peer
        bound = self._bind(family, local)
        # Set only now, so that the port had to be free. Only sockets that set the option too can share it from here on.
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        self._open = self._queue(bound, PEER_SHARE)
        self.flush(self._now())

    async def _resolve(
        self, loop: asyncio.AbstractEventLoop, address: Address, family: int, *, passive: bool
    ) -> tuple[socket.AddressFamily, Address]:
        host, port = address
        flags = socket.AI_PASSIVE if passive else 0
        try:
            found = await loop.getaddrinfo(host or None, port, family=family, type=socket.SOCK_DGRAM, flags=flags)
        except socket.gaierror as problem:
            raise OSError(f"{host}:{port} cannot be resolved: {problem.strerror}") from None
        # IPv4 first: a wildcard must take callers of the kind that most configurations name.
        chosen = min(found, key=lambda entry: entry[0] != socket.AF_INET)
        return chosen[0], (str(chosen[4][0]), int(chosen[4][1]))

    def _bind(self, family: socket.AddressFamily, local: Address) -> socket.socket:
        bound = socket.socket(family, socket.SOCK_DGRAM)
        try:
            bound.setblocking(False)
            bound.bind(local)
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

    def close(self) -> None:
        """Send what is still waiting, then release the socket; also if `open` did not finish."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer, self._timer_at = None, inf
        if self._open is None:
            return
        for data, address in self._endpoint.datagrams_to_send():
            self._send(data, address)
        self._leave_peer()
        self._open.close()
        self._open = None

    def service(self, now: float) -> None:
        """Receive datagrams, and run expired timers."""
        self._read()
        self._endpoint.handle_timer(now)

    def flush(self, now: float) -> None:
        """Send what the endpoint and the emulated link have ready, and set the timer for what is due next."""
        datagrams = self._endpoint.datagrams_to_send()
        if self._link is None:
            for data, address in datagrams:
                self._send(data, address)
        else:
            for data, address in datagrams:
                self._link.send(data, address, now)
            for data, address in self._link.receive(now):
                self._send(data, address)
        self._arm(now)

    def _arm(self, now: float) -> None:
        due = self._endpoint.next_timer()
        if self._link is not None and (arrival := self._link.next_due()) is not None:
            due = arrival if due is None else min(due, arrival)
        if due is None or due >= self._timer_at or self._loop is None or self._open is None:
            return  # a timer that fires too early only arms the next one
        if self._timer is not None:
            self._timer.cancel()
        self._timer_at = due
        self._timer = self._loop.call_later(max(0.0, due - now) + TIMER_STEP_S, self._on_timer)

    def _on_timer(self) -> None:
        self._timer, self._timer_at = None, inf
        self._read()  # first, so that a stall of this end does not pass for silence of the other
        now = self._now()
        self._endpoint.handle_timer(now)
        self.flush(now)

    def _on_datagrams(self) -> None:
        self._follow_peer()
        self.flush(self._now())

    def _read(self) -> None:
        """Receive from the peer; the loop wakes by itself for other datagrams.

        Reads one slice; if the peer would count as silent, as much as the budget allows. After a stall of this process
        the oldest datagrams come first, and are too old to count.
        """
        queue = self._peer or self._open
        while queue is not None and queue.read():
            self._follow_peer()
            if self._now() < self._endpoint.silent_at:
                break

    def _take(self, data: bytes, source: Address, now: float) -> None:
        self._endpoint.receive_datagram(data, self._names.get(source, source), now)

    def _follow_peer(self) -> None:
        """Keep a socket connected to the present address of the peer."""
        peer = self._endpoint.peer
        if peer is None or self._endpoint.state is not State.ENGAGED or self._open is None:
            return
        address = self._numeric.get(peer, peer)
        if address == self._peer_address:
            return
        self._leave_peer()
        self._peer_address = address
        connected = socket.socket(self._open.socket.family, socket.SOCK_DGRAM)
        try:
            connected.setblocking(False)
            connected.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
            connected.bind(self._open.socket.getsockname())
            connected.connect(address)
        except OSError:  # the session goes on without it, less protected against floods
            connected.close()
            return
        self._peer = self._queue(connected, PEER_SHARE)
        self._open.limit(STRANGER_SHARE)

    def _leave_peer(self) -> None:
        if self._peer is None or self._open is None:
            return
        self._peer.close()
        self._peer = None
        self._open.limit(PEER_SHARE)

    def _queue(self, bound: socket.socket, share: float) -> ReceiveQueue:
        assert self._loop is not None
        return ReceiveQueue(
            bound, loop=self._loop, now=self._now, take=self._take, on_datagrams=self._on_datagrams, share=share
        )

    def _send(self, data: bytes, address: Address) -> None:
        if self._open is None:
            return
        try:
            self._open.socket.sendto(data, self._numeric.get(address, address))
        except OSError:  # refused by the system (peer not there, buffer full, no route): a lost datagram
            return
