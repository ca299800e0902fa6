"""A cumulative count that each end hands to the other, in every datagram. Does not interpret it.

It only ever grows, so a lost datagram delays knowledge and loses none. It travels truncated: 16 bits in an update, 32
in a heartbeat. Whoever spends what it counts must never be told of more than was handed over, whatever the link does:
the receiver listens only to datagrams that left after the newest one it has listened to. Their true count is at least
the one known, and the least such number that fits the truncated field is at most the true one: exact if less than the
range of the field was handed over unheard, too low otherwise, until a longer field arrives.
"""

UPDATE_BITS = 16
HEARTBEAT_BITS = 32


class Credit:
    """The counts of both directions of one session.

    Attributes:
        known: the largest count known to have been handed over by the peer.
    """

    __slots__ = ("_handed", "_newest", "known")

    def __init__(self) -> None:
        self._handed = 0
        self._newest = -1
        self.known = 0

    @property
    def handed(self) -> int:
        """What was handed to the peer so far."""
        return self._handed

    @handed.setter
    def handed(self, count: int) -> None:
        if count < self._handed:
            raise ValueError(f"credit is cumulative: it cannot fall from {self._handed} to {count}")
        self._handed = count

    def learn(self, sequence: int, truncated: int, bits: int) -> None:
        """Take the count of the datagram with that full sequence number; one from an older datagram says nothing."""
        if sequence > self._newest:
            self._newest = sequence
            self.known += (truncated - self.known) & ((1 << bits) - 1)
