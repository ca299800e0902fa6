"""Whether the peer holds our newest update, and when to send it again. Knows no bytes and no clock mapping.

Only the newest update is ever repeated: it carries the whole state, so an older one has no use.
"""

from collections import deque
from math import inf

from weberlink.protocol.sequence import ACKNOWLEDGEMENT_MASK

SHORTEST_PACE = 0.005
LONGEST_PACE = 0.1
EARLY_PER_S = 6.0
"""Updates sent again without evidence of a loss, on average; as many may follow each other after a pause."""
_EVEN_REPEATS = 3
_REMEMBERED = 8


class Repetition:
    """One update in flight.

    An update is overdue on evidence (a datagram that left the peer after the update must have been there, and does not
    acknowledge it) or, where nothing comes from the peer, after a fallback time. Pace, the least time between two
    transmissions of the same update: 5 ms or the round trip if that is longer, doubled with each repeat after the
    third, at most 100 ms (or the round trip).

    Where loss was measured, an update that no newer one has replaced goes out again before there can be evidence, a few
    times, 5 ms apart so that no short burst takes all. These early repeats are for rare updates, which nothing else
    would mend soon: they are paid from an allowance of `EARLY_PER_S`, which a dense stream exhausts.

    So in T seconds one update is repeated at most 10 + T / 0.1 times, and early repeats of all updates number at most
    6 + 6 T.
    """

    __slots__ = ("_allowance", "_allowed_at", "_begun_at", "_count", "_early", "_evidence", "_sent_at", "_sequences")

    def __init__(self) -> None:
        self._sequences: deque[int] = deque(maxlen=_REMEMBERED)
        self._begun_at = -inf
        self._sent_at = -inf
        self._count = 0
        self._evidence = False
        self._early = 0
        self._allowance = EARLY_PER_S
        self._allowed_at = -inf

    @property
    def is_pending(self) -> bool:
        """Whether there is an update that is not known to have arrived."""
        return bool(self._sequences)

    @property
    def sent_at(self) -> float:
        """When the update was last sent [s]."""
        return self._sent_at

    def begin(self, sequence: int, now: float, copies: int = 0) -> None:
        """A new update was sent; any older one no longer matters.

        Args:
            sequence: number of its datagram.
            now: [s].
            copies: how many early repeats it is worth.
        """
        self._sequences.clear()
        self._sequences.append(sequence & ACKNOWLEDGEMENT_MASK)
        self._count = 0
        self._begun_at = self._sent_at = now
        self._evidence = False
        self._allow(now)
        self._early = min(copies, int(self._allowance))

    def repeated(self, sequence: int, now: float) -> None:
        self._sequences.append(sequence & ACKNOWLEDGEMENT_MASK)
        if self._early:
            self._early -= 1
            self._allow(now)
            self._allowance -= 1.0
        else:
            self._count += 1
        self._sent_at = now
        self._evidence = False

    def _allow(self, now: float) -> None:
        self._allowance = min(EARLY_PER_S, self._allowance + EARLY_PER_S * min(1.0, now - self._allowed_at))
        self._allowed_at = now

    def acknowledge(self, ack: int) -> bool:
        """Take the acknowledgement of any datagram; True if the update has arrived."""
        if ack in self._sequences:
            self._sequences.clear()
        return not self._sequences

    def is_late(self, now: float, limit: float) -> bool:
        """Whether the update is pending although it was first sent longer ago than the limit [s]."""
        return self.is_pending and now - self._begun_at > limit

    def abandon(self) -> None:
        """Repeat the update no more."""
        self._sequences.clear()

    def miss(self) -> None:
        """The peer was heard after the update must have arrived, and does not have it."""
        self._evidence = True

    def due_at(self, rtt: float, fallback: float) -> float:
        """When to send it again [s]; infinity if there is no need.

        Args:
            rtt: measured round trip [s].
            fallback: how long to wait for evidence [s].
        """
        if not self._sequences:
            return inf
        if self._early:
            return self._sent_at + SHORTEST_PACE
        pace = max(SHORTEST_PACE, rtt)
        if self._count >= _EVEN_REPEATS:
            pace = min(pace * 2.0 ** min(self._count + 1 - _EVEN_REPEATS, 10), max(LONGEST_PACE, rtt))
        return self._sent_at + (pace if self._evidence else max(pace, fallback))
