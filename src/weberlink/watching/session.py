"""A running session: the figures of the launcher's report so far, and the rows of its last seconds."""

from collections import Counter, deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from weberlink.codec.deadband.contract import Measures
from weberlink.config import MASTER, SLAVE
from weberlink.control.contract import AccountParameters
from weberlink.figures.arm import ArmLayout, arm_in
from weberlink.figures.energy import accounts_in
from weberlink.figures.link import ways_now
from weberlink.figures.paths import dscp_words, finding, paths_of, route_words
from weberlink.figures.session import Records, SessionScore
from weberlink.figures.verdict import DEGRADED, FAILURE, Cause, verdict
from weberlink.figures.wording import ALARM, fault_words
from weberlink.protocol.states import State
from weberlink.session.composition.channels import measures_in
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import DTYPE
from weberlink.watching.events import EventLog
from weberlink.watching.hello import hello
from weberlink.watching.rings import RowSource, joined
from weberlink.watching.rows import FeltErrorPairs, Pace, Thinning, felt_message, samples_message

BACKLOG_S = 5.0
"""How far back `backlog` reaches."""
UNSCORED_S = 1.0
"""How many records wait to be scored while no figures are needed."""
UNNAMED = tuple(f"predictor {number}" for number in range(16))


class _Shown(NamedTuple):
    """Rows of a message: of a side (the same rows twice), or of the felt error (the master's and the slave's)."""

    kind: str
    first: Records
    second: Records


class _WatchedSide:
    """A source, and what is counted of its records."""

    def __init__(self, source: RowSource) -> None:
        self.source = source
        self.thinning = Thinning(source.rate_hz)
        self.pace = Pace()
        self.gripper_pace = Pace("gripper_updates_sent")
        self.faults: Counter[int] = Counter()
        self.last: Any = None
        self.has_ended = False
        """Whether its end was told."""
        self.paths: list[dict[str, Any]] = []
        """As its description says."""
        self._described: dict[str, Any] | None = None

    def take(self) -> tuple[Records, Records]:
        """The new records, and those of them to show."""
        records = self.source.read()
        if self.source.description is not self._described:
            self._described = self.source.description
            self.paths = paths_of(self._described)
        if len(records):
            fault = records["fault"].astype(np.int64)
            before = 0 if self.last is None else int(self.last["fault"])
            self.faults.update(fault[(np.diff(fault, prepend=before) != 0) & (fault > 0)].tolist())
            self.last = records[-1]
            self.pace.add(records)
            self.gripper_pace.add(records)
        return records, self.thinning.choose(records)


class WatchedSession:
    """A session of one or two sides; the second may join later.

    Args:
        name: of the session.
        first: source of the side that was found first.
    """

    def __init__(self, name: str, first: RowSource) -> None:
        self.name = name
        self.rate_hz = first.rate_hz
        self.origin = first.began
        """Time 0 of the rows [s], on the clock of the records."""
        description = first.description or {}
        torque = description.get("torque_bank")
        self._rotates = torque is not None
        bank = tuple(description.get("bank", ())) or UNNAMED
        system = description.get("system", {})
        self.measures: Measures | None = _known(measures_in, system, None)
        """How its deadband measures; None for the distance."""
        torque_bank = None if torque is None else tuple(torque)
        self.arm: ArmLayout | None = _known(arm_in, system, None)
        """The axes of a session in joint space; None for one in Cartesian space."""
        accounts: tuple[AccountParameters, ...] = _known(accounts_in, system, ())
        self._score = SessionScore(first.rate_hz, bank, torque_bank, self.measures, self.arm, accounts)
        self._unscored: dict[str, list[Records]] = {MASTER: [], SLAVE: []}
        """Records that wait to be scored: the cost of scoring is per call, not per record."""
        self.settings: dict[str, Any] | None = None
        """Settings in force as the daemons report them; None before that."""
        self.generation: int | None = None
        self._sides: dict[str, _WatchedSide] = {}
        self._felt = FeltErrorPairs(first.rate_hz)
        self.log = EventLog(first.rate_hz, first.began)
        self._backlog: deque[_Shown] = deque()
        self.admit(first)

    def admit(self, source: RowSource) -> None:
        """Add a side."""
        self._sides[source.side] = _WatchedSide(source)

    @property
    def score(self) -> SessionScore:
        """Score of all records read."""
        self._count()
        return self._score

    def _count(self) -> None:
        """Score the records that wait."""
        if any(self._unscored.values()):
            self._score.add(*(joined(self._unscored[side]) for side in (MASTER, SLAVE)))
            self._unscored = {MASTER: [], SLAVE: []}

    @property
    def sources(self) -> dict[str, RowSource]:
        return {name: side.source for name, side in self._each}

    @property
    def description(self) -> dict[str, Any]:
        """Description of a side that has one; empty if none has."""
        return next((source.description for source in self.sources.values() if source.description), {})

    @property
    def ring(self) -> Path:
        """The ring of one of its daemons."""
        return next(iter(self.sources.values())).ring

    @property
    def ended(self) -> bool:
        return all(side.source.drained for side in self._sides.values())

    @property
    def seen_from_start(self) -> bool:
        """Whether every record of both sides was read, so that the figures are those of the whole session."""
        return all(side.source.lost == 0 for side in self._sides.values())

    @property
    def settings_count(self) -> int | None:
        """Number of live changes in force, as of the newest record; None before the first record."""
        last = [side.last for side in self._sides.values() if side.last is not None]
        return int(last[0]["settings"]) if last else None

    @property
    def faults(self) -> dict[str, dict[str, int]]:
        """How often each fault began, by side and name."""
        return {
            name: {_fault_name(number): count for number, count in sorted(side.faults.items())}
            for name, side in self._each
        }

    @property
    def last(self) -> dict[str, Any]:
        """The newest record of each side that has one."""
        return {name: side.last for name, side in self._each if side.last is not None}

    @property
    def pace(self) -> dict[str, Pace]:
        """Pace by channel, as of the side that sends it."""
        master, slave = (self._sides.get(side) for side in (MASTER, SLAVE))
        names = ("position", "force") if self.arm is None else ("joint_angle", "joint_torque")
        paces = {names[1]: slave and slave.pace, names[0]: master and master.pace}
        if self.arm is not None and self.arm.gripper_torque is not None:
            paces |= {"gripper_torque": slave and slave.gripper_pace, "gripper_angle": master and master.gripper_pace}
        return {channel: pace or Pace() for channel, pace in paces.items()}

    @property
    def paths(self) -> dict[str, list[dict[str, Any]]]:
        """The paths of each side that knows its own, as of `weberlink.figures.paths`."""
        return {name: side.paths for name, side in self._each if side.paths}

    @property
    def _each(self) -> list[tuple[str, _WatchedSide]]:
        return sorted(self._sides.items())

    def close(self) -> None:
        for side in self._sides.values():
            side.source.close()

    def look(self, *, show: bool = True) -> list[dict[str, Any]]:
        """Read new records; returns messages with their rows if `show`."""
        empty = np.empty(0, DTYPE)
        taken = {name: side.take() for name, side in self._each}
        for name, (records, _) in taken.items():
            if len(records):
                self._unscored[name].append(records)
                self.log.look(name, records, self._sides[name].source.wall_offset_s)
        for name, side in self._each:
            self.log.take_paths(name, side.paths)
        self._note_ends()
        if any(sum(map(len, waiting)) > UNSCORED_S * self.rate_hz for waiting in self._unscored.values()):
            self._count()
        master, slave = (taken.get(name, (empty, empty)) for name in (MASTER, SLAVE))
        shown = [_Shown(name, rows, rows) for name, (_, rows) in taken.items() if len(rows)]
        if len(self._sides) == 2:
            pairs = self._felt.add(master[0], slave[1])
            shown += [_Shown("felt", *pairs)] if len(pairs[0]) else []
        self._remember(shown)
        return [self._message(*of) for of in shown] if show else []

    def _note_ends(self) -> None:
        """Tell the end of a side once, with its reason."""
        for name, side in self._each:
            if side.has_ended or not side.source.drained or side.last is None:
                continue
            side.has_ended = True
            self.log.flush()
            fault = _fault(side.last)
            outcome = "closed in order" if side.source.in_order else "its process died without closing its telemetry"
            outcome += "" if fault is None else f", with the fault {fault}"
            self.log.end(float(side.last["at"]), name, outcome, in_order=side.source.in_order and fault is None)

    def backlog(self) -> list[dict[str, Any]]:
        """Messages with the rows of the last seconds, for who begins to watch."""
        kinds = sorted({shown.kind for shown in self._backlog}, key=lambda kind: (kind == "felt", kind))
        of_kind = {kind: [shown for shown in self._backlog if shown.kind == kind] for kind in kinds}
        return [
            self._message(kind, joined(each.first for each in shown), joined(each.second for each in shown))
            for kind, shown in of_kind.items()
        ]

    def hello(self) -> dict[str, Any]:
        """The greeting; `readonly` says whether nobody may change anything."""
        told = hello(self.name, {name: side.source.description for name, side in self._sides.items()})
        axes = None if self.arm is None else list(self.arm.axes)
        return told | self._settings | {"rate_hz": self.rate_hz, "seen_from_start": self.seen_from_start, "axes": axes}

    def figures(self) -> dict[str, Any]:
        """All figures so far, and those of the last second."""
        pace, figures = self.pace, self.score.summary() | {"ways": self.score.ways(), "paths": self.paths}
        against = verdict(figures | {"faults": self.faults}).causes  # what the report would say
        asked = self.description.get("system", {}).get("link", {}).get("dscp")
        dscp = asked if isinstance(asked, int) else None
        told: dict[str, Any] = {
            "type": "figures",
            "session": self.name,
            "figures": figures,
            "alarms": [cause._asdict() for cause in (*self._present_faults(), *against)],
            "faults": self.faults,
            "faults_now": {name: _fault(side.last) for name, side in self._each},
            "ended": self.ended,
            "seen_from_start": self.seen_from_start,
            "packets_per_s_now": {channel: of.packets_per_s for channel, of in pace.items()},
            "reduction_now": {channel: of.reduction for channel, of in pace.items()},
            "engaged": {
                name: side.last is not None and bool(side.last["state"] == State.ENGAGED.value)
                for name, side in self._each
            },
            "button": self._button,
            "ways_now": ways_now(self.last),
            "paths": [
                facts | {"side": name, "words": route_words(facts), "class": dscp_words(facts, dscp)}
                for name, paths in self.paths.items()
                for facts in paths
            ],
            "finding": finding([facts for paths in self.paths.values() for facts in paths]),
        }
        return told | self._settings

    def _present_faults(self) -> Iterator[Cause]:
        """The faults that are active now, as alarms."""
        for name, side in self._each:
            fault = _fault(side.last)
            if fault is not None and not side.source.drained:
                told = fault_words(name, fault)
                yield Cause(FAILURE if told.level == ALARM else DEGRADED, f"{name}_{fault}", f"{name}: {told.text}")

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
            return felt_message(first, second, self.origin, self.measures, self.arm)
        return samples_message(kind, first, self.origin, rotation=self._rotates, arm=self.arm)

    def _remember(self, shown: list[_Shown]) -> None:
        self._backlog.extend(shown)
        newest = max((float(side.last["at"]) for side in self._sides.values() if side.last is not None), default=0.0)
        while self._backlog and float(self._backlog[0].first["at"][-1]) < newest - BACKLOG_S:
            self._backlog.popleft()


def _known(read: Callable[[dict[str, Any]], Any], system: dict[str, Any], unknown: Any) -> Any:
    """What a configuration says; `unknown` where it is missing or of another release."""
    try:
        return read(system)
    except ValueError:
        return unknown


def _fault(record: Any) -> str | None:
    return None if record is None or not record["fault"] else _fault_name(int(record["fault"]))


def _fault_name(number: int) -> str:
    """The name of a fault, or the number of one that another release knows."""
    try:
        return Fault(number).name.lower()
    except ValueError:
        return str(number)
