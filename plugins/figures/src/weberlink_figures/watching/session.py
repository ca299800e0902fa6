"""A running session: the figures of the launcher's report so far, new records, and its events."""

from collections import deque
from dataclasses import replace
from datetime import datetime
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from weberlink.config import MASTER, SLAVE
from weberlink.protocol.paths import LinkPath, paths_of
from weberlink.telemetry.fault import Fault, name_of
from weberlink.telemetry.reader import DTYPE, Records
from weberlink.telemetry.record import SECOND
from weberlink_figures.journal import Fields, Journal
from weberlink_figures.session import Layout, SessionScore, TickPairs, joined
from weberlink_figures.tree import DEGRADED, FAILURE, Cause
from weberlink_figures.verdict import verdict
from weberlink_figures.watching.rings import RingSource
from weberlink_figures.watching.rows import Pace
from weberlink_figures.wording import ALARM, Words, fault_words, words

UNSCORED_S = 1.0  # how many records wait to be scored while no figures are needed
UNNAMED = tuple(f"predictor {number}" for number in range(16))
MOST_EVENTS = 500
"""Events that are kept; older ones are dropped."""


class SessionEvent(NamedTuple):
    at: float  # time since the session began [s]
    wall: float  # the same moment on the wall clock [s since 1970]
    level: str  # of `weberlink_figures.wording`
    side: str | None  # master or slave; None for the session
    text: str  # in words


class EventLog:
    """The last events of a session: the lines of its journal, with the time since the session began.

    Args:
        rate_hz: tick rate of both sides [Hz].
        origin: start of the session on the clock of the records [s].
    """

    def __init__(self, rate_hz: float, origin: float) -> None:
        self.events: deque[SessionEvent] = deque(maxlen=MOST_EVENTS)
        self.count = 0
        self.journal = Journal(self._on_line, rate_hz, summary_s=inf)
        self._origin = origin
        self._wall_offset_s = 0.0

    def add(self, side: str, records: Records, wall_offset_s: float) -> None:
        """Take the next records of a side; see `Journal.add`."""
        if len(records):
            self._wall_offset_s = wall_offset_s
            self.journal.add(side, records, wall_offset_s)

    def note(self, at: float, side: str | None, told: Words) -> None:
        """Add an event that no record shows; `at` is on the clock of the records [s]."""
        self._keep(SessionEvent(round(at - self._origin, 6), at + self._wall_offset_s, told.level, side, told.text))

    def since(self, count: int) -> list[SessionEvent]:
        """The events after the first `count` of them, as far as they are kept."""
        new = min(self.count - count, len(self.events))
        return list(self.events)[len(self.events) - new :]

    def _on_line(self, line: Fields) -> None:
        wall = datetime.fromisoformat(line["time"]).timestamp()
        self._keep(SessionEvent(round(line["at_s"] - self._origin, 6), wall, line["level"], line["side"], line["text"]))

    def _keep(self, event: SessionEvent) -> None:
        self.events.append(event)
        self.count += 1


class News(NamedTuple):
    """New records: of each side, and of the felt error those of both sides that belong together."""

    records: dict[str, Records]
    felt: tuple[Records, Records]


class _WatchedSide:
    """A source, and what is counted of its records."""

    def __init__(self, source: RingSource) -> None:
        self.source = source
        self.paces = (Pace(), Pace(f"{SECOND}updates_sent"))
        self.last: Any = None
        self.end_is_told = False
        self.paths: list[LinkPath] = []  # as its description says
        self._described: dict[str, Any] | None = None

    def read(self) -> Records:
        records = self.source.read()
        if self.source.description is not self._described:
            self._described = self.source.description
            self.paths = paths_of(self._described)
        if len(records):
            self.last = records[-1]
            for pace in self.paces:
                pace.add(records)
        return records

    @property
    def fault(self) -> str | None:
        return None if self.last is None or not self.last["fault"] else name_of(Fault, self.last["fault"])


class WatchedSession:
    """A session of one or two sides; the second may join later.

    Attributes:
        origin: time 0 of the rows [s], on the clock of the records.
        layout: what its records mean, as far as it is known.
        log: its events.
    """

    def __init__(self, name: str, first: RingSource) -> None:
        self.name = name
        self.rate_hz = first.rate_hz
        self.origin = first.began
        described = first.description or {}
        bank, torque_bank = described.get("bank") or UNNAMED, described.get("torque_bank")
        # Of another release, as much is shown as can be.
        self.layout = Layout.of(described.get("system", {}), first.rate_hz, bank, torque_bank, is_lenient=True)
        self._score = SessionScore(self.layout)
        # Records that wait to be scored: the cost of scoring is per call, not per record.
        self._unscored: dict[str, list[Records]] = {MASTER: [], SLAVE: []}
        self._sides: dict[str, _WatchedSide] = {}
        self._pairs = TickPairs(first.rate_hz)
        self.log = EventLog(first.rate_hz, first.began)
        self.admit(first)

    def admit(self, source: RingSource) -> None:
        sides = self._sides | {source.side: _WatchedSide(source)}
        self._sides = dict(sorted(sides.items()))

    @property
    def score(self) -> SessionScore:
        """Score of all records read."""
        if any(self._unscored.values()):
            none = np.empty(0, DTYPE)
            self._score.add(*(joined([none, *self._unscored[side]]) for side in (MASTER, SLAVE)))
            self._unscored = {MASTER: [], SLAVE: []}
        return self._score

    @property
    def sources(self) -> dict[str, RingSource]:
        return {name: side.source for name, side in self._sides.items()}

    @property
    def description(self) -> dict[str, Any]:
        """Description of a side that has one; empty if none has."""
        return next((source.description for source in self.sources.values() if source.description), {})

    @property
    def ring(self) -> Path:
        return next(iter(self.sources.values())).ring

    @property
    def ended(self) -> bool:
        return all(side.source.drained for side in self._sides.values())

    @property
    def seen_from_start(self) -> bool:
        """Whether every record of both sides was read, so that the figures are those of the whole session."""
        return all(side.source.lost == 0 for side in self._sides.values())

    @property
    def faults(self) -> dict[str, dict[str, int]]:
        """How often each fault began, by side and name."""
        return {name: {} for name in self._sides} | self.score.faults

    @property
    def faults_now(self) -> dict[str, str | None]:
        return {name: side.fault for name, side in self._sides.items()}

    @property
    def last(self) -> dict[str, Any]:
        """The newest record of each side that has one."""
        return {name: side.last for name, side in self._sides.items() if side.last is not None}

    @property
    def pace(self) -> dict[str, Pace]:
        """Pace by channel, as of the side that sends it."""
        paces = {}
        for side, streams in ((SLAVE, self.layout.from_slave), (MASTER, self.layout.from_master)):
            sender = self._sides.get(side)
            for number, stream in enumerate(streams):
                paces[stream.name] = sender.paces[number] if sender else Pace()
        return paces

    @property
    def paths(self) -> dict[str, list[LinkPath]]:
        """The paths of each side that knows its own."""
        return {name: side.paths for name, side in self._sides.items() if side.paths}

    def close(self) -> None:
        for side in self._sides.values():
            side.source.close()

    def look(self) -> News:
        empty = np.empty(0, DTYPE)
        read = {name: side.read() for name, side in self._sides.items()}
        for name, records in read.items():
            side = self._sides[name]
            if len(records):
                self._unscored[name].append(records)
                self.log.add(name, records, side.source.wall_offset_s)
            self.log.journal.add_paths(name, side.paths)
        self._note_ends()
        if any(sum(map(len, waiting)) > UNSCORED_S * self.rate_hz for waiting in self._unscored.values()):
            _ = self.score
        if len(self._sides) < 2:
            return News(read, (empty, empty))
        matched, now, counts = self._pairs.add(read[MASTER], read[SLAVE])
        return News(read, (matched[counts], now[counts]))

    def _note_ends(self) -> None:
        """Tell the end of a side once, with its reason."""
        for name, side in self._sides.items():
            source = side.source
            if side.end_is_told or not source.drained or side.last is None:
                continue
            side.end_is_told = True
            self.log.journal.flush()
            outcome = "closed in order" if source.in_order else "its process died without closing its telemetry"
            outcome += "" if side.fault is None else f", with the fault {side.fault}"
            status = 0 if source.in_order and side.fault is None else 1
            self.log.note(float(side.last["at"]), name, words(name, "ended", {"outcome": outcome, "status": status}))

    def alarms(self) -> list[Cause]:
        """The faults that are active now, and what the report would say."""
        present = []
        for name, side in self._sides.items():
            if side.fault is not None and not side.source.drained:
                told = fault_words(name, side.fault)
                level = FAILURE if told.level == ALARM else DEGRADED
                present.append(Cause(level, f"{name}_{side.fault}", f"{name}: {told.text}"))
        return [*present, *verdict(replace(self.score.figures(), paths=self.paths, faults=self.faults)).causes]
