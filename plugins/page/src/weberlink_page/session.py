"""A session as pages see it: its greeting, the rows of its last seconds, its figures and events as messages."""

from collections import deque
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.config import MASTER, SLAVE
from weberlink.protocol.paths import finding
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import Records
from weberlink_figures.session import Layout, joined
from weberlink_figures.watching.rings import RingSource
from weberlink_figures.watching.rows import felt_message, listed
from weberlink_figures.watching.scene import drawn
from weberlink_figures.watching.session import SessionEvent, WatchedSession
from weberlink_figures.wording import class_words

BACKLOG_S = 5.0  # how far back `backlog` reaches
ROWS_PER_S = 250.0  # rows per second of a side, besides the ticks that sent an update
_INTEGERS = ("ticks_missed", "datagrams_sent", "updates_sent", "state", "fault", "sent", "ramping", "model", "settings")
COLUMNS: dict[str, int | None] = (
    dict.fromkeys(("position", "raw", "output", "bound", "energy", "surface", "surface_size"), 7)
    | {"surface_stiffness": 2}
    | dict.fromkeys(("lateness_us", "work_us", "rtt_us", "one_way_us", "jitter_us"), 1)
    | dict.fromkeys(_INTEGERS)
)
"""Columns of a row, with their decimal places; None for integers."""
SECOND_STREAM: dict[str, int | None] = {"second_updates_sent": None, "second_sent": None, "second_bound": 7}
"""Further columns of a session with a second stream: a rotation, or a gripper."""
CARTESIAN = ("bound", "second_bound", "surface", "surface_size", "surface_stiffness", "model")
"""Those that a session in joint space lacks."""


def hello(session: str, descriptions: Mapping[str, dict[str, Any] | None]) -> dict[str, Any]:
    """The greeting of a session, without what depends on who watches and on the time.

    `descriptions`: of the present sides, see `weberlink.session.description`; None if unknown.
    """
    any_: dict[str, Any] = next((each for each in descriptions.values() if each is not None), {})
    system = any_.get("system", {})
    codec, emulated = system.get("codec", {}), system.get("link", {}).get("emulate")
    force = (codec.get("joints") or {}).get("torque") or codec.get("force", {})
    bank, choice = list(any_.get("bank", ())), codec.get("force", {}).get("predictor", "hybrid")
    workspace = _workspace(descriptions.get("master") or {})
    changes, link = list(any_.get("changes", ())), system.get("link", {})

    def own(side: str) -> str | None:
        """What a side calls itself."""
        described, other = (descriptions.get(each) or {} for each in (side, SLAVE if side == MASTER else MASTER))
        heard = (other.get("peer") or {}).get("name")
        name: str | None = described.get("name") or heard or (link.get("names") or {}).get(side)
        return name

    slave = link.get("slave")
    if any_.get("finds_path"):
        slave = (link.get("finder") or {}).get("peer") or own(SLAVE)
    return {
        "type": "hello",
        "session": session,
        "readonly": not changes,
        "sides": {side: descriptions.get(side) for side in ("master", "slave")},
        "present": sorted(descriptions),
        "names": {
            "file": Path(any_["file"]).name if "file" in any_ else None,
            "device": system.get("master", {}).get("device", {}).get("driver"),
            "robot": system.get("slave", {}).get("robot", {}).get("driver"),
            "peer": slave,  # its address, or its name where a path to it is found
            "master": own(MASTER),
            "slave": own(SLAVE),
        },
        "scene": drawn(system.get("slave", {}).get("scene", ())),
        "changes": changes,
        "predictors": [*bank, choice] if len(bank) > 1 else bank,
        # Settings and link as configured; the daemons know later changes.
        "settings": {"weber": force.get("weber"), "predictor": force.get("predictor")},
        "scheme": system.get("control", {}).get("scheme"),
        "generation": 0,
        "link": None if emulated is None else {key: emulated.get(key) for key in ("delay_ms", "jitter_ms", "loss")},
        "drivable": workspace is not None,
        "workspace_m": workspace,
        "rate_hz": any_.get("rate_hz"),
        "states": {str(state.value): state.name.lower() for state in State},
        "faults": {str(fault.value): fault.name.lower() for fault in Fault},
    }


def _workspace(master: Mapping[str, Any]) -> float | None:
    """Half the edge of the workspace of a `pointer` device [m]; None for any other device."""
    device = dict(master.get("system", {}).get("master", {}).get("device", {}))
    if device.pop("driver", None) != "pointer":
        return None
    from weberlink.master.devices import DEVICES  # noqa: PLC0415 - for this device only

    options = DEVICES.load("pointer").Options.model_validate(device)
    return float(getattr(options, "workspace_m"))  # noqa: B009 - of this driver


class Thinning:
    """Selects every Nth record of a side, and all that sent an update or changed state or fault."""

    def __init__(self, rate_hz: float) -> None:
        self._every = max(1, int(np.ceil(rate_hz / ROWS_PER_S)))
        self._passed = 0
        self._before: tuple[int, int] | None = None

    def choose(self, records: Records) -> Records:
        """The rows to show."""
        count = len(records)
        if not count:
            return records
        keep = (np.arange(self._passed, self._passed + count) % self._every == 0) | (records["sent"] > 0)
        keep |= records["second_sent"] > 0
        for place, name in enumerate(("state", "fault")):
            values = records[name].astype(np.int64)
            before = values[0] if self._before is None else self._before[place]
            keep |= np.diff(values, prepend=before) != 0
        self._before = (int(records["state"][-1]), int(records["fault"][-1]))
        self._passed += count
        chosen: Records = records[keep]
        return chosen


def samples_message(side: str, rows: Records, origin: float, layout: Layout) -> dict[str, Any]:
    """Message with rows of one side; `origin` is the start of the session on the clock of the rows [s]."""
    columns = COLUMNS if len(layout.from_slave) == 1 else COLUMNS | SECOND_STREAM
    if layout.joints:
        columns = {name: digits for name, digits in columns.items() if name not in CARTESIAN}
    values = {name: rows[name] for name in columns}
    values |= {name: values[name][:, : len(layout.axes)] for name in ("position", "raw", "output")}
    if layout.joints and side == SLAVE:
        columns, values = columns | {"bound": 7}, values | {"bound": layout.deadbands(rows)}

    def column(values: NDArray[Any], digits: int | None) -> list[Any]:
        if digits is None:
            numbers: list[Any] = values.tolist()
            return numbers
        return listed(values, digits) if values.ndim == 1 else [listed(axis, digits) for axis in values.T]

    return {
        "type": "samples",
        "side": side,
        "t": listed(rows["at"] - origin, 6),
        "columns": {name: column(values[name], digits) for name, digits in columns.items()},
    }


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
                path._asdict() | {"side": name, "words": path.route_words, "class": class_words(path, dscp)}
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
