"""Sliding window of the sequence numbers already received (RFC 6479 in spirit). Knows no keys: ask it after the tag."""

WINDOW = 1024
"""Datagrams that may be overtaken and still be accepted: a second of reordering at 1 kHz."""
_MASK = (1 << WINDOW) - 1


class ReplayWindow:
    """Accepts each sequence number once."""

    __slots__ = ("_newest", "_seen")

    def __init__(self) -> None:
        self._newest = -1
        self._seen = 0

    @property
    def newest(self) -> int:
        """Highest number marked; -1 before the first."""
        return self._newest

    def is_new(self, sequence: int) -> bool:
        """Whether the number was never marked; one that has left the window counts as marked."""
        behind = self._newest - sequence
        return behind < 0 or (behind < WINDOW and not self._seen >> behind & 1)

    def mark(self, sequence: int) -> None:
        """Remember a number for which `is_new` holds."""
        behind = self._newest - sequence
        if behind >= 0:
            self._seen |= 1 << behind
            return
        self._seen = ((self._seen << -behind) | 1) & _MASK if -behind < WINDOW else 1
        self._newest = sequence
