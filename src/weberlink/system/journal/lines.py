"""Records in, lines out: when an event is told, and how many lines there may be.

Knows no file and no process: it is fed with records, and gives lines away.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from time import time
from typing import Any

import numpy as np

from weberlink.system.journal.changes import Change, Changes, Fields, Records, scheme_name, state_name
from weberlink.system.journal.interval import Interval

QUIET_S = 1.0
"""Between two lines of one kind and side."""
SUMMARY_S = 60.0
SESSION = "session"
"""The `side` of what concerns both."""
LONGEST_OUTCOME = 1000
"""Characters of the outcome that are told: a line must fit a pipe."""


@dataclass
class _Kind:
    """Lines of one kind: when the last was, and what waits for its time."""

    last_s: float = -np.inf
    waiting: Change | None = None
    suppressed: int = 0
    ticks: int = 0


@dataclass
class _Side:
    """One side as it stands."""

    wall_offset_s: float
    changes: Changes
    interval: Interval
    kinds: dict[str, _Kind] = field(default_factory=dict)

    @property
    def last(self) -> Any:
        """Its newest record."""
        return self.changes.last


class Journal:
    """Turns records into lines.

    Args:
        write: takes a line without its end and returns whether it was written; what it raises is as good as False.
        rate_hz: of the ticks.
        now: the wall clock [s since 1970], for what no record stands for.
        summary_s: between two summaries of a side, in the time of its records.
    """

    def __init__(
        self,
        write: Callable[[str], object],
        rate_hz: float,
        *,
        now: Callable[[], float] = time,
        summary_s: float = SUMMARY_S,
    ) -> None:
        self._write = write
        self._rate_hz = rate_hz
        self._now = now
        self._summary_s = summary_s
        self._sides: dict[str, _Side] = {}
        self._ended = False
        self.lost_lines = 0
        """Lines that could not be written; the next one that can says so."""

    def look(self, side: str, records: Records, wall_offset_s: float) -> None:
        """Take the next records of a side, in their order.

        Args:
            side: its name.
            records: of `weberlink.telemetry.reader.DTYPE`, shape (n,); may be empty.
            wall_offset_s: from the clock of the records to the wall clock [s]: the ring's `started_wall_s` minus its
                `started_monotonic_s`.
        """
        if not len(records):
            return
        known = self._sides.get(side)
        if known is None:
            known = self._sides[side] = self._begin(side, records[0], wall_offset_s)
        _count(known, records)
        for change in known.changes.follow(records):
            self._offer(side, known, change)
        known.interval.add(records)
        self._flush(side, known, float(known.last["at"]))
        if float(known.last["at"]) - known.interval.since_s >= self._summary_s:
            self._summarise(side, known)

    def end(self, summary: dict[str, Any]) -> None:
        """Tell what is waiting, the figures since the last summary, and how it ended. May be repeated.

        Args:
            summary: of the session, as `weberlink loopback --json` writes it.
        """
        if self._ended:
            return
        self._ended = True
        for name, side in self._sides.items():
            self._flush(name, side, np.inf)
            self._summarise(name, side)
        self._line(self._now(), SESSION, "ended", _outcome(summary))

    def _begin(self, name: str, record: Any, wall_offset_s: float) -> _Side:
        side = _Side(wall_offset_s, Changes(record), Interval(record, float(record["at"])))
        fields = {"state": state_name(record), "scheme": scheme_name(record), "rate_hz": self._rate_hz}
        self._tell(name, side, record, "started", fields)
        for change in side.changes.begin():
            self._offer(name, side, change)
        return side

    def _offer(self, name: str, side: _Side, change: Change) -> None:
        """Tell it now if a line of its kind may come, else keep it, in place of an older one."""
        kind = side.kinds.setdefault(change.kind, _Kind())
        at = float(change.record["at"])
        if kind.waiting is None and at - kind.last_s >= QUIET_S:
            kind.last_s = at
            self._tell(name, side, change.record, change.event, change.fields)
            return
        kind.suppressed += kind.waiting is not None
        kind.waiting = change

    def _flush(self, name: str, side: _Side, now_s: float) -> None:
        """Tell what waits, where its time has come."""
        for kind in side.kinds.values():
            if kind.waiting is None or now_s - kind.last_s < QUIET_S:
                continue
            record, _, event, fields = kind.waiting
            counts = {"ticks": kind.ticks} if kind.ticks else {}
            suppressed = {"suppressed": kind.suppressed} if kind.suppressed else {}
            kind.last_s, kind.waiting, kind.suppressed, kind.ticks = now_s, None, 0, 0
            self._tell(name, side, record, event, fields | counts | suppressed)

    def _summarise(self, name: str, side: _Side) -> None:
        self._tell(name, side, side.last, "summary", side.interval.figures(side.last))
        side.interval = Interval(side.last, float(side.last["at"]))

    def _tell(self, name: str, side: _Side, record: Any, event: str, fields: Fields) -> None:
        at = float(record["at"])
        place = {"tick": int(record["tick"]), "at_s": round(at, 6)}
        self._line(at + side.wall_offset_s, name, event, place | fields)

    def _line(self, wall_s: float, side: str, event: str, fields: Fields) -> None:
        lost = {"lost_lines": self.lost_lines} if self.lost_lines else {}
        document = {"time": _timestamp(wall_s), "side": side, "event": event} | fields | lost
        try:
            written = self._write(json.dumps(document, separators=(",", ":"), allow_nan=False)) is not False
        except (OSError, ValueError):
            written = False
        self.lost_lines = 0 if written else self.lost_lines + 1


def _count(side: _Side, records: Records) -> None:
    """Missed deadlines and limited outputs: too many to be told one by one."""
    missed, slewed = (
        np.diff(records[name].astype(np.int64), prepend=int(side.last[name])) for name in ("ticks_missed", "slew_ticks")
    )
    clipped = (records["clipped"] > 0).astype(np.int64)
    for event, ticks in (("missed", missed), ("clipped", clipped), ("slewed", slewed)):
        total = int(ticks.sum())
        if total:
            kind = side.kinds.setdefault(event, _Kind())
            kind.ticks += total
            kind.waiting = Change(records[int(np.flatnonzero(ticks)[-1])], event, event, {})


def _timestamp(wall_s: float) -> str:
    """ISO 8601 in UTC, to the millisecond."""
    try:
        moment = datetime.fromtimestamp(wall_s, UTC)
    except (ValueError, OverflowError, OSError):  # of a clock that is far off
        moment = datetime.fromtimestamp(0, UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _outcome(summary: dict[str, Any]) -> Fields:
    """What is worth keeping of the report of a session."""
    channels: Fields = {
        name: {key: summary[name].get(key) for key in ("packets_per_s", "reduction")}
        for name in ("force", "position")
        if name in summary
    }
    kept: Fields = {
        key: summary[key] for key in ("status", "duration_s", "faults", "drops", "realtime") if key in summary
    }
    kept["outcome"] = str(summary.get("outcome"))[:LONGEST_OUTCOME]
    return kept | channels
