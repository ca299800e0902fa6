"""The account of a session: three books, read at quiet moments, and compared since the session began.

Owns when a comparison is fair. A new session, or a new life of a daemon, opens a new page; counters go on over both.
"""

from tests.soak.laws import Reading, balanced, books_agree
from tests.soak.processes import socket_queue
from tests.soak.rig import SIDES, Rig
from tests.soak.watch import Watch
from weberlink.system.configuration import MASTER, SLAVE

RETRIES = 4
RETRY_S = 0.5


class Ledger:
    """Compares the books of a rig.

    Attributes:
        pages: sessions that were accounted for.
        checks: comparisons made.
        datagrams: passed on to an end, and accounted for.
        since: when the page was opened [s]; what the relay remembers from then on is of this session.
    """

    def __init__(self, rig: Rig, watch: Watch) -> None:
        """Begin; nothing is read yet."""
        self._rig = rig
        self._watch = watch
        self._opening: Reading | None = None
        self._page: tuple[int, ...] = ()
        self._passed = 0
        self.pages = self.checks = self.datagrams = 0
        self.since = 0.0

    def check(self) -> list[str]:
        """What does not add up, and still does not a moment later; the link must be without faults meanwhile.

        A machine that stands still between two readings makes them disagree once; a datagram that is not accounted
        for stays so.
        """
        for _ in range(RETRIES):
            if not (found := self._check()):
                return []
            self._watch.wait(RETRY_S)
        self._opening = None  # said once
        return found

    def _check(self) -> list[str]:
        books = self._watch.books()
        self._watch.look()
        lives = self._rig.lives
        if books.master is None or any(lives[side].last is None for side in SIDES):
            return []
        ports = books.master[1], self._rig.slave_address[1]
        drops = socket_queue(ports[0]).drops, socket_queue(ports[1]).drops
        reading = Reading(lives[MASTER].last, lives[SLAVE].last, books.forward, books.backward, drops)
        off = balanced(books.forward) + balanced(books.backward)
        page = (lives[MASTER].pid, lives[SLAVE].pid, books.answers)
        if page != self._page or self._opening is None:
            self._page, self._opening, self.since, self._passed = page, reading, books.at, 0
            self.pages += 1
            return off
        self.checks += 1
        passed = books.forward.passed + books.backward.passed
        passed -= self._opening.forward.passed + self._opening.backward.passed
        self.datagrams += passed - self._passed
        self._passed = passed
        return off + books_agree(self._opening, reading)
