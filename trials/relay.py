"""Relay between the two daemons, in a process of its own: emulated faults, repeated and redirected datagrams.

Lines of JSON on standard input tell it what to do, and each is answered by one line; the end of standard input ends it.
The master sends to its front, the slave sees its back. It has no key.
"""

import json
import os
import select
import socket
import sys
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields
from random import Random
from time import monotonic
from typing import Any

from weberlink.protocol.emulation import EmulatedLink, Emulation, LinkCounters
from weberlink.protocol.wire import LONGEST_DATAGRAM, Kind, kind_of

Address = tuple[str, int]

PRIORITY = 40  # of SCHED_FIFO, below the daemons: a wire does not wait for a processor. Needs the right to it.
LONGEST_WAIT = 0.05
REMEMBERED = 20_000  # datagrams of each direction kept to be sent again
_READS = 64
_KEPT_BACKS = 4
_KEPT_CALLS = 1024
_HANDSHAKE = (Kind.HELLO, Kind.WELCOME)
_HARM = tuple(field.name for field in fields(LinkCounters))


class Direction:
    """One direction of the relay; pure.

    Attributes:
        counts: datagrams passed, replayed, and what the emulated links did.
    """

    def __init__(self, send: Callable[[bytes], bool], uniform: Callable[[], float]) -> None:
        """Begin with a perfect link."""
        self.counts: Counter[str] = Counter()
        self._send = send
        self._uniform = uniform
        self._links = [EmulatedLink[bytes](Emulation(), uniform)]
        self.remembered: deque[tuple[float, bytes]] = deque(maxlen=REMEMBERED)
        """Of this session: whoever sees a new one begin clears it."""

    def emulate(self, emulation: Emulation) -> None:
        """Other faults from now on; what is under way arrives as planned."""
        self._links.append(EmulatedLink(emulation, self._uniform))

    def take(self, data: bytes, now: float) -> None:
        self._links[-1].send(data, data, now)

    def deliver(self, now: float) -> None:
        """Pass on what is due."""
        for link in self._links:
            for data, original in link.receive(now):
                if self._pass(data) and data == original:
                    self.remembered.append((now, data))
        for link in [link for link in self._links[:-1] if link.next_due() is None]:
            self.counts.update(_harm(link))
            self._links.remove(link)

    def _pass(self, data: bytes) -> bool:
        passed = self._send(data)
        if passed:
            self.counts["passed"] += 1
        return passed

    def replay(self, count: int, since: float, until: float) -> int:
        """Send datagrams of this session again that were passed on between then and then [s]; `count` of them."""
        old = [data for at, data in self.remembered if since <= at <= until and kind_of(data) not in _HANDSHAKE]
        chosen = old[:: max(1, len(old) // count)][:count] if count else []
        self.counts["replayed"] += len(chosen)
        for data in chosen:
            self._pass(data)
        return len(chosen)

    def next_due(self) -> float | None:
        return min((due for link in self._links if (due := link.next_due()) is not None), default=None)

    def reading(self) -> dict[str, int]:
        """The counts so far, those of the present links included."""
        return dict(sum(map(_harm, self._links), self.counts.copy()))


def _harm(link: EmulatedLink[bytes]) -> Counter[str]:
    return Counter({name: getattr(link.counters, name) for name in _HARM})


class Relay:
    """The sockets, both directions, and the orders that it obeys."""

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
        """Record how long nobody has looked at the sockets."""
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
        is_call = bool(data) and kind_of(data) == Kind.HELLO
        if is_call:
            self._master = source  # a master that starts anew begins with a call
            self._calls += 1
            self._recorded_calls.append(data)
        if source == self._master:
            if self._thief is not None:
                _send(self._thief, data, self._slave)
            self.forward.take(data, now)

    def _take_from_slave(self, data: bytes, now: float, *, is_stolen: bool) -> None:
        kind = kind_of(data) if data else None
        if kind == Kind.WELCOME:
            self._answers += 1
            self.forward.remembered.clear()
            self.backward.remembered.clear()
        if is_stolen:  # a path probe may go to an address that has not proved itself, and nothing else
            self._probed += kind == Kind.PATH
            self._stolen += kind != Kind.PATH
        self.backward.take(data, now)

    def deliver(self, now: float) -> None:
        self.forward.deliver(now)
        self.backward.deliver(now)

    def obey(self, order: dict[str, Any]) -> Any:
        """Do what one order says; returns the answer."""
        match order["do"]:
            case "books":
                return self._books()
            case "rebind":  # a new back on another port or address; the former one hears, and passes nothing on
                self._former = [*self._former, self._back][-_KEPT_BACKS:]
                self._back = _bound(order["host"])
                return self._back.getsockname()
            case "steal":  # send a copy of each datagram of the master from another address, at once; "" ends it
                stolen = self._stolen, self._probed
                self._thief, self._stolen, self._probed = _bound(order["host"]) if order["host"] else None, 0, 0
                return stolen
            case "recorded_calls":
                return [data.hex() for data in self._recorded_calls]
        ways = {"forward": [self.forward], "backward": [self.backward]}
        answers = [_obey(way, order) for way in ways.get(order["way"], [self.forward, self.backward])]
        return answers[0] if len(answers) == 1 else sum(answer or 0 for answer in answers)

    def _books(self) -> dict[str, Any]:
        for waiting in self.sockets():  # count what has come already
            self.read(waiting)
        late, self._late = self._late, 0.0
        return {
            "forward": self.forward.reading(),
            "backward": self.backward.reading(),
            "calls": self._calls,
            "answers": self._answers,
            "master": self._master,
            "back": self._back.getsockname(),
            "late": late,
        }


def _obey(way: Direction, order: dict[str, Any]) -> Any:
    match order["do"]:
        case "emulate":
            return way.emulate(Emulation(**order["emulation"]))
        case "replay":
            return way.replay(order["count"], order["since"], order["until"])
        case "recall":
            return [data.hex() for _, data in list(way.remembered)[-order["count"] :]]
    raise ValueError(f"a relay cannot {order['do']}")


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


def main() -> None:
    order = json.loads(sys.argv[1])
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    relay = Relay((order["slave"][0], order["slave"][1]), order["seed"])
    sys.stdout.write(json.dumps(relay.front.getsockname()) + "\n")
    sys.stdout.flush()
    commands = sys.stdin.fileno()
    unread = b""
    while True:
        ready, _, _ = select.select([commands, *relay.sockets()], [], [], relay.timeout(monotonic()))
        relay.look(monotonic())
        for source in ready:
            if isinstance(source, socket.socket):
                relay.read(source)
                continue
            came = os.read(commands, 65_536)
            if not came:
                return
            *lines, unread = (unread + came).split(b"\n")
            for line in lines:
                sys.stdout.write(json.dumps(relay.obey(json.loads(line))) + "\n")
                sys.stdout.flush()
        relay.deliver(monotonic())


if __name__ == "__main__":
    main()
