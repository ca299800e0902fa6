"""Relay between the two daemons, in a process of its own: emulated faults, repeated and redirected datagrams.

`Wire` starts it and gives it orders over a pipe, whose end ends it: each calls a method of `Relay`. The master sends to
its front, the slave sees its back. It has no key.
"""

import os
import select
import socket
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from random import Random
from time import monotonic
from typing import Any, NamedTuple, Self

from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.wire import LONGEST_DATAGRAM, Kind

Address = tuple[str, int]

PRIORITY = 40  # of SCHED_FIFO, below the daemons: a wire does not wait for a processor. Needs the right to it.
LONGEST_WAIT = 0.05
REMEMBERED = 20_000  # datagrams of each direction kept to be sent again
_READS = 64
_KEPT_BACKS = 4
_KEPT_CALLS = 1024
_HANDSHAKE = (Kind.HELLO, Kind.WELCOME)
_PROBES = (24, 26, 28)  # bytes of a question about a path, with 0 to 2 acknowledgements: a key hides the kind


class Direction:
    def __init__(self, send: Callable[[bytes], bool], uniform: Callable[[], float]) -> None:
        self.passed = 0  # datagrams
        self._send = send
        self._uniform = uniform
        self._links = [EmulatedLink[bytes](Emulation(), uniform)]
        # Of this session: whoever sees a new one begin clears it.
        self.remembered: deque[tuple[float, bytes]] = deque(maxlen=REMEMBERED)

    def emulate(self, emulation: Emulation) -> None:
        """Other faults from now on; what is under way arrives as planned."""
        self._links.append(EmulatedLink(emulation, self._uniform))

    def take(self, data: bytes, now: float) -> None:
        self._links[-1].send(data, data, now)

    def deliver(self, now: float) -> None:
        for link in self._links:
            for data, original in link.receive(now):
                if self._pass(data) and data == original:
                    self.remembered.append((now, data))
        self._links = [*(link for link in self._links[:-1] if link.next_due() is not None), self._links[-1]]

    def _pass(self, data: bytes) -> bool:
        passed = self._send(data)
        self.passed += passed
        return passed

    def replay(self, count: int, since: float, until: float) -> int:
        """Send up to `count` datagrams of this session again that were passed on between then and then [s]."""
        old = [data for at, data in self.remembered if since <= at <= until and data[0] not in _HANDSHAKE]
        chosen = old[:: max(1, len(old) // count)][:count] if count else []
        for data in chosen:
            self._pass(data)
        return len(chosen)

    def next_due(self) -> float | None:
        return min((due for link in self._links if (due := link.next_due()) is not None), default=None)


class Books(NamedTuple):
    forward: int  # datagrams passed on to the slave
    backward: int  # and to the master
    calls: int  # HELLOs from the master
    answers: int  # WELCOMEs from the slave
    master: Address | None
    back: Address  # which the slave sees
    late: float  # longest time since the last reading in which the relay itself stood still [s]


class Relay:
    """The sockets, both directions, and the orders of `Wire`."""

    def __init__(self, slave: Address, seed: int) -> None:
        self._slave = slave
        self._master: Address | None = None
        self.front = _bound("127.0.0.1")
        self._back = _bound("127.0.0.1")
        self._former: list[socket.socket] = []
        self._thief: socket.socket | None = None
        self._stolen = self._probed = self._calls = self._answers = 0
        self._recorded_calls: deque[bytes] = deque(maxlen=_KEPT_CALLS)
        self._looked_at = monotonic()
        self._late = 0.0
        uniform = Random(seed).random
        self.forward = Direction(lambda data: _send(self._back, data, self._slave), uniform)
        self.backward = Direction(lambda data: _send(self.front, data, self._master), uniform)

    def sockets(self) -> list[socket.socket]:
        return [self.front, self._back, *self._former, *([] if self._thief is None else [self._thief])]

    def look(self, now: float) -> None:
        self._late = max(self._late, now - self._looked_at - LONGEST_WAIT)
        self._looked_at = now

    def timeout(self, now: float) -> float:
        dues = [due for way in (self.forward, self.backward) if (due := way.next_due()) is not None]
        return max(0.0, min([due - now for due in dues] + [LONGEST_WAIT]))

    def read(self, ready: socket.socket) -> None:
        for _ in range(_READS):
            try:
                data, source = ready.recvfrom(LONGEST_DATAGRAM + 1)
            except (BlockingIOError, ConnectionError):
                return
            now = monotonic()
            if ready is self.front:
                self._take_from_master(data, source, now)
            elif source == self._slave and ready in (self._back, self._thief):
                self._take_from_slave(data, now, is_stolen=ready is self._thief)
            self.deliver(now)

    def _take_from_master(self, data: bytes, source: Address, now: float) -> None:
        is_call = data[:1] == bytes((Kind.HELLO,))
        if is_call:
            self._master = source  # a master that starts anew begins with a call
            self._calls += 1
            self._recorded_calls.append(data)
        if source == self._master:
            if self._thief is not None:
                _send(self._thief, data, self._slave)
            self.forward.take(data, now)

    def _take_from_slave(self, data: bytes, now: float, *, is_stolen: bool) -> None:
        if data[:1] == bytes((Kind.WELCOME,)):
            self._answers += 1
            self.forward.remembered.clear()
            self.backward.remembered.clear()
        if is_stolen:  # a path probe may go to an address that has not proved itself, and nothing else
            self._probed += len(data) in _PROBES
            self._stolen += len(data) not in _PROBES
        self.backward.take(data, now)

    def deliver(self, now: float) -> None:
        self.forward.deliver(now)
        self.backward.deliver(now)

    def books(self) -> Books:
        for waiting in self.sockets():  # count what has come already
            self.read(waiting)
        late, self._late = self._late, 0.0
        passed = (self.forward.passed, self.backward.passed)
        return Books(*passed, self._calls, self._answers, self._master, self._back.getsockname(), late)

    def emulate(self, emulation: Emulation, way: str) -> None:
        """Other faults from now on; `way` is "forward", "backward", or "" for both."""
        for each in self._ways(way):
            each.emulate(emulation)

    def replay(self, way: str, count: int, since: float, until: float) -> int:
        return sum(each.replay(count, since, until) for each in self._ways(way))

    def recall(self, way: str, count: int) -> list[bytes]:
        return [data for each in self._ways(way) for _, data in list(each.remembered)[-count:]]

    def _ways(self, way: str) -> list[Direction]:
        return [each for name, each in (("forward", self.forward), ("backward", self.backward)) if way in (name, "")]

    def rebind(self, host: str) -> None:
        """A new back on another port or address; the former one hears, and passes nothing on."""
        self._former = [*self._former, self._back][-_KEPT_BACKS:]
        self._back = _bound(host)

    def steal(self, host: str) -> tuple[int, int]:
        """Overtake the master's datagrams with copies from `host`; returns how many datagrams and probes it got."""
        stolen = self._stolen, self._probed
        self._thief, self._stolen, self._probed = _bound(host) if host else None, 0, 0
        return stolen

    def recorded_calls(self) -> list[bytes]:
        """The newest HELLOs of the master."""
        return list(self._recorded_calls)


def _bound(host: str) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setblocking(False)
    made.bind((host, 0))
    return made


def _send(by: socket.socket, data: bytes, to: Address | None) -> bool:
    try:
        return to is not None and by.sendto(data, to) == len(data)
    except OSError:
        return False


def serve(orders: Connection, slave: Address, seed: int) -> None:
    """The process: relay until the other end of the pipe is closed."""
    os.setsid()  # Ctrl-C ends whoever started it, which closes the pipe
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    relay = Relay(slave, seed)
    orders.send(relay.front.getsockname())
    while True:
        ready, _, _ = select.select([orders, *relay.sockets()], [], [], relay.timeout(monotonic()))
        relay.look(monotonic())
        for source in ready:
            if isinstance(source, socket.socket):
                relay.read(source)
                continue
            try:
                name, arguments = orders.recv()
            except EOFError:
                return
            orders.send(getattr(relay, name)(*arguments))
        relay.deliver(monotonic())


class Wire:
    """A relay in front of `slave`, for as long as the `with` lasts."""

    def __init__(self, slave: Address, seed: int) -> None:
        context = get_context("spawn")
        self._orders, theirs = context.Pipe()
        self._process = context.Process(target=serve, args=(theirs, slave, seed), daemon=True)
        self._process.start()
        theirs.close()
        self.front: Address = self._answer()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._orders.close()
        self._process.join(5.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def books(self) -> Books:
        books: Books = self.ask("books")
        return books

    def emulate(self, emulation: Emulation, way: str = "") -> None:
        self.ask("emulate", emulation, way)

    @contextmanager
    def replaying(self, way: str, count: int, until: float) -> Iterator[None]:
        """The order `replay`, while something else is done."""
        self._orders.send(("replay", (way, count, 0.0, until)))
        yield
        self._answer()

    def ask(self, name: str, *arguments: object) -> Any:
        """Give an order: call this method of `Relay`."""
        self._orders.send((name, arguments))
        return self._answer()

    def _answer(self) -> Any:
        try:
            return self._orders.recv()
        except (EOFError, ConnectionError):
            self._process.join()
            raise RuntimeError(f"the relay has ended, with status {self._process.exitcode}") from None
