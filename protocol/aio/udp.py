"""Run one endpoint on UDP sockets and an asyncio event loop.

The owner calls `service(now)` before the work of a tick and `flush(now)` after it. Between ticks the sockets and one
timer wake the loop, so an owner that ticks slowly, or not at all, loses nothing. The sockets are those of a port of
this host, or of paths that another process finds.
"""

import asyncio
from collections.abc import Callable
from math import inf
from typing import Final

from weberlink.protocol.aio.paths import MakePaths, PathFacts, Paths
from weberlink.protocol.emulation import EmulatedLink
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import Address
from weberlink.protocol.states import State

TIMER_STEP_S: Final = 1e-3
"""Resolution of the timers of uvloop [s]: rounded down, a timer would fire again and again until it is due."""
_ANY_PORT: Address = ("", 0)


class UdpShell:
    """Drives one endpoint over UDP."""

    def __init__(
        self,
        endpoint: Endpoint,
        *,
        now: Callable[[], float],
        listen: Address = _ANY_PORT,
        link: EmulatedLink[Address] | None = None,
        dscp: int = 0,
        paths: MakePaths = Paths,
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
        self._endpoint = endpoint
        self._now = now
        self._link = link
        self._listen = listen
        self._paths = paths(endpoint, dscp, now, self._on_datagrams, on_no_path)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._state: State | None = None
        self._peer: Address | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._timer_at = inf

    @property
    def address(self) -> Address:
        """Own address, once open."""
        return self._paths.address

    @property
    def paths(self) -> tuple[PathFacts, ...]:
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
        self.flush(self._now())

    def close(self) -> None:
        """Send what is still waiting, then release the sockets; also if `open` did not finish."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer, self._timer_at = None, inf
        if self._loop is not None:
            for data, address in self._endpoint.datagrams_to_send():
                self._paths.send(data, address)
            for data, address in self._link.receive(inf) if self._link is not None else ():
                self._paths.send(data, address)  # sooner than the emulated delay, which ends with this process
            self._loop = None
        self._paths.close()

    def service(self, now: float | None = None) -> None:
        """Receive datagrams from the peer, and run timers that have expired by `now`, or when all is read.

        The loop wakes by itself for other datagrams. One slice is read; if the peer would count as silent, as much as
        the budget allows: after a stall of this process the oldest datagrams come first, and are too old to count.
        """
        while self._paths.read():
            self._tell_paths()
            if self._now() < self._endpoint.silent_at:
                break
        self._endpoint.handle_timer(self._now() if now is None else now)

    def flush(self, now: float) -> None:
        """Send what the endpoint and the emulated link have ready, and set the timer for what is due next."""
        self._tell_paths()
        link = self._link
        if self._loop is None:
            return  # what is said before the sockets are open waits for them
        for data, address in self._endpoint.datagrams_to_send():
            if link is None:
                self._paths.send(data, address)
            else:
                link.send(data, address, now)
        due = self._endpoint.next_timer()
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
        self.flush(self._now())

    def _on_datagrams(self) -> None:
        self.flush(self._now())

    def _tell_paths(self) -> None:
        """Tell the sockets of a new state or peer."""
        endpoint = self._endpoint
        if endpoint.state is not self._state or endpoint.peer is not self._peer:
            self._state, self._peer = endpoint.state, endpoint.peer
            self._paths.follow()
