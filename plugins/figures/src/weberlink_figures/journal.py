"""The log of a live session: lines made from the telemetry of its sides, outside every control loop.

Each side writes at most one line per kind and second; intermediate changes are counted in `suppressed`, and the newest
one is written when the second is over. Every line has `time` (UTC), `side`, `event`, and its `level` and `text` in
words (`weberlink_figures.wording`); one about a tick also has `tick` and `at_s`, its deadline on the monotonic clock,
as in recordings. docs/operation/logs.md lists the events and their fields.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from time import time
from typing import Any, NamedTuple

import numpy as np

from weberlink.protocol.paths import LinkPath
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault, name_of
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import RELEASED
from weberlink_figures.channel import engaged
from weberlink_figures.distribution import Distribution
from weberlink_figures.tree import Figures
from weberlink_figures.wording import words

Fields = dict[str, Any]

QUIET_S = 1.0  # least time between two lines of one kind and side
SUMMARY_S = 60.0
SESSION = "session"  # `side` of lines about both sides
LONGEST_OUTCOME = 1000  # characters of an outcome that are written: a line must fit into a pipe
LONGEST_TEXT = 500  # characters of the words of an event
LONGEST_ENTRY = 1000  # characters of a piece of a trace: a frame with its line of code has less
KEPT = ("status", "verdict", "duration_s", "faults", "drops", "realtime", "host")
"""Keys of the report in the line `ended`, beside its outcome and the packets."""
COUNTED = {
    "missed": "ticks_missed",
    "sent": "datagrams_sent",
    "received": "datagrams_received",
    "lost": "datagrams_lost",
    "dropped": "datagrams_dropped",
}
"""Counts of a summary, by the column of the record."""


class _Event(NamedTuple):
    """What to write, and the first record that shows it; of the events of one kind that wait, the last is written."""

    record: Any
    name: str
    fields: Fields
    kind: str


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
    engaged: int = 0
    ticks: int = 0
    lateness: Distribution = field(default_factory=Distribution)
    rtt: Distribution = field(default_factory=Distribution)

    def add(self, records: Records) -> None:
        self.ticks += len(records)
        self.engaged += int(engaged(records).sum())
        self.lateness.add(records["lateness_us"])
        self.rtt.add(records["rtt_us"])

    def figures(self, last: Any) -> Fields:
        duration = float(last["at"]) - float(self.first["at"])
        counted = {"updates": "updates_sent", "bytes": "bytes_sent"} | COUNTED
        counts = {name: int(last[column]) - int(self.first[column]) for name, column in counted.items()}
        updates, size = counts.pop("updates"), counts.pop("bytes")

        def per_second(count: int) -> float | None:
            return round(count / duration, 2) if duration > 0.0 else None

        def rounded(us: Any, *names: str) -> Fields:
            values = {name: getattr(us, name) for name in names}
            return {name: None if value is None else round(value, 1) for name, value in values.items()}

        return {
            "interval_s": round(duration, 3),
            "packets_per_s": per_second(updates),
            "reduction": round(1.0 - updates / self.engaged, 6) if self.engaged else None,
            "bytes_per_s": per_second(size),
            "lateness_us": rounded(self.lateness.spread(), "p50", "p99", "max"),
            "rtt_us": rounded(self.rtt.spread(), "p50", "p99"),
            "ticks": self.ticks,
            **counts,
        }


class _Side:
    """One side: its newest record, its interval, and the lines of each kind."""

    def __init__(self, name: str, first: Any, wall_offset_s: float) -> None:
        self.name = name
        self.last = first
        self.wall_offset_s = wall_offset_s
        self.interval = _Interval(first)
        self.kinds: dict[str, _Kind] = {}
        self.paths: dict[int, LinkPath] = {}  # by place, as last told
        self.peer: Fields = {}  # what was last told of the peer
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
            yield _Event(record, name_of(State, record["state"]), {"before": name_of(State, before["state"])}, "state")
        if record["fault"] != before["fault"]:
            at = float(record["at"])
            if int(before["fault"]):
                lasted = round(at - self._fault_at_s, 6)
                fields = {"fault": name_of(Fault, before["fault"]), "lasted_s": lasted}
                yield _Event(record, "recovered", fields, "fault")
            if int(record["fault"]):
                self._fault_at_s = at
                yield _Event(record, "fault", {"fault": name_of(Fault, record["fault"])}, "fault")
        if record["settings"] != before["settings"]:
            fields = {"generation": int(record["settings"]), "weber": round(float(record["weber"]), 6)}
            yield _Event(record, "settings", fields, "settings")
        if (record["ramping"] == RELEASED) != (before["ramping"] == RELEASED):
            yield _Event(record, "released" if record["ramping"] == RELEASED else "held", {}, "button")

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
                kind.waiting = _Event(records[int(np.flatnonzero(ticks)[-1])], name, {}, name)


class Journal:
    """Writes lines about records.

    Args:
        write: takes a line as a dictionary for JSON; returns False or raises OSError or ValueError if it could not
            write it.
        rate_hz: tick rate.
        now: the wall clock [s since 1970], for lines about no record.
        summary_s: time between two summaries of a side, on the clock of its records.
    """

    def __init__(
        self,
        write: Callable[[Fields], object],
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
        self.lost_lines = 0  # lines that could not be written since the last one that was, which reports them

    def add(self, side: str, records: Records, wall_offset_s: float) -> None:
        """Take the next records of a side, in their order, shape (n,); may be empty. The offset is that from the clock
        of the records to the wall clock [s]: the ring's `started_wall_s` minus its `started_monotonic_s`.
        """
        if not len(records):
            return
        known = self._sides.get(side)
        if known is None:
            first = records[0]
            known = self._sides[side] = _Side(side, first, wall_offset_s)
            fields = {"state": name_of(State, first["state"]), "rate_hz": self._rate_hz}
            self._write_event(known, first, "started", fields)
            if int(first["fault"]):
                self._offer(known, _Event(first, "fault", {"fault": name_of(Fault, first["fault"])}, "fault"))
        known.count(records)
        for event in known.events(records):
            self._offer(known, event)
        known.interval.add(records)
        at = float(known.last["at"])
        self._flush(known, at)
        if at - float(known.interval.first["at"]) >= self._summary_s:
            self._summarise(known)

    def add_peer(self, side: str, peer: Mapping[str, Any] | None) -> None:
        """Take what a side knows of its peer (`weberlink.session.side.PeerFacts`), as `add_paths` takes the paths."""
        known = self._sides.get(side)
        told = {name: str(value)[:LONGEST_OUTCOME] for name, value in (peer or {}).items() if value}
        if known is not None and told and told != known.peer:
            known.peer = told
            self._offer(known, _Event(known.last, "peer", told, "peer"))

    def add_paths(self, side: str, paths: Sequence[LinkPath]) -> None:
        """Take the present paths of a side; another one is an event of its newest record.

        Nothing is taken before the first record of the side: call it again. A path to nobody yet is none.
        """
        known = self._sides.get(side)
        if known is None:
            return
        for path in paths:
            told = path.as_event
            is_idle = told.route and not told.remote
            if not is_idle and known.paths.get(told.place) != told:
                known.paths[told.place] = told
                fields = {name: value for name, value in told._asdict().items() if name != "dscp"}
                self._offer(known, _Event(known.last, "path", fields, f"path {told.place}"))

    def trace(self, entries: Sequence[str], side: str = SESSION) -> None:
        """Write the trace of an error, a line for each piece (`traceback.format_exception`)."""
        for entry in entries:
            self._line(self._now(), side, "trace", {"entry": entry.rstrip()[:LONGEST_ENTRY]})

    def flush(self) -> None:
        """Write the changes that wait for their second."""
        for side in self._sides.values():
            self._flush(side, np.inf)

    def end(self, figures: Figures) -> None:
        """Write what is waiting, the figures since the last summary, and the outcome. May be repeated."""
        if self._ended:
            return
        self._ended = True
        self.flush()
        for side in self._sides.values():
            self._summarise(side)
        report = figures.to_json()
        told = {key: report[key] for key in KEPT if key in report}
        told["outcome"] = str(figures.outcome)[:LONGEST_OUTCOME]
        told |= {
            name: {"packets_per_s": figures.channels[name].packets_per_s, "reduction": figures.channels[name].reduction}
            for name in ("force", "position", "joint_torque", "joint_angle")
            if name in figures.channels
        }
        self._line(self._now(), SESSION, "ended", told)

    def _offer(self, side: _Side, event: _Event) -> None:
        """Write an event now if a line of its kind is due, else keep it in place of an older one."""
        kind = side.kinds.setdefault(event.kind, _Kind())
        at = float(event.record["at"])
        if kind.waiting is None and at - kind.last_s >= QUIET_S:
            kind.last_s = at
            self._write_event(side, *event[:3])
            return
        kind.suppressed += kind.waiting is not None
        kind.waiting = event

    def _flush(self, side: _Side, now_s: float) -> None:
        """Write waiting events whose time has come."""
        for kind in side.kinds.values():
            if kind.waiting is None or now_s - kind.last_s < QUIET_S:
                continue
            event, counts = kind.waiting, {"ticks": kind.ticks, "suppressed": kind.suppressed}
            fields = event.fields | {name: count for name, count in counts.items() if count}
            kind.last_s, kind.waiting, kind.suppressed, kind.ticks = now_s, None, 0, 0
            self._write_event(side, event.record, event.name, fields)

    def _summarise(self, side: _Side) -> None:
        self._write_event(side, side.last, "summary", side.interval.figures(side.last))
        side.interval = _Interval(side.last)

    def _write_event(self, side: _Side, record: Any, name: str, fields: Fields) -> None:
        at = float(record["at"])
        place = {"tick": int(record["tick"]), "at_s": round(at, 6)}
        self._line(at + side.wall_offset_s, side.name, name, place | fields)

    def _line(self, wall_s: float, side: str, event: str, fields: Fields) -> None:
        try:
            moment = datetime.fromtimestamp(wall_s, UTC)
        except (ValueError, OverflowError, OSError):  # the wall clock is out of range
            moment = datetime.fromtimestamp(0, UTC)
        level, text = words(side, event, fields)
        document = {
            "time": moment.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "side": side,
            "event": event,
            "level": level,
            "text": text[:LONGEST_TEXT],
            **fields,
            **({"lost_lines": self.lost_lines} if self.lost_lines else {}),
        }
        try:
            written = self._write(document) is not False
        except (OSError, ValueError):
            written = False
        self.lost_lines = 0 if written else self.lost_lines + 1
