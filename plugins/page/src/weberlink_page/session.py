"""A session as pages see it: its greeting, the rows of its last seconds, its figures and events as messages."""

from collections import deque
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np

from weberlink.config import MASTER, SLAVE
from weberlink.protocol.paths import finding
from weberlink.protocol.states import State
from weberlink.telemetry.reader import Records
from weberlink_figures.session import joined
from weberlink_figures.watching.rings import RingSource
from weberlink_figures.watching.rows import felt_message
from weberlink_figures.watching.session import SessionEvent, WatchedSession
from weberlink_page.hello import hello
from weberlink_page.rows import Thinning, samples_message

BACKLOG_S = 5.0  # how far back `backlog` reaches


def events_message(session: str, events: list[SessionEvent]) -> dict[str, Any]:
    """Message with events."""
    return {"type": "events", "session": session, "events": [event._asdict() for event in events]}


def ways_now(last: Mapping[str, Any]) -> dict[str, Any]:
    """Each way of the link (`weberlink_figures.link`), by the newest record of each side that has one, for JSON."""

    def known(value: Any) -> float | None:
        return float(value) if np.isfinite(value) else None

    def way(receiver: Any, sender: Any) -> dict[str, float | None]:
        if receiver is not None:
            delay, loss, burst = (receiver[name] for name in ("one_way_us", "incoming_loss", "peer_burst"))
            return {"one_way_us": known(delay), "loss": known(loss), "burst": float(burst) or None}
        if sender is None:
            return {"one_way_us": None, "loss": None, "burst": None}
        outward = float(sender["rtt_us"]) - float(sender["one_way_us"])
        return {"one_way_us": known(outward), "loss": known(sender["outgoing_loss"]), "burst": None}

    master, slave = last.get(MASTER), last.get(SLAVE)
    here = slave if master is None else master
    return {
        "jitter_us": None if here is None else known(here["jitter_us"]),
        "to_slave": way(slave, master),
        "to_master": way(master, slave),
    }


class _Shown(NamedTuple):
    """Rows of a message: of a side (the same rows twice), or of the felt error (the master's and the slave's)."""

    kind: str
    first: Records
    second: Records


class PageSession(WatchedSession):
    def __init__(self, name: str, first: RingSource) -> None:
        super().__init__(name, first)
        # Those in force as the daemons report them; None before that.
        self.settings: dict[str, Any] | None = None
        self.generation: int | None = None
        self._thinnings: dict[str, Thinning] = {}
        self._backlog: deque[_Shown] = deque()

    @property
    def settings_count(self) -> int | None:
        """Number of live changes in force, as of the newest record; None before the first record."""
        return next((int(last["settings"]) for last in self.last.values()), None)

    def rows(self, *, show: bool = True) -> list[dict[str, Any]]:
        """Read new records; returns messages with their rows if `show`."""
        news = self.look()
        shown = []
        for name, records in news.records.items():
            rows = self._thinnings.setdefault(name, Thinning(self.rate_hz)).choose(records)
            shown += [_Shown(name, rows, rows)] if len(rows) else []
        shown += [_Shown("felt", *news.felt)] if len(news.felt[0]) else []
        self._backlog.extend(shown)
        newest = max((float(last["at"]) for last in self.last.values()), default=0.0)
        while self._backlog and float(self._backlog[0].first["at"][-1]) < newest - BACKLOG_S:
            self._backlog.popleft()
        return [self._message(*of) for of in shown] if show else []

    def backlog(self) -> list[dict[str, Any]]:
        """Messages with the rows of the last seconds, for who begins to watch."""
        kinds = sorted({shown.kind for shown in self._backlog}, key=lambda kind: (kind == "felt", kind))
        of_kind = {kind: [shown for shown in self._backlog if shown.kind == kind] for kind in kinds}
        return [
            self._message(kind, joined([each.first for each in shown]), joined([each.second for each in shown]))
            for kind, shown in of_kind.items()
        ]

    def hello(self) -> dict[str, Any]:
        """The greeting; `readonly` says whether nobody may change anything."""
        told = hello(self.name, {name: source.description for name, source in self.sources.items()})
        cameras = self.description.get("system", {}).get("slave", {}).get("cameras")
        return {
            **told,
            **self._settings,
            "rate_hz": self.rate_hz,
            "seen_from_start": self.seen_from_start,
            "axes": list(self.layout.joints) or None,
            "view": None if self.ended or cameras is None else cameras.get("driver"),
        }

    def figures(self) -> dict[str, Any]:
        """Message with all figures so far, and those of the last second."""
        pace, last, paths = self.pace, self.last, self.paths
        asked = self.description.get("system", {}).get("link", {}).get("dscp")
        dscp = asked if isinstance(asked, int) else None
        return {
            "type": "figures",
            "session": self.name,
            "figures": replace(self.score.figures(), paths=paths).to_json(),
            "alarms": [asdict(cause) for cause in self.alarms()],
            "faults": self.faults,
            "faults_now": self.faults_now,
            "ended": self.ended,
            "seen_from_start": self.seen_from_start,
            "packets_per_s_now": {channel: of.packets_per_s for channel, of in pace.items()},
            "reduction_now": {channel: of.reduction for channel, of in pace.items()},
            "engaged": {
                name: name in last and bool(last[name]["state"] == State.ENGAGED.value) for name in self.sources
            },
            "button": self._button,
            "ways_now": ways_now(last),
            "paths": [
                path._asdict() | {"side": name, "words": path.route_words, "class": path.dscp_words(dscp)}
                for name, of_side in paths.items()
                for path in of_side
            ],
            "finding": finding([path for of_side in paths.values() for path in of_side]),
            **self._settings,
        }

    @property
    def _button(self) -> str | None:
        """Whether the button of `master.engage` is held or released; None without one, or without the master."""
        engage = self.description.get("system", {}).get("master", {}).get("engage")
        last = self.last.get(MASTER)
        if engage is None or last is None:
            return None
        return "held" if int(last["buttons"]) >> int(engage["button"]) & 1 else "released"

    @property
    def _settings(self) -> dict[str, Any]:
        return {} if self.settings is None else {"settings": self.settings, "generation": self.generation}

    def _message(self, kind: str, first: Records, second: Records) -> dict[str, Any]:
        if kind == "felt":
            return felt_message(first, second, self.origin, self.layout)
        return samples_message(kind, first, self.origin, self.layout)
