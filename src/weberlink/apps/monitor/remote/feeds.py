"""Records received from another host, as feeds of a session."""

from collections import deque
from pathlib import Path
from typing import Any

import numpy as np

from weberlink.apps.monitor.remote.messages import RecordBlock, SideIntroduction
from weberlink.apps.monitor.rings import joined
from weberlink.protocol.sealed_stream import StreamError
from weberlink.protocol.states import State
from weberlink.system.scoring.session import LATEST_S, Records
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import FINITE

RECENT_S = 5.0
"""How far back a new feed begins."""
WAITING_S = 20.0
"""How many records wait to be read; older ones are dropped."""


class RemoteSide:
    """A side of a session on another host: checks its records and drops those received before.

    Args:
        introduction: how the side was introduced.
    """

    def __init__(self, introduction: SideIntroduction) -> None:
        self.introduction = introduction
        self.ended = False
        self.written = 0
        self.lost = 0
        self.newest: Any = None
        """The newest record; None before the first."""
        self._feed: RemoteFeed | None = None
        self._recent: deque[Records] = deque()
        self._lost_before = 0
        self._gaps = 0
        self._bank, self._torque_bank = (_count(introduction, bank) for bank in ("bank", "torque_bank"))

    def push(self, block: RecordBlock) -> None:
        """Take records; after a reconnection they may begin with known ones.

        Raises:
            StreamError: no daemon writes such records.
        """
        records = block.records
        self._check(records)
        if self.newest is None:
            self._lost_before = block.lost
        else:
            records = records[records["at"] > self.newest["at"]]
        if not len(records):
            return
        self._gaps += self._gap(records)
        self.newest = records[-1]
        self.written = max(self.written, block.written)
        self.lost = self._lost_before + self._gaps
        self._recent.append(records)
        while float(self._recent[0]["at"][-1]) < float(self.newest["at"]) - RECENT_S:
            self._recent.popleft()
        if self._feed is not None and not self._feed.over:
            self._feed.put(records)

    def feed(self) -> "RemoteFeed":
        """A new feed of the last seconds and of what follows; the feed before ends here."""
        if self._feed is not None:
            self._feed.over = True
        self._feed = RemoteFeed(self)
        for records in self._recent:
            self._feed.put(records)
        return self._feed

    def _gap(self, records: Records) -> int:
        """Ticks missing between these records and before them; a missed deadline is no tick."""
        known = records if self.newest is None else joined((np.array([self.newest], DTYPE), records))
        ticks = np.diff(known["tick"].astype(np.int64)) - np.diff(known["ticks_missed"].astype(np.int64)) - 1
        return int(np.maximum(ticks, 0).sum())

    def _check(self, records: Records) -> None:
        at = records["at"]
        valid = (
            np.isfinite(at).all()
            and (np.abs(at) < LATEST_S).all()
            and (np.diff(at) >= 0.0).all()
            and all(np.isfinite(records[name]).all() for name in FINITE)
            and (records["selected"] < self._bank).all()
            and (records["rotation_selected"] < self._torque_bank).all()
            and (records["fault"] <= max(Fault)).all()
            and ((records["state"] >= 1) & (records["state"] <= len(State))).all()
        )
        if not valid:
            raise StreamError("it sends records that no daemon writes")


def _count(introduction: SideIntroduction, bank: str) -> int:
    """Number of predictors in a bank of the description; the most that an update can name if it is not there."""
    names = (introduction.description or {}).get(bank)
    return len(names) if isinstance(names, list) and names else 16


class RemoteFeed:
    """Feed of a `RemoteSide`."""

    ring: Path | None = None
    wall_offset_s: float | None = None
    in_order: bool | None = None

    def __init__(self, side: RemoteSide) -> None:
        introduction = side.introduction
        self.side = introduction.side
        self.rate_hz = introduction.rate_hz
        self.began = introduction.began
        self.over = False
        """Whether this feed takes no more records."""
        self.drained = False
        """Changed by `read` only, so that whoever reads sees the end."""
        self._source = side
        self._waiting: deque[Records] = deque()
        self._count = 0
        self._dropped = 0

    @property
    def description(self) -> dict[str, Any] | None:
        return self._source.introduction.description

    @property
    def written(self) -> int:
        return self._source.written

    @property
    def lost(self) -> int:
        return self._source.lost + self._dropped

    def put(self, records: Records) -> None:
        self._waiting.append(records)
        self._count += len(records)
        while self._count > WAITING_S * self.rate_hz and len(self._waiting) > 1:
            dropped = len(self._waiting.popleft())
            self._count -= dropped
            self._dropped += dropped

    def read(self) -> Records:
        records = joined(self._waiting)
        self._waiting.clear()
        self._count = 0
        self.drained = self.over or self._source.ended
        return records

    def close(self) -> None:
        self.over = True
