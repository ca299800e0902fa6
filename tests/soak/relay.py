"""A relay between two daemons, in a process of its own: the wire, with every fault of `protocol.emulation` and more.

Owns its sockets and its books. Told what to do by lines of JSON on standard input, each answered by one line; the end
of standard input ends it. The master sends to its front, the slave sees its back; it can move its back to another port
and address (what a NAT does), hold datagrams back, and send old ones again. It can also lead the master to another
slave, and overtake the master's datagrams with copies from another address. It has no key.
"""

import json
import os
import select
import socket
import sys
from collections import deque
from contextlib import suppress
from pathlib import Path
from random import Random
from time import monotonic
from typing import Any

from tests.soak.books import Books
from tests.soak.direction import Direction
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.wire import LONGEST_DATAGRAM, Kind, kind_of

Address = tuple[str, int]

_PROBE = 0
"""Kind of a datagram that probes a path: it may go to an address that has not proved itself."""
PRIORITY = 40
"""Of SCHED_FIFO, below the daemons: a wire does not wait for a processor. Without the right to it, it has to."""
LONGEST_WAIT = 0.05
_READS = 64
_KEPT_BACKS = 4
_KEPT_CALLS = 1024


class Relay:
    """Sockets, the two directions, and the words that it understands."""

    def __init__(self, slave: Address, seed: int) -> None:
        self._slave = slave
        self._master: Address | None = None
        self._front = _bound("127.0.0.1", 0)
        self._back = _bound("127.0.0.1", 0)
        self._former: list[socket.socket] = []
        self._stand_in: Address | None = None
        self._thief: socket.socket | None = None
        self._stolen = self._probed = 0
        self._recorded_calls: deque[bytes] = deque(maxlen=_KEPT_CALLS)
        self._answers = self._calls = 0
        self._looked_at = monotonic()
        self._late = 0.0
        uniform = Random(seed).random
        self.forward = Direction(self._to_slave, uniform)
        self.backward = Direction(lambda data: _send(self._front, data, self._master), uniform)

    @property
    def front(self) -> Address:
        return _address(self._front)

    def sockets(self) -> list[socket.socket]:
        return [self._front, self._back, *self._former, *([] if self._thief is None else [self._thief])]

    def _to_slave(self, data: bytes) -> bool | None:
        """To the slave; what goes to one in its place has nobody to go to, as far as the books of the two ends go."""
        sent = _send(self._back, data, self._stand_in or self._slave)
        return sent if self._stand_in is None else None

    def look(self, now: float) -> None:
        """Take note of how long nobody has looked at the sockets."""
        self._late = max(self._late, now - self._looked_at - LONGEST_WAIT)
        self._looked_at = now

    def timeout(self, now: float) -> float:
        dues = [due for way in (self.forward, self.backward) if (due := way.next_due) is not None]
        return max(0.0, min([due - now for due in dues] + [LONGEST_WAIT]))

    def read(self, ready: socket.socket) -> None:
        for _ in range(_READS):
            try:
                data, source = ready.recvfrom(LONGEST_DATAGRAM + 1)
            except (BlockingIOError, ConnectionError):
                return
            now = monotonic()
            if ready is self._front:
                self._take_from_master(data, source, now)
            elif source == self._stand_in:
                self.backward.book.handshakes += bool(_send(self._front, data, self._master))
            elif source != self._slave:
                self.backward.book.strange += 1
            elif ready is self._back:
                self._answers += bool(data) and kind_of(data) == Kind.WELCOME
                self.backward.take(data, now)
            elif ready is self._thief:
                is_probe = bool(data) and kind_of(data) == _PROBE
                self._stolen, self._probed = self._stolen + (not is_probe), self._probed + is_probe
                self.backward.take(data, now)  # who steals, and drops nothing, passes it on
            else:
                self.backward.orphan()
            self.deliver(now)

    def _take_from_master(self, data: bytes, source: Address, now: float) -> None:
        if source != self._master:
            if not data or kind_of(data) != Kind.HELLO:  # a master that begins anew begins with a call
                self.forward.book.strange += 1
                return
            self._master = source
        if data and kind_of(data) == Kind.HELLO:
            self._calls += 1
            self._recorded_calls.append(data)
        if self._thief is not None and _send(self._thief, data, self._slave):
            self.forward.overtaken(data)
        self.forward.take(data, now)

    def deliver(self, now: float) -> None:
        self.forward.deliver(now)
        self.backward.deliver(now)

    def rebind(self, host: str) -> Address:
        """Another back: a new port, on `host`; the former one hears, and passes nothing on."""
        self._former.append(self._back)
        self._back = _bound(host, 0)
        if len(self._former) > _KEPT_BACKS:
            self._former.pop(0).close()
        return _address(self._back)

    def steal(self, host: str) -> tuple[int, int]:
        """Copy each datagram of the master, and deliver it at once from `host`; "" ends it.

        Returns:
            How many datagrams, and how many probes of the path, came to that address so far.
        """
        if self._thief is not None:
            self._former.append(self._thief)
            self._thief = None
        if host:
            self._thief, self._stolen, self._probed = _bound(host, 0), 0, 0
        return self._stolen, self._probed

    def books(self) -> Books:
        for waiting in self.sockets():  # what has come is booked before the books are read
            self.read(waiting)
        self.backward.book.kernel_drops = drops([self._back, *self._former])
        self.forward.book.kernel_drops = drops([self._front])
        return Books(
            at=monotonic(),
            forward=self.forward.reading(),
            backward=self.backward.reading(),
            calls=self._calls,
            answers=self._answers,
            master=self._master,
            back=_address(self._back),
            late=self._late,
        )

    def obey(self, order: dict[str, Any]) -> Any:
        """Do what one line of JSON says; returns the answer.

        Raises:
            ValueError: it says something else.
        """
        match order["do"]:
            case "books":
                books = self.books().to_dict()
                self._late = 0.0
                return books
            case "rebind":
                return self.rebind(order["host"])
            case "swap":
                self._stand_in = None if order["slave"] is None else (order["slave"][0], order["slave"][1])
                return None
            case "steal":
                return self.steal(order["host"])
            case "recorded_calls":
                return [data.hex() for data in self._recorded_calls]
        ways = {"forward": [self.forward], "backward": [self.backward]}
        answers = [_obey(way, order) for way in ways.get(order["way"], [self.forward, self.backward])]
        return answers[0] if len(answers) == 1 else sum(answer or 0 for answer in answers)


def _obey(way: Direction, order: dict[str, Any]) -> Any:
    """What an order says of one direction, or of each."""
    match order["do"]:
        case "emulate":
            return way.emulate(Emulation(**order["emulation"]))
        case "hold":
            return way.hold()
        case "release":
            return way.release(deliver=order["deliver"])
        case "release_old":
            return way.release_old(order["until"])
        case "replay":
            return way.replay(order["count"], order["since"], order["until"])
        case "recall":
            return [data.hex() for _, data in list(way.remembered)[-order["count"] :]]
    raise ValueError(f"a relay cannot {order['do']}")


def drops(sockets: list[socket.socket]) -> int:
    """Datagrams that the kernel has dropped before these sockets, for want of room."""
    inodes = {str(os.fstat(open_.fileno()).st_ino) for open_ in sockets}
    rows = [line.split() for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]]
    return sum(int(row[12]) for row in rows if row[9] in inodes)


def _bound(host: str, port: int) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setblocking(False)
    made.bind((host, port))
    return made


def _address(of: socket.socket) -> Address:
    host, port = of.getsockname()
    return host, port


def _send(by: socket.socket, data: bytes, to: Address | None) -> bool | None:
    if to is None:
        return None
    try:
        by.sendto(data, to)
    except OSError:
        return False
    return True


def main() -> None:
    order = json.loads(sys.argv[1])
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    relay = Relay((order["slave"][0], order["slave"][1]), order["seed"])
    sys.stdout.write(json.dumps(relay.front) + "\n")
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
