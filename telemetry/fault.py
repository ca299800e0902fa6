"""The faults that a record can name, as both sides number them, and the ledger of those a side has met."""

from collections import Counter
from enum import IntEnum


class Fault(IntEnum):
    """What keeps a side from its work at this tick; 0 for nothing."""

    NONE = 0
    SILENCE = 1
    """Nothing heard from the peer for longer than the limit."""
    DEVICE = 2
    """The own device or robot gave no usable sample for longer than the limit; the side leaves the session."""
    REFUSED = 3
    """The peer runs another configuration or version."""
    UPDATE = 4
    """The peer sent an update that does not fit the channel; it was not applied."""


class FaultLedger:
    """The fault that is active, and how often each was met."""

    __slots__ = ("_met", "active")

    def __init__(self) -> None:
        self.active = Fault.NONE
        self._met: Counter[Fault] = Counter()

    def meet(self, fault: Fault) -> None:
        """Count a fault that lasts until it is cleared."""
        self.active = fault
        self._met[fault] += 1

    def note(self, fault: Fault) -> None:
        """Count a fault that is over at once."""
        self._met[fault] += 1

    def clear(self, fault: Fault) -> None:
        """End a fault, if it is the active one."""
        if self.active is fault:
            self.active = Fault.NONE

    @property
    def counts(self) -> dict[str, int]:
        """By name in lower case."""
        return {fault.name.lower(): count for fault, count in self._met.items()}
