"""One stream of our updates: the newest one, and its way to the peer. Knows no bytes of a datagram and no clock."""

from weberlink.protocol.repetition import Repetition
from weberlink.protocol.sequence import ACKNOWLEDGEMENT_MASK
from weberlink.protocol.wire import UpdateLayout
from weberlink.update import Update


class Stream:
    """The state to be held by the peer, and whether it is.

    Attributes:
        layout: of the updates.
        update: the newest; None before the first.
        repetition: of it.
        is_forgotten: whether the peer has said that it holds the newest update no more.
    """

    __slots__ = ("_last_ack", "is_forgotten", "layout", "repetition", "update")

    def __init__(self, layout: UpdateLayout) -> None:
        self.layout = layout
        self.update: Update | None = None
        self.repetition = Repetition()
        self.is_forgotten = False
        self._last_ack = 0

    def would_mistake(self, sequence: int) -> bool:
        """Whether an acknowledgement of nothing, or one 2^16 datagrams old, would look like one of this number."""
        return sequence & ACKNOWLEDGEMENT_MASK in (0, self._last_ack)

    def acknowledge(self, ack: int, *, is_newest: bool) -> bool:
        """Take an acknowledgement of this stream; False if the newest update is not known to have arrived.

        A peer that acknowledges nothing after it had acknowledged the newest update has forgotten it.
        """
        self._last_ack = ack
        if self.repetition.is_pending:
            return self.repetition.acknowledge(ack)
        self.is_forgotten |= is_newest and ack == 0 and self.update is not None
        return True
