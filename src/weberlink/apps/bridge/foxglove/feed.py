"""The feed of a watched session whose records the follower has read already."""

from typing import Any

import numpy as np

from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import DTYPE
from weberlink.watching.rings import RingFeed, joined


class FollowedFeed:
    """A `weberlink.watching.rings.Feed` that is handed its records.

    Args:
        source: what the follower reads.
    """

    def __init__(self, source: RingFeed) -> None:
        self._source = source
        self.side = source.side
        self.rate_hz = source.rate_hz
        self.began = source.began
        self.description: dict[str, Any] | None = source.description
        self.ring = source.ring
        self.wall_offset_s = source.wall_offset_s
        self.in_order = False
        self.drained = False
        self.written = 0
        self.lost = 0
        self._over = False
        self._waiting: list[Records] = []

    def put(self, records: Records) -> None:
        """Records that the follower has read."""
        self._waiting.append(records)
        self.written, self.lost = self._source.written, self._source.lost

    def end(self) -> None:
        """The writer has ended, and all its records were put."""
        self._over, self.in_order = True, self._source.in_order

    def read(self) -> Records:
        """The records since the last call."""
        waiting, self._waiting = self._waiting, []
        self.drained = self._over
        return joined(waiting) if waiting else np.empty(0, DTYPE)

    def close(self) -> None:
        """The follower closes the source."""
