"""Counters that travel truncated: expand them, reject repeated ones, and measure loss and bursts from their gaps."""

from typing import Final

SEQUENCE_BITS: Final = 16
"""A number is expanded from what came last, so an outage may take up to 2^15 of them. In the longest that a session
outlives, an end sends far fewer: a silent one sends heartbeats only."""
SEQUENCE_MASK: Final = (1 << SEQUENCE_BITS) - 1
ACKNOWLEDGEMENT_BITS: Final = 16
ACKNOWLEDGEMENT_MASK: Final = (1 << ACKNOWLEDGEMENT_BITS) - 1

REPLAY_WINDOW: Final = 1024
"""Datagrams that may be overtaken and still be accepted: a second of reordering at 1 kHz."""
_REPLAY_MASK: Final = (1 << REPLAY_WINDOW) - 1

LOSS_PATIENCE: Final = 3
"""A number is missing once this many later ones were seen (the packet threshold of RFC 9002): swaps do not count."""
_LOSS_MEMORY: Final = 256
_LOSS_MASK: Final = (1 << _LOSS_MEMORY) - 1
_LOSS_RATES = (1 / 32, 1 / 1024)
_LEAST_BURSTS = 2.5 * _LOSS_RATES[1]
"""Average below which the bursts are too few for a mean: one or two blackouts make no bursty link."""


def expand(truncated: int, bits: int, near: int) -> int:
    """The number congruent to `truncated` modulo 2^bits that lies nearest to `near` (RFC 9000, appendix A.3).

    It may be negative. It is right if `near` is off by less than half of what the truncated field can count.
    """
    half = 1 << (bits - 1)
    return near - half + ((truncated - near + half) & ((1 << bits) - 1))


def int16(number: int) -> int:
    """The number modulo 2^16, from -2^15 to 2^15 - 1."""
    return (number + 0x8000 & 0xFFFF) - 0x8000


def expand_counter(truncated: int, bits: int, near: int) -> int:
    """Like `expand`, for counters that start from 0."""
    full = expand(truncated, bits, near)
    return full if full >= 0 else full + (1 << bits)


class ReplayWindow:
    """Accepts each sequence number once (sliding window, RFC 6479). Use it only for authentic datagrams. `newest` is
    the highest number marked, -1 before the first."""

    def __init__(self) -> None:
        self.newest = -1
        self._seen = 0

    def is_new(self, sequence: int) -> bool:
        """Whether the number was never marked; one that has left the window counts as marked."""
        behind = self.newest - sequence
        return behind < 0 or (behind < REPLAY_WINDOW and not self._seen >> behind & 1)

    def mark(self, sequence: int) -> None:
        """Remember a number for which `is_new` holds."""
        behind = self.newest - sequence
        if behind >= 0:
            self._seen |= 1 << behind
            return
        self._seen = ((self._seen << -behind) | 1) & _REPLAY_MASK if -behind < REPLAY_WINDOW else 1
        self.newest = sequence


class LossMeter:
    """Counts missing sequence numbers (`lost`) and estimates the present loss rate.

    Two exponential averages over the sequence, one over about 32 numbers and one over about 1024; the larger counts, so
    the estimate rises within a burst and still remembers one loss in a thousand. The bursts of about 1024 numbers are
    averaged too. A number that arrives after it was judged missing is subtracted again from the count and, since the
    averages are linear, exactly from all of them."""

    def __init__(self) -> None:
        self.lost = 0
        self._newest: int | None = None
        self._seen = _LOSS_MASK  # numbers before the first one do not count as lost
        self._fast = 0.0
        self._slow = 0.0
        self._begun = 0.0  # the slow average of the numbers with which a burst begins

    @property
    def fraction(self) -> float:
        """Share of recent datagrams that were lost, 0..1."""
        return self._fast if self._fast > self._slow else self._slow

    @property
    def burst(self) -> float:
        """Mean length of the recent bursts, at least 1; 0 while fewer than three are known."""
        return max(1.0, self._slow / self._begun) if self._begun > _LEAST_BURSTS else 0.0

    def record(self, sequence: int) -> int:
        """Record a number for the first time; returns the change of `lost`."""
        before = self.lost
        if self._newest is None:
            self._newest = sequence
        elif sequence > self._newest:
            self._advance(sequence - self._newest)
            self._newest = sequence
        else:
            self._fill(self._newest - sequence)
        return self.lost - before

    def _advance(self, step: int) -> None:
        if step == 1 and self._seen >> (LOSS_PATIENCE - 1) & 1:  # nearly always
            self._fast *= 1.0 - _LOSS_RATES[0]
            self._slow *= 1.0 - _LOSS_RATES[1]
            self._begun *= 1.0 - _LOSS_RATES[1]
            self._seen = ((self._seen << 1) | 1) & _LOSS_MASK
            return
        for index in range(LOSS_PATIENCE - 1, max(LOSS_PATIENCE - 1 - step, -1), -1):
            self._judge(1, missing=not self._seen >> index & 1, begins=bool(self._seen >> index + 1 & 1))
        if step > LOSS_PATIENCE:
            self._judge(step - LOSS_PATIENCE, missing=True, begins=True)
        self._seen = ((self._seen << step) | 1) & _LOSS_MASK if step < _LOSS_MEMORY else 1

    def _judge(self, count: int, *, missing: bool, begins: bool) -> None:
        """Judge the next `count` numbers; `begins` if the one before them was not missing."""
        target = 1.0 if missing else 0.0
        self.lost += count if missing else 0
        self._fast = target + (self._fast - target) * (1.0 - _LOSS_RATES[0]) ** count
        self._slow = target + (self._slow - target) * (1.0 - _LOSS_RATES[1]) ** count
        self._begun *= (1.0 - _LOSS_RATES[1]) ** count
        if missing and begins:
            self._begun += _weight(count - 1)

    def _fill(self, behind: int) -> None:
        if behind >= _LOSS_MEMORY or self._seen >> behind & 1:
            return
        self._seen |= 1 << behind
        since = behind - LOSS_PATIENCE
        if since >= 0:
            self.lost -= 1
            self._fast = max(0.0, self._fast - _LOSS_RATES[0] * (1.0 - _LOSS_RATES[0]) ** since)
            self._slow = max(0.0, self._slow - _weight(since))
            self._split(behind, since)

    def _split(self, behind: int, since: int) -> None:
        """Correct the bursts for a number that was judged missing, and has arrived."""
        begun = self._begun
        if self._seen >> behind + 1 & 1:
            begun -= _weight(since)
        if since > 0 and not self._seen >> behind - 1 & 1:
            begun += _weight(since - 1)
        self._begun = max(0.0, begun)


def _weight(since: int) -> float:
    """What a number that was judged that many numbers ago has in a slow average."""
    return _LOSS_RATES[1] * (1.0 - _LOSS_RATES[1]) ** since


class Credit:
    """A cumulative count that each end grants to the other in every datagram, for both directions of a session.

    It only grows, so a lost datagram delays knowledge and loses none. The receiver must never believe in more than was
    granted. It therefore reads only datagrams newer than the newest one it has read: the true count is then at least
    the known one, and the least number that fits the truncated field is at most the true one. It is exact unless a
    whole range of the field was granted unheard; then it is too low until a longer field arrives."""

    def __init__(self) -> None:
        self._granted = 0
        self._newest = -1
        self.known = 0

    @property
    def granted(self) -> int:
        """The count granted to the peer so far."""
        return self._granted

    @granted.setter
    def granted(self, count: int) -> None:
        if count < self._granted:
            raise ValueError(f"credit is cumulative: it cannot fall from {self._granted} to {count}")
        self._granted = count

    def learn(self, sequence: int, truncated: int, bits: int) -> None:
        """Read the count of the datagram with that full sequence number; an older datagram is ignored."""
        if sequence > self._newest:
            self._newest = sequence
            self.known += (truncated - self.known) & ((1 << bits) - 1)
