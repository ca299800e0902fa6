"""The layouts of all datagrams that go one way in a session."""

from collections.abc import Collection, Sequence
from itertools import chain, repeat

from weberlink.protocol.wire import (
    ACK_BYTES,
    CHANGE_TICK_BYTES,
    HEAD_BYTES,
    HEARTBEAT_BYTES,
    HEARTBEAT_CREDIT_BYTES,
    LONGEST_CHANGE,
    LONGEST_REASON,
    MARK,
    TOKEN_BYTES,
    UPDATE_KINDS,
    Kind,
    UpdateLayout,
)


class Direction:
    """The layouts of all datagrams of one direction: one for the updates of each stream, and what they have in common.

    Attributes:
        updates: by stream.
        carries_credit: whether each update and heartbeat carries the sender's.
        further_acks: how many streams of the other direction each of them acknowledges beside the first.
    """

    __slots__ = ("carries_credit", "further_acks", "updates")

    def __init__(
        self,
        values: Sequence[int],
        *,
        carries_credit: bool = False,
        further_acks: int = 0,
        parametric: Sequence[Collection[int]] = (),
    ) -> None:
        """Prepare for streams whose samples have `values` levels each; `parametric` as for `UpdateLayout`, by stream.

        Raises:
            ValueError: for no stream or more than there are kinds of updates, or for a sample that fits no datagram.
        """
        if not 1 <= len(values) <= len(UPDATE_KINDS):
            raise ValueError(f"a direction has 1 to {len(UPDATE_KINDS)} streams of values, not {len(values)}")
        self.carries_credit = carries_credit
        self.further_acks = further_acks
        self.updates = tuple(
            UpdateLayout(
                count, carries_credit=carries_credit, further_acks=further_acks, kind=kind, parametric=selectors
            )
            for count, kind, selectors in zip(values, UPDATE_KINDS, chain(parametric, repeat(())), strict=False)
        )

    def lengths(self, tag_size: int) -> dict[int, tuple[int, int]]:
        """Shortest and longest datagram of each shape (kind and mark) that a peer of these layouts sends."""
        bye = HEAD_BYTES + tag_size
        credit = HEARTBEAT_CREDIT_BYTES if self.carries_credit else 0
        heartbeat = HEARTBEAT_BYTES + credit + ACK_BYTES * self.further_acks + tag_size
        change = bye + CHANGE_TICK_BYTES
        path = bye + TOKEN_BYTES
        updates = {
            kind | mark: (layout.size(with_previous=bool(mark)) + tag_size,) * 2
            for layout, kind in zip(self.updates, UPDATE_KINDS, strict=False)
            for mark in (0, MARK)
        }
        return updates | {
            Kind.HEARTBEAT: (heartbeat, heartbeat),
            Kind.HEARTBEAT | MARK: (heartbeat, heartbeat),
            Kind.BYE: (bye, bye + LONGEST_REASON),
            Kind.CHANGE: (change + 1, change + LONGEST_CHANGE),
            Kind.CHANGE | MARK: (change + 1, change + LONGEST_CHANGE),
            Kind.PATH: (path, path),
            Kind.PATH | MARK: (path, path),
        }
