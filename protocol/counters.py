"""Counters that travel truncated: expand them, reject repeated ones, and measure loss and bursts from their gaps."""

from typing import Final

REPLAY_WINDOW: Final = 1024  # datagrams that may be overtaken and still be accepted: a second of reordering at 1 kHz
_REPLAY_MASK: Final = (1 << REPLAY_WINDOW) - 1

LOSS_PATIENCE: Final = 3
"""A number is missing once this many later ones were seen (the packet threshold of RFC 9002): swaps do not count."""
_LOSS_MEMORY: Final = 256
_LOSS_MASK: Final = (1 << _LOSS_MEMORY) - 1
_FAST: Final = 1 / 32
_SLOW: Final = 1 / 1024
# Average below which the bursts are too few for a mean: one or two blackouts make no bursty link.
_LEAST_BURSTS: Final = 2.5 * _SLOW


def expand(truncated: int, bits: int, near: int) -> int:
    """The number congruent to `truncated` modulo 2^bits that lies nearest to `near` (RFC 9000, appendix A.3).

    It is right if `near` is off by less than half of what the truncated field can count. It may be negative; of a
    counter that starts from 0, `near` is at least half the range, so that it is not."""
    half = 1 << (bits - 1)
    return near - half + ((truncated - near + half) & ((1 << bits) - 1))


class ReplayWindow:
    """Accepts each sequence number once (sliding window, RFC 6479). Use it only for authentic datagrams. `newest` is
    the highest number accepted, -1 before the first."""

    def __init__(self) -> None:
        self.newest = -1
        self._seen = 0

    def accept(self, sequence: int) -> bool:
        """Whether the number comes for the first time; one that has left the window counts as a repeated one."""
        ahead = sequence - self.newest
        if ahead > 0:
            self._seen = ((self._seen << ahead) | 1) & _REPLAY_MASK if ahead < REPLAY_WINDOW else 1
            self.newest = sequence
            return True
        if -ahead >= REPLAY_WINDOW or self._seen >> -ahead & 1:
            return False
        self._seen |= 1 << -ahead
        return True


class LossMeter:
    """Counts missing sequence numbers (`lost`), and estimates the share of recent ones that are (`fraction`, 0..1).

    Two exponential averages over the sequence, one over about 32 numbers and one over about 1024; the larger counts, so
    the estimate rises within a burst and still remembers one loss in a thousand. The bursts of about 1024 numbers are
    averaged too. A number that arrives after it was judged missing is subtracted again from the count and, since the
    averages are linear, exactly from all of them."""

    def __init__(self) -> None:
        self.lost = 0
        self.fraction = 0.0
        self._newest = -1
        self._seen = _LOSS_MASK  # numbers before the first one do not count as lost
        self._fast = 0.0
        self._slow = 0.0
        self._begun = 0.0  # the slow average of the numbers with which a burst begins

    @property
    def burst(self) -> float:
        """Mean length of the recent bursts, at least 1; 0 while fewer than three are known."""
        return max(1.0, self._slow / self._begun) if self._begun > _LEAST_BURSTS else 0.0

    def record(self, sequence: int) -> int:
        """Record a number for the first time; returns the change of `lost`."""
        before, step = self.lost, sequence - self._newest
        if self._newest < 0:
            self._newest = sequence
        elif step == 1 and self._seen >> (LOSS_PATIENCE - 1) & 1:  # nearly always
            self._newest = sequence
            self._fast *= 1.0 - _FAST
            self._slow *= 1.0 - _SLOW
            self._begun *= 1.0 - _SLOW
            self._seen = ((self._seen << 1) | 1) & _LOSS_MASK
        elif step > 0:
            self._newest = sequence
            for index in range(LOSS_PATIENCE - 1, max(LOSS_PATIENCE - 1 - step, -1), -1):
                self._judge(1, missing=not self._seen >> index & 1, begins=bool(self._seen >> index + 1 & 1))
            if step > LOSS_PATIENCE:
                self._judge(step - LOSS_PATIENCE, missing=True, begins=True)
            self._seen = ((self._seen << step) | 1) & _LOSS_MASK if step < _LOSS_MEMORY else 1
        elif -step < _LOSS_MEMORY and not self._seen >> -step & 1:
            self._fill(-step)
        self.fraction = self._fast if self._fast > self._slow else self._slow
        return self.lost - before

    def _judge(self, count: int, *, missing: bool, begins: bool) -> None:
        """Judge the next `count` numbers; `begins` if the one before them was not missing."""
        target = 1.0 if missing else 0.0
        self.lost += count if missing else 0
        self._fast = target + (self._fast - target) * (1.0 - _FAST) ** count
        self._slow = target + (self._slow - target) * (1.0 - _SLOW) ** count
        self._begun *= (1.0 - _SLOW) ** count
        if missing and begins:
            self._begun += _weight(count - 1)

    def _fill(self, behind: int) -> None:
        """Correct the averages for a number that was judged missing, and has arrived."""
        self._seen |= 1 << behind
        since = behind - LOSS_PATIENCE
        if since < 0:
            return
        self.lost -= 1
        self._fast = max(0.0, self._fast - _FAST * (1.0 - _FAST) ** since)
        self._slow = max(0.0, self._slow - _weight(since))
        begun = self._begun
        if self._seen >> behind + 1 & 1:
            begun -= _weight(since)
        if since > 0 and not self._seen >> behind - 1 & 1:
            begun += _weight(since - 1)
        self._begun = max(0.0, begun)


def _weight(since: int) -> float:
    """What a number that was judged that many numbers ago has in a slow average."""
    return _SLOW * (1.0 - _SLOW) ** since


class Credit:
    """A cumulative count that each end grants to the other in every datagram: what was `granted`, and what the peer is
    `known` to have granted.

    It only grows, so a lost datagram delays knowledge and loses none. The receiver must never believe in more than was
    granted. It therefore reads only datagrams newer than the newest one it has read: the true count is then at least
    the known one, and the least number that fits the truncated field is at most the true one. It is exact unless a
    whole range of the field was granted unheard; then it is too low until a longer field arrives."""

    def __init__(self) -> None:
        self.granted = 0
        self.known = 0
        self._newest = -1

    def grant(self, count: int) -> None:
        """Grant so much to the peer; ValueError if it would fall."""
        if count < self.granted:
            raise ValueError(f"credit is cumulative: it cannot fall from {self.granted} to {count}")
        self.granted = count

    def learn(self, sequence: int, truncated: int, bits: int) -> None:
        """Read the count of the datagram with that full sequence number; an older datagram is ignored."""
        if sequence > self._newest:
            self._newest = sequence
            self.known += (truncated - self.known) & ((1 << bits) - 1)
