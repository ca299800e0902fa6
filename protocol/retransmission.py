"""The newest update of each stream: whether the peer holds it, and when to send it again.

Only the newest update is ever repeated: it carries the whole state, so an older one has no use.
"""

from collections import deque
from math import ceil, inf, log
from typing import Final

from weberlink.protocol.counters import ACKNOWLEDGEMENT_MASK
from weberlink.protocol.wire import UpdateLayout
from weberlink.update import Update

SHORTEST_PACE: Final = 0.005
LONGEST_PACE: Final = 0.1
EARLY_PER_S: Final = 6.0
"""Updates sent again without evidence of a loss, on average; as many may follow each other after a pause."""
_EVEN_REPEATS: Final = 3
_REMEMBERED: Final = 8

LOSSY: Final = 0.001
"""Measured loss above which a link counts as lossy."""
MOST_COPIES: Final = 3
RESIDUAL: Final = 0.02
"""Share of updates that may stay lost although they were sent again early."""


def copies_needed(loss: float) -> int:
    """How often to send an update again before there is evidence of a loss, so that at most `RESIDUAL` are lost.

    0 to `MOST_COPIES`; 0 where the link does not count as lossy.
    """
    if loss <= LOSSY:
        return 0
    return MOST_COPIES if loss >= 1.0 else max(0, min(MOST_COPIES, ceil(log(RESIDUAL) / log(loss) - 1e-9) - 1))


class Retransmission:
    """Times at which one pending update is sent again.

    An update is overdue on evidence (a datagram that left the peer after the update must have arrived does not
    acknowledge it) or, where nothing comes from the peer, after a fallback time. Pace, the least time between two
    transmissions of the same update: 5 ms or the round trip if that is longer, doubled with each repeat after the
    third, at most 100 ms (or the round trip).

    On a lossy link an update is also sent again before there can be evidence, a few times, 5 ms apart so that one short
    burst does not take all. These early repeats serve rare updates, which no newer one would replace soon: they are
    paid from an allowance of `EARLY_PER_S`, which a dense stream exhausts.

    So in T seconds one update is repeated at most 10 + T / 0.1 times, and early repeats of all updates number at most
    6 + 6 T.

    Attributes:
        sent_at: when the update was last sent [s].
    """

    def __init__(self) -> None:
        self._sequences: deque[int] = deque(maxlen=_REMEMBERED)
        self._begun_at = -inf
        self.sent_at = -inf
        self._count = 0
        self._evidence = False
        self._early = 0
        self._allowance = EARLY_PER_S
        self._allowed_at = -inf

    @property
    def is_pending(self) -> bool:
        """Whether there is an update that is not known to have arrived."""
        return bool(self._sequences)

    def begin(self, sequence: int, now: float, copies: int = 0) -> None:
        """A new update was sent, and replaces any older one.

        Args:
            sequence: number of its datagram.
            now: [s].
            copies: early repeats, as far as the allowance goes.
        """
        sequences = self._sequences
        sequences.clear()
        sequences.append(sequence & ACKNOWLEDGEMENT_MASK)
        self._count = 0
        self._begun_at = self.sent_at = now
        self._evidence = False
        self._allow(now)
        self._early = min(copies, int(self._allowance)) if copies else 0

    def repeated(self, sequence: int, now: float) -> None:
        """The update was sent again in the datagram of that number."""
        self._sequences.append(sequence & ACKNOWLEDGEMENT_MASK)
        if self._early:
            self._early -= 1
            self._allow(now)
            self._allowance -= 1.0
        else:
            self._count += 1
        self.sent_at = now
        self._evidence = False

    def _allow(self, now: float) -> None:
        passed = now - self._allowed_at
        allowance = self._allowance + EARLY_PER_S * (passed if passed < 1.0 else 1.0)
        self._allowance = allowance if allowance < EARLY_PER_S else EARLY_PER_S
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
        """Time of the next repeat [s]; infinity if there is no need.

        Args:
            rtt: measured round trip [s].
            fallback: how long to wait for evidence [s].
        """
        if not self._sequences:
            return inf
        if self._early:
            return self.sent_at + SHORTEST_PACE
        pace = max(SHORTEST_PACE, rtt)
        if self._count >= _EVEN_REPEATS:
            pace = min(pace * 2.0 ** min(self._count + 1 - _EVEN_REPEATS, 10), max(LONGEST_PACE, rtt))
        return self.sent_at + (pace if self._evidence else max(pace, fallback))


class OutgoingStream:
    """One stream of our updates.

    Attributes:
        layout: of the updates.
        update: the newest; None before the first.
        retransmission: of it.
        is_forgotten: whether the peer has said that it no longer holds the newest update.
    """

    def __init__(self, layout: UpdateLayout) -> None:
        self.layout = layout
        self.update: Update | None = None
        self.retransmission = Retransmission()
        self.is_forgotten = False
        self._last_ack = 0
        self._acknowledged_by = -1

    def is_ambiguous(self, sequence: int) -> bool:
        """Whether this number would be confused with an acknowledgement of nothing, or of 2^16 datagrams ago."""
        truncated = sequence & ACKNOWLEDGEMENT_MASK
        return truncated == 0 or truncated == self._last_ack  # noqa: PLR1714 - a tuple costs more

    def acknowledge(self, sequence: int, ack: int | None, *, is_newest: bool) -> bool:
        """Take the acknowledgement in a datagram; False if the newest update is not known to have arrived.

        A peer that acknowledges nothing after it had acknowledged the newest update has forgotten it.

        Args:
            sequence: number of the datagram.
            ack: None if it has none, so that the newest one still holds.
            is_newest: whether no later datagram came before it.
        """
        if ack is None:
            if not is_newest:
                return True
            ack = self._last_ack
        elif sequence > self._acknowledged_by:
            self._last_ack, self._acknowledged_by = ack, sequence
        if self.retransmission.is_pending:
            return self.retransmission.acknowledge(ack)
        self.is_forgotten |= is_newest and ack == 0 and self.update is not None
        return True
