"""The faults that a telemetry record can name, and the ledger of those that a side has met."""

from collections import Counter
from enum import Enum, IntEnum
from typing import Any


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
    """The peer sent what cannot be used; all that was held of it was dropped, and its complete state asked for."""
    UNHEARD = 5
    """The peer is heard, but for longer than the limit it has not heard this side."""
    STALLED = 6
    """This process stood still for longer than the limit; active in the tick that ends the stall."""
    TAKEN_OVER = 7
    """Another master has taken over the robot; this one leaves."""
    TRIPPED = 8
    """The robot touched something with more force than its limit; it backed off and waits for the hand to come out."""
    UNPROVEN = 9
    """There is no session, and a handshake came whose sender did not prove the key."""
    UNFOUNDED = 10
    """Force was to be displayed that the robot's end states no contact for; it was faded out."""
    UNDELIVERED = 11
    """Updates of one direction have not come through for longer than the limit, although the two sides hear each other.
    """
    UNDELIVERED_SECOND = 12
    """The same of the second stream: a tool's orientation or torque, a gripper's angle or torque."""


def name_of(kind: type[Enum], number: Any) -> str:
    """The name of a number of a record, or the number itself where it has none: another release may have written it."""
    try:
        return str(kind(int(number)).name).lower()
    except ValueError:
        return str(number)


# Of several active faults, a record names the first of these.
_RANKED = (
    Fault.DEVICE,
    Fault.TAKEN_OVER,
    Fault.REFUSED,
    Fault.STALLED,
    Fault.TRIPPED,
    Fault.UNFOUNDED,
    Fault.UNPROVEN,
    Fault.SILENCE,
    Fault.UNHEARD,
    Fault.UNDELIVERED,
    Fault.UNDELIVERED_SECOND,
    Fault.UPDATE,
)


class FaultLedger:
    """The faults that are active, and how often each was met."""

    __slots__ = ("_lasting", "_met", "active")

    def __init__(self) -> None:
        self.active = Fault.NONE  # the one to name
        self._lasting: set[Fault] = set()
        self._met: Counter[Fault] = Counter()

    def meet(self, fault: Fault) -> None:
        """Count a fault that lasts until it is cleared."""
        self._lasting.add(fault)
        self._met[fault] += 1
        self._choose()

    def note(self, fault: Fault) -> None:
        """Count a fault that is over at once."""
        self._met[fault] += 1

    def clear(self, *faults: Fault) -> None:
        """End faults, as far as they are active."""
        if self._lasting:
            self._lasting.difference_update(faults)
            self._choose()

    def _choose(self) -> None:
        self.active = next((fault for fault in _RANKED if fault in self._lasting), Fault.NONE)

    @property
    def counts(self) -> dict[str, int]:
        """By name in lower case."""
        return {fault.name.lower(): count for fault, count in self._met.items()}
