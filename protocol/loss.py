"""Loss measured from gaps in sequence numbers, and how many copies of an update it takes. Knows no clock."""

from math import ceil, log

PATIENCE = 3
"""A number is missing once this many later ones were seen (the packet threshold of RFC 9002): swaps do not count."""
_MEMORY = 256
_MASK = (1 << _MEMORY) - 1
_RATES = (1 / 32, 1 / 1024)

LOSSY = 0.001
"""Measured loss above which a link counts as lossy."""
MOST_COPIES = 3
RESIDUAL = 0.02
"""Share of updates that may stay lost although they were sent again early."""


class LossMeter:
    """Counts missing sequence numbers and estimates the present share of them.

    Two exponential averages over the sequence, one over about 32 numbers and one over about 1024; the larger counts,
    so the estimate rises within a burst and still remembers one loss in a thousand. A number that turns up after it was
    judged missing is taken back from the count and, the averages being linear, exactly from both of them.
    """

    __slots__ = ("_fast", "_lost", "_newest", "_seen", "_slow")

    def __init__(self) -> None:
        self._newest: int | None = None
        self._seen = _MASK  # nothing before the first number is held against the link
        self._lost = 0
        self._fast = 0.0
        self._slow = 0.0

    @property
    def lost(self) -> int:
        return self._lost

    @property
    def fraction(self) -> float:
        """Share of recent datagrams that were lost, 0..1."""
        return self._fast if self._fast > self._slow else self._slow

    def record(self, sequence: int) -> int:
        """Take note of a number that was not recorded before; returns the change of `lost`."""
        before = self._lost
        if self._newest is None:
            self._newest = sequence
        elif sequence > self._newest:
            self._advance(sequence - self._newest)
            self._newest = sequence
        else:
            self._fill(self._newest - sequence)
        return self._lost - before

    def _advance(self, step: int) -> None:
        if step == 1 and self._seen >> (PATIENCE - 1) & 1:  # nearly always
            self._fast *= 1.0 - _RATES[0]
            self._slow *= 1.0 - _RATES[1]
            self._seen = ((self._seen << 1) | 1) & _MASK
            return
        for index in range(PATIENCE - 1, max(PATIENCE - 1 - step, -1), -1):
            self._judge(1, missing=not self._seen >> index & 1)
        if step > PATIENCE:
            self._judge(step - PATIENCE, missing=True)
        self._seen = ((self._seen << step) | 1) & _MASK if step < _MEMORY else 1

    def _judge(self, count: int, *, missing: bool) -> None:
        target = 1.0 if missing else 0.0
        self._lost += count if missing else 0
        self._fast = target + (self._fast - target) * (1.0 - _RATES[0]) ** count
        self._slow = target + (self._slow - target) * (1.0 - _RATES[1]) ** count

    def _fill(self, behind: int) -> None:
        if behind >= _MEMORY or self._seen >> behind & 1:
            return
        self._seen |= 1 << behind
        since = behind - PATIENCE
        if since >= 0:
            self._lost -= 1
            self._fast = max(0.0, self._fast - _RATES[0] * (1.0 - _RATES[0]) ** since)
            self._slow = max(0.0, self._slow - _RATES[1] * (1.0 - _RATES[1]) ** since)


def copies_needed(loss: float) -> int:
    """How often to send an update again without being asked, so that at most `RESIDUAL` of them are lost for good.

    0 to `MOST_COPIES`; 0 where the link does not count as lossy.
    """
    if loss <= LOSSY:
        return 0
    return MOST_COPIES if loss >= 1.0 else max(0, min(MOST_COPIES, ceil(log(RESIDUAL) / log(loss) - 1e-9) - 1))
