"""One side of another host, as it arrives: checked, without repetition, and handed on as feeds. Knows no connection."""

from collections import deque
from pathlib import Path
from typing import Any

import numpy as np

from weberlink.apps.monitor.pieces import joined
from weberlink.apps.monitor.remote.channel import StreamError
from weberlink.apps.monitor.remote.messages import Begin, Piece
from weberlink.control.table import SCHEMES
from weberlink.protocol.states import State
from weberlink.system.scoring.session import Records
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import DTYPE

RECENT_S = 5.0
"""What a feed that begins later can still have."""
WAITING_S = 20.0
"""What waits for a feed to be read; older records are let go."""
_LATEST_S = 1e10
_VECTORS = ("position", "raw", "decoded", "output", "rotation_raw", "rotation_decoded", "rotation_output")


class RemoteSource:
    """A side of a session on another host.

    Args:
        begin: how it was introduced.
    """

    def __init__(self, begin: Begin) -> None:
        self.begin = begin
        self.ended = False
        self.written = 0
        self.lost = 0
        self._taps: list[Tap] = []
        self._recent: deque[Records] = deque()
        self._last: Any = None
        self._lost_before = 0
        self._gaps = 0
        self._bank = _count(begin, "bank")
        self._torque_bank = _count(begin, "torque_bank")

    @property
    def newest(self) -> Any:
        """The newest record; None before the first."""
        return self._last

    def push(self, piece: Piece) -> None:
        """Take what has come; after a connection was lost it may begin with what is known.

        Raises:
            StreamError: it holds what no daemon writes.
        """
        records = piece.records
        self._check(records)
        if self._last is None:
            self._lost_before = piece.lost
        else:
            records = records[records["at"] > self._last["at"]]
        if not len(records):
            return
        self._gaps += self._gap(records)
        self._last = records[-1]
        self.written = max(self.written, piece.written)
        self.lost = self._lost_before + self._gaps
        self._recent.append(records)
        while float(self._recent[0]["at"][-1]) < float(self._last["at"]) - RECENT_S:
            self._recent.popleft()
        for tap in self._taps:
            tap.put(records)

    def end(self) -> None:
        """Nothing more will come."""
        self.ended = True

    def tap(self) -> "Tap":
        """A feed of what comes from now on, and of the last seconds."""
        tap = Tap(self)
        for records in self._recent:
            tap.put(records)
        self._taps.append(tap)
        return tap

    def release(self, tap: "Tap") -> None:
        if tap in self._taps:
            self._taps.remove(tap)

    def _gap(self, records: Records) -> int:
        """Ticks that were made and never came, between the records and before them."""
        known = records if self._last is None else joined((np.array([self._last], DTYPE), records))
        ticks = np.diff(known["tick"].astype(np.int64)) - np.diff(known["ticks_missed"].astype(np.int64)) - 1
        return int(np.maximum(ticks, 0).sum())

    def _check(self, records: Records) -> None:
        at = records["at"]
        sound = (
            np.isfinite(at).all()
            and (np.abs(at) < _LATEST_S).all()
            and (np.diff(at) >= 0.0).all()
            and all(np.isfinite(records[name]).all() for name in _VECTORS)
            and (records["selected"] < self._bank).all()
            and (records["rotation_selected"] < self._torque_bank).all()
            and (records["control"] < len(SCHEMES)).all()
            and (records["fault"] <= max(Fault)).all()
            and ((records["state"] >= 1) & (records["state"] <= len(State))).all()
        )
        if not sound:
            raise StreamError("it sends records that no daemon writes")


def _count(begin: Begin, bank: str) -> int:
    """How many predictors a bank of the description has; as many as an update can name, where it does not say."""
    names = (begin.description or {}).get(bank)
    return len(names) if isinstance(names, list) and names else 16


class Tap:
    """A feed of a remote side; made by `RemoteSource.tap`."""

    ring: Path | None = None

    def __init__(self, source: RemoteSource) -> None:
        begin = source.begin
        self.side = begin.side
        self.rate_hz = begin.rate_hz
        self.began = begin.began
        self.description = begin.description
        self._source = source
        self._waiting: deque[Records] = deque()
        self._count = 0
        self._dropped = 0
        self._is_cut = False

    @property
    def written(self) -> int:
        return self._source.written

    @property
    def lost(self) -> int:
        return self._source.lost + self._dropped

    @property
    def drained(self) -> bool:
        return not self._waiting and (self._is_cut or self._source.ended)

    def put(self, records: Records) -> None:
        if self._is_cut:
            return
        self._waiting.append(records)
        self._count += len(records)
        while self._count > WAITING_S * self.rate_hz and len(self._waiting) > 1:
            dropped = len(self._waiting.popleft())
            self._count -= dropped
            self._dropped += dropped

    def read(self) -> Records:
        records = list(self._waiting)
        self._waiting.clear()
        self._count = 0
        return joined(records)

    def cut(self) -> None:
        """End here, whatever still comes of the source."""
        self._is_cut = True

    def close(self) -> None:
        self._source.release(self)
