"""One way through the relay: the faulty link, what is held back, and what is remembered. Keeps its book.

Pure: knows no socket and no clock; what it passes on goes to a function that it is handed.
"""

from collections import deque
from collections.abc import Callable

from tests.soak.books import Book
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.wire import Kind, kind_of

REMEMBERED = 20_000
"""Datagrams kept to be sent again, of each direction."""
_HANDSHAKE = (Kind.HELLO, Kind.WELCOME)


class Direction:
    """One way; `book` is what it has done."""

    def __init__(self, send: Callable[[bytes], bool | None], uniform: Callable[[], float]) -> None:
        """Begin with a perfect link.

        Args:
            send: passes a datagram on; False if the kernel refused, None if there is nobody to send it to.
            uniform: random numbers in [0, 1).
        """
        self.book = Book()
        self._send = send
        self._uniform = uniform
        self._links = [self._link(Emulation())]
        self._held: list[tuple[float, bytes]] | None = None
        self.remembered: deque[tuple[float, bytes]] = deque(maxlen=REMEMBERED)

    def _link(self, emulation: Emulation) -> EmulatedLink[bytes]:
        return EmulatedLink(emulation, self._uniform)

    def emulate(self, emulation: Emulation) -> None:
        """Other faults from now on; what is under way arrives as it was to."""
        self._links.append(self._link(emulation))

    def take(self, data: bytes, now: float) -> None:
        """A datagram has come."""
        self.book.arrived += 1
        self.book.arrived_bytes += len(data)
        if self._held is None:
            self._put(data, now)
        else:
            self._held.append((now, data))

    def _put(self, data: bytes, now: float) -> None:
        link = self._links[-1]
        counters = link.counters
        before = counters.lost + counters.congested + counters.blacked_out, counters.duplicated, counters.reordered
        link.send(data, data, now)
        self.book.lost += counters.lost + counters.congested + counters.blacked_out - before[0]
        self.book.duplicated += counters.duplicated - before[1]
        self.book.reordered += counters.reordered - before[2]

    def deliver(self, now: float) -> None:
        """Pass on what is due."""
        for link in self._links:
            for data, original in link.receive(now):
                if not self._pass(data):
                    continue
                if data != original:
                    self.book.corrupted += 1
                else:
                    self.remembered.append((now, data))
        if len(self._links) > 1:
            self._links = [link for link in self._links[:-1] if link.next_due() is not None] + self._links[-1:]

    def _pass(self, data: bytes) -> bool:
        passed = self._send(data)
        if passed is None:
            self.book.orphaned += 1
        elif not passed:
            self.book.refused += 1
        else:
            self.book.passed += 1
            self.book.passed_bytes += len(data)
            self.book.handshakes += bool(data) and kind_of(data) in _HANDSHAKE
        return bool(passed)

    def overtaken(self, data: bytes) -> None:
        """A copy of what is about to be taken was delivered another way."""
        self.book.duplicated += 1
        self.book.passed += 1
        self.book.passed_bytes += len(data)
        self.book.handshakes += kind_of(data) in _HANDSHAKE

    def orphan(self) -> None:
        """A datagram came to an address that was left behind."""
        self.book.arrived += 1
        self.book.orphaned += 1

    def hold(self) -> None:
        """Hold back whatever comes."""
        if self._held is None:
            self._held = []

    def release(self, *, deliver: bool) -> int:
        """Go on; what was held back is passed on now, out of its time, or never. Returns how many."""
        held, self._held = self._held or [], None
        for _, data in held:
            if not deliver:
                self.book.discarded += 1
            elif self._pass(data):
                self.book.released += 1
        return len(held)

    def release_old(self, until: float) -> int:
        """Pass on what came before then [s], and hold back the rest; returns how many were passed on."""
        held = self._held or []
        old = [data for at, data in held if at <= until]
        self._held = held[len(old) :]
        passed = sum(map(self._pass, old))
        self.book.released += passed
        return passed

    def replay(self, count: int, since: float, until: float) -> int:
        """Send datagrams of the session again that were passed on between then and then [s]: `count`, evenly chosen."""
        old = [data for at, data in self.remembered if since <= at <= until and kind_of(data) not in _HANDSHAKE]
        chosen = old[:: max(1, len(old) // count)][:count] if count else []
        for data in chosen:
            self.book.replayed += 1
            self._pass(data)
        return len(chosen)

    @property
    def next_due(self) -> float | None:
        dues = [due for link in self._links if (due := link.next_due()) is not None]
        return min(dues, default=None)

    def reading(self) -> Book:
        self.book.under_way = len(self._held or ()) + sum(map(_under_way, self._links))
        return self.book


def _under_way(link: EmulatedLink[bytes]) -> int:
    counters = link.counters
    entered = counters.sent - counters.lost - counters.blacked_out - counters.congested + counters.duplicated
    return entered - counters.delivered
