"""A side of a simulated session whose process stands still for a while, as after SIGSTOP."""

from typing import Any

from weberlink.protocol.events import Address


class StoppedEndpoint:
    """Datagrams wait, as in the buffer of a socket, and are read before anything else once the process goes on."""

    def __init__(self, endpoint: Any, begin: float, end: float) -> None:
        self._endpoint = endpoint
        self._begin, self._end = begin, end
        self._waiting: list[tuple[bytes, Address]] = []
        self.stops = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._endpoint, name)

    def receive_datagram(self, data: bytes, address: Address, now: float) -> None:
        self._waiting.append((data, address))
        self._go_on(now)

    def handle_timer(self, now: float) -> None:
        self._go_on(now)
        if not self.stops:
            self._endpoint.handle_timer(now)

    def datagrams_to_send(self) -> list[tuple[bytes, Address]]:
        return [] if self.stops else self._endpoint.datagrams_to_send()

    def _go_on(self, now: float) -> None:
        self.stops = self._begin <= now < self._end
        if not self.stops:
            for waiting in self._waiting:
                self._endpoint.receive_datagram(*waiting, now)
            self._waiting.clear()


class StoppedSide:
    """Either loop; what it does not do while it stands still is a tick.

    Args:
        loop: master or slave.
        begin, end: between which the process stands still [s].
    """

    def __init__(self, loop: Any, begin: float, end: float) -> None:
        self._loop = loop
        self.endpoint = StoppedEndpoint(loop.endpoint, begin, end)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._loop, name)

    def tick(self, index: int, deadline: float, now: float) -> None:
        if not self.endpoint.stops:
            self._loop.tick(index, deadline, now)
