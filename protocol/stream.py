"""One stream of our updates: the newest one, and its way to the peer. Knows no bytes of a datagram and no clock."""

from typing import NamedTuple

from protocol.repetition import Repetition
from protocol.sequence import ACKNOWLEDGEMENT_MASK
from protocol.wire import UpdateLayout


class PendingUpdate(NamedTuple):
    """What the peer is to hold; fields as in `protocol.events.UpdateReceived`."""

    tick: int
    selector: int
    newest: tuple[int, ...]
    gap: int
    previous: tuple[int, ...]


class Stream:
    """The state to be held by the peer, and whether it is.

    Attributes:
        layout: of the updates.
        update: the newest; None before the first.
        repetition: of it.
    """

    __slots__ = ("_last_ack", "layout", "repetition", "update")

    def __init__(self, layout: UpdateLayout) -> None:
        self.layout = layout
        self.update: PendingUpdate | None = None
        self.repetition = Repetition()
        self._last_ack = 0

    def would_mistake(self, sequence: int) -> bool:
        """Whether an acknowledgement 2^16 datagrams old would look like one of an update of this number."""
        return sequence & ACKNOWLEDGEMENT_MASK == self._last_ack

    def acknowledge(self, ack: int) -> bool:
        """Take an acknowledgement of this stream; False if the newest update is not known to have arrived."""
        self._last_ack = ack
        return not self.repetition.is_pending or self.repetition.acknowledge(ack)
