"""The log of a live session: JSON lines made from the telemetry of its sides, outside every control loop.

Each side writes at most one line per kind and second; intermediate changes are counted in `suppressed`, and the newest
one is written when the second is over. Every line has `time` (UTC), `side`, `event`, and its `level` and `text` in
words (`weberlink.figures.wording`); one about a tick also has `tick` and `at_s`, its deadline on the monotonic clock,
as in recordings. docs/operation/logs.md lists the events and their fields.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from math import isfinite
from time import time
from typing import Any, NamedTuple

import numpy as np

from weberlink.figures.distribution import Distribution
from weberlink.figures.energy import Records
from weberlink.figures.paths import of_event
from weberlink.figures.wording import words
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import RELEASED

Fields = dict[str, Any]

QUIET_S = 1.0
"""Least time between two lines of one kind and side."""
SUMMARY_S = 60.0
SESSION = "session"
"""`side` of lines about both sides."""
LONGEST_OUTCOME = 1000
"""Characters of an outcome that are written: a line must fit into a pipe."""
LONGEST_TEXT = 500
"""Characters of the words of an event."""
LONGEST_ENTRY = 1000
"""Characters of a piece of a trace: a frame with its line of code has less."""
KEPT = ("status", "verdict", "duration_s", "faults", "drops", "realtime", "host")
"""Keys of the report in the line `ended`, beside its outcome and the packets."""
COUNTERS = ("updates_sent", "datagrams_sent", "datagrams_received", "datagrams_lost", "datagrams_dropped", "bytes_sent")


class _Event(NamedTuple):
    """An event to write.

    Args:
        record: the first record that shows it.
        kind: events of one kind replace each other, so that the last line of a kind gives the current condition.
    """

    record: Any
    kind: str
    name: str
    fields: Fields


@dataclass
class _Kind:
    """Lines of one kind: time of the last one, and the event that waits for its time."""

    last_s: float = -np.inf
    waiting: _Event | None = None
    suppressed: int = 0
    ticks: int = 0


@dataclass
class _Interval:
    """Figures between two summaries, from records, in bounded memory. `first` is the record before the interval."""

    first: Any
    since_s: float
    engaged: int = 0
    ticks: int = 0
    lateness: Distribution = field(default_factory=Distribution)
    rtt: Distribution = field(default_factory=Distribution)

    def add(self, records: Records) -> None:
        self.ticks += len(records)
        self.engaged += int((records["state"] == State.ENGAGED.value).sum())
        self.lateness.add(records["lateness_us"])
        self.rtt.add(records["rtt_us"])

    def figures(self, last: Any) -> Fields:
        duration = float(last["at"]) - self.since_s
        counts = {name: int(last[name]) - int(self.first[name]) for name in COUNTERS}
        return {
            "interval_s": round(duration, 3),
            "packets_per_s": _per_second(counts["updates_sent"], duration),
            "reduction": round(1.0 - counts["updates_sent"] / self.engaged, 6) if self.engaged else None,
            "bytes_per_s": _per_second(counts["bytes_sent"], duration),
            "lateness_us": _finite(self.lateness, "p50", "p99", "max"),
            "rtt_us": _finite(self.rtt, "p50", "p99"),
            "ticks": self.ticks,
            "missed": int(last["ticks_missed"]) - int(self.first["ticks_missed"]),
            "sent": counts["datagrams_sent"],
            "received": counts["datagrams_received"],
            "lost": counts["datagrams_lost"],
            "dropped": counts["datagrams_dropped"],
        }


class _Side:
    """One side: its newest record, its interval, and the lines of each kind."""

    def __init__(self, first: Any, wall_offset_s: float) -> None:
        self.last = first
        self.wall_offset_s = wall_offset_s
        self.interval = _Interval(first, float(first["at"]))
        self.kinds: dict[str, _Kind] = {}
        self.paths: dict[int, Fields] = {}
        """By place, as last told."""
        self._fault_at_s = float(first["at"])

    def events(self, records: Records) -> Iterator[_Event]:
        """What changes from one record to the next, in order of time; then `last` is the last of them."""
        changed = np.zeros(len(records), np.bool_)
        for name in ("state", "fault", "settings"):
            changed |= np.diff(records[name].astype(np.int64), prepend=int(self.last[name])) != 0
        released = records["ramping"] == RELEASED
        changed |= np.diff(released, prepend=bool(self.last["ramping"] == RELEASED))
        for index in np.flatnonzero(changed).tolist():
            yield from self._between(records[index - 1] if index else self.last, records[index])
        self.last = records[-1]

    def _between(self, before: Any, record: Any) -> Iterator[_Event]:
        if record["state"] != before["state"]:
            yield _Event(record, "state", _state(record), {"before": _state(before)})
        if record["fault"] != before["fault"]:
            at = float(record["at"])
            if int(before["fault"]):
                lasted = round(at - self._fault_at_s, 6)
                yield _Event(record, "fault", "recovered", {"fault": _fault(before), "lasted_s": lasted})
            if int(record["fault"]):
                self._fault_at_s = at
                yield _Event(record, "fault", "fault", {"fault": _fault(record)})
        if record["settings"] != before["settings"]:
            fields = {"generation": int(record["settings"]), "weber": round(float(record["weber"]), 6)}
            yield _Event(record, "settings", "settings", fields)
        if (record["ramping"] == RELEASED) != (before["ramping"] == RELEASED):
            yield _Event(record, "button", "released" if record["ramping"] == RELEASED else "held", {})

    def count(self, records: Records) -> None:
        """Count missed deadlines and limited outputs, which are too many for a line each."""
        missed, slewed, pressed = (
            np.diff(records[name].astype(np.int64), prepend=int(self.last[name]))
            for name in ("ticks_missed", "slew_ticks", "contact_ticks")
        )
        clipped = (records["clipped"] > 0).astype(np.int64)
        for name, ticks in (("missed", missed), ("clipped", clipped), ("slewed", slewed), ("pressed", pressed)):
            total = int(ticks.sum())
            if total:
                kind = self.kinds.setdefault(name, _Kind())
                kind.ticks += total
                kind.waiting = _Event(records[int(np.flatnonzero(ticks)[-1])], name, name, {})


class Journal:
    """Writes lines about records.

    Args:
        write: takes a line without its end; returns False or raises OSError or ValueError if it could not write it.
        rate_hz: tick rate.
        now: the wall clock [s since 1970], for lines about no record.
        summary_s: time between two summaries of a side, on the clock of its records.
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
        """Lines that could not be written since the last one that was, which reports them."""

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
        known.count(records)
        for event in known.events(records):
            self._offer(side, known, event)
        known.interval.add(records)
        at = float(known.last["at"])
        self._flush(side, known, at)
        if at - known.interval.since_s >= self._summary_s:
            self._summarise(side, known)

    def take_paths(self, side: str, paths: Sequence[Mapping[str, Any]]) -> None:
        """Take the present paths of a side (`weberlink.figures.paths`); another one is an event of its newest record.

        Nothing is taken before the first record of the side: call it again. A path to nobody yet is none.
        """
        known = self._sides.get(side)
        if known is None:
            return
        for told in map(of_event, paths):
            is_idle = told["route"] and not told["remote"]
            if not is_idle and known.paths.get(told["place"]) != told:
                known.paths[told["place"]] = told
                self._offer(side, known, _Event(known.last, f"path {told['place']}", "path", told))

    def trace(self, entries: Sequence[str], side: str = SESSION) -> None:
        """Write the trace of an error, one line for each of its pieces (`traceback.format_exception`)."""
        for entry in entries:
            self._line(self._now(), side, "trace", {"entry": entry.rstrip()[:LONGEST_ENTRY]})

    def flush(self) -> None:
        """Write the changes that wait for their second."""
        for name, side in self._sides.items():
            self._flush(name, side, np.inf)

    def end(self, summary: dict[str, Any]) -> None:
        """Write what is waiting, the figures since the last summary, and the outcome. May be repeated.

        Args:
            summary: of the session, as `weberlink loopback --json` writes it.
        """
        if self._ended:
            return
        self._ended = True
        self.flush()
        for name, side in self._sides.items():
            self._summarise(name, side)
        self._line(self._now(), SESSION, "ended", _outcome(summary))

    def _begin(self, name: str, record: Any, wall_offset_s: float) -> _Side:
        side = _Side(record, wall_offset_s)
        fields = {"state": _state(record), "rate_hz": self._rate_hz}
        self._tell(name, side, _Event(record, "started", "started", fields))
        if int(record["fault"]):
            self._offer(name, side, _Event(record, "fault", "fault", {"fault": _fault(record)}))
        return side

    def _offer(self, name: str, side: _Side, event: _Event) -> None:
        """Write an event now if a line of its kind is due, else keep it in place of an older one."""
        kind = side.kinds.setdefault(event.kind, _Kind())
        at = float(event.record["at"])
        if kind.waiting is None and at - kind.last_s >= QUIET_S:
            kind.last_s = at
            self._tell(name, side, event)
            return
        kind.suppressed += kind.waiting is not None
        kind.waiting = event

    def _flush(self, name: str, side: _Side, now_s: float) -> None:
        """Write waiting events whose time has come."""
        for kind in side.kinds.values():
            if kind.waiting is None or now_s - kind.last_s < QUIET_S:
                continue
            event, counts = kind.waiting, {"ticks": kind.ticks, "suppressed": kind.suppressed}
            fields = event.fields | {name: count for name, count in counts.items() if count}
            kind.last_s, kind.waiting, kind.suppressed, kind.ticks = now_s, None, 0, 0
            self._tell(name, side, event._replace(fields=fields))

    def _summarise(self, name: str, side: _Side) -> None:
        self._tell(name, side, _Event(side.last, "summary", "summary", side.interval.figures(side.last)))
        side.interval = _Interval(side.last, float(side.last["at"]))

    def _tell(self, name: str, side: _Side, event: _Event) -> None:
        at = float(event.record["at"])
        place = {"tick": int(event.record["tick"]), "at_s": round(at, 6)}
        self._line(at + side.wall_offset_s, name, event.name, place | event.fields)

    def _line(self, wall_s: float, side: str, event: str, fields: Fields) -> None:
        lost = {"lost_lines": self.lost_lines} if self.lost_lines else {}
        level, text = words(side, event, fields)
        document = {
            "time": _timestamp(wall_s),
            "side": side,
            "event": event,
            "level": level,
            "text": text[:LONGEST_TEXT],
        }
        document |= fields | lost
        try:
            written = self._write(json.dumps(document, separators=(",", ":"), allow_nan=False)) is not False
        except (OSError, ValueError):
            written = False
        self.lost_lines = 0 if written else self.lost_lines + 1


def _state(record: Any) -> str:
    return _named(lambda number: State(number).name.lower(), int(record["state"]))


def _fault(record: Any) -> str:
    return _named(lambda number: Fault(number).name.lower(), int(record["fault"]))


def _named(name: Callable[[int], str], number: int) -> str:
    """The name of a number, or the number itself where it has none: a log must not stop there."""
    try:
        return name(number)
    except (ValueError, IndexError):
        return str(number)


def _finite(distribution: Distribution, *names: str) -> dict[str, float | None]:
    figures = distribution.summary()
    return {name: round(figures[name], 1) if isfinite(figures[name]) else None for name in names}


def _per_second(count: int, duration: float) -> float | None:
    return round(count / duration, 2) if duration > 0.0 else None


def _timestamp(wall_s: float) -> str:
    """ISO 8601 in UTC, to the millisecond."""
    try:
        moment = datetime.fromtimestamp(wall_s, UTC)
    except (ValueError, OverflowError, OSError):  # the wall clock is out of range
        moment = datetime.fromtimestamp(0, UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _outcome(summary: dict[str, Any]) -> Fields:
    """The part of a session's report that the log keeps."""
    kept: Fields = {key: summary[key] for key in KEPT if key in summary}
    kept["outcome"] = str(summary.get("outcome"))[:LONGEST_OUTCOME]
    return kept | {
        name: {key: summary[name].get(key) for key in ("packets_per_s", "reduction")}
        for name in ("force", "position", "joint_torque", "joint_angle")
        if name in summary
    }
