"""The event log of a session: the lines of its journal, with the time since the session began."""

import json
from collections import deque
from datetime import datetime
from math import inf
from typing import Any, NamedTuple

from weberlink.figures.journal import Journal
from weberlink.figures.session import Records
from weberlink.figures.wording import Words, words

MOST_EVENTS = 500
"""Events that are kept; older ones are dropped."""


class SessionEvent(NamedTuple):
    """One event.

    Args:
        at: time since the session began [s].
        wall: the same moment on the wall clock [s since 1970].
        level: of `weberlink.figures.wording`.
        side: master or slave; None for the session.
        text: in words.
    """

    at: float
    wall: float
    level: str
    side: str | None
    text: str


class EventLog:
    """The last events of a session.

    Args:
        rate_hz: tick rate of both sides [Hz].
        origin: start of the session on the clock of the records [s].
    """

    def __init__(self, rate_hz: float, origin: float) -> None:
        self.events: deque[SessionEvent] = deque(maxlen=MOST_EVENTS)
        self.count = 0
        """Number of events so far."""
        self._origin = origin
        self._journal = Journal(self._take, rate_hz, summary_s=inf)
        self._wall_offset_s = 0.0

    def look(self, side: str, records: Records, wall_offset_s: float) -> None:
        """Take the next records of a side; see `Journal.look`."""
        if len(records):
            self._wall_offset_s = wall_offset_s
            self._journal.look(side, records, wall_offset_s)

    def take_paths(self, side: str, paths: list[dict[str, Any]]) -> None:
        """Take the present paths of a side; see `Journal.take_paths`."""
        self._journal.take_paths(side, paths)

    def flush(self) -> None:
        """Tell changes that still wait for their second, at the end of a session."""
        self._journal.flush()

    def note(self, at: float, side: str | None, told: Words) -> None:
        """Add an event that no record shows; `at` is on the clock of the records [s]."""
        self._add(SessionEvent(round(at - self._origin, 6), at + self._wall_offset_s, told.level, side, told.text))

    def end(self, at: float, side: str, outcome: str, *, in_order: bool) -> None:
        """Add the end of a side, with its reason in words."""
        self.note(at, side, words(side, "ended", {"outcome": outcome, "status": 0 if in_order else 1}))

    def since(self, count: int) -> list[SessionEvent]:
        """The events after the first `count` of them, as far as they are kept."""
        new = min(self.count - count, len(self.events))
        return list(self.events)[len(self.events) - new :]

    def _take(self, line: str) -> None:
        document: dict[str, Any] = json.loads(line)
        wall = datetime.fromisoformat(document["time"]).timestamp()
        at = round(document["at_s"] - self._origin, 6)
        self._add(SessionEvent(at, wall, document["level"], document["side"], document["text"]))

    def _add(self, event: SessionEvent) -> None:
        self.events.append(event)
        self.count += 1


def events_message(session: str, events: list[SessionEvent]) -> dict[str, Any]:
    """Message with events."""
    return {"type": "events", "session": session, "events": [event._asdict() for event in events]}
