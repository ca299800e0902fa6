"""One session as it is watched: its figures, exactly those of the launcher's report, and the rows of its last seconds.

Owns what is known of a session and how it is put for a page. Knows neither where records come from nor who looks.
"""

from collections import Counter, deque
from typing import Any, NamedTuple

import numpy as np

from weberlink.apps.monitor import felt, samples
from weberlink.apps.monitor.feed import Feed
from weberlink.apps.monitor.hello import hello
from weberlink.apps.monitor.pace import Pace
from weberlink.apps.monitor.pieces import joined
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.scoring.session import Records, SessionScore
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import DTYPE

BACKLOG_S = 5.0
"""How much a page that opens sees of what was before."""
UNSCORED_S = 1.0
"""How much waits to be scored while nobody asks for figures."""
UNNAMED = tuple(f"predictor {number}" for number in range(16))


class _Shown(NamedTuple):
    """Rows that a message shows: of a side, twice the same; of the felt error, the master's and the slave's."""

    kind: str
    first: Records
    second: Records


class _Side:
    """What belongs to one side: where its records come from, and what has become of them."""

    def __init__(self, feed: Feed) -> None:
        self.feed = feed
        self.thinning = samples.Thinning(feed.rate_hz)
        self.pace = Pace()
        self.faults: Counter[int] = Counter()
        self.last: Any = None

    def take(self) -> tuple[Records, Records]:
        """The next records, all of them and those to show."""
        records = self.feed.read()
        if len(records):
            fault = records["fault"].astype(np.int64)
            before = 0 if self.last is None else int(self.last["fault"])
            self.faults.update(fault[(np.diff(fault, prepend=before) != 0) & (fault > 0)].tolist())
            self.last = records[-1]
            self.pace.add(records)
        return records, self.thinning.choose(records)


class Session:
    """A session of one or two sides; sides may join one after the other.

    Args:
        name: of the session.
        first: the feed of the side that was found first.
        remote: whether it runs on another host.
    """

    def __init__(self, name: str, first: Feed, *, remote: bool = False) -> None:
        self.name = name
        self.remote = remote
        self.rate_hz = first.rate_hz
        self.origin = first.began
        """Time 0 of the rows [s], on the clock of the records."""
        description = first.description or {}
        torque = description.get("torque_bank")
        bank, torque_bank = tuple(description.get("bank", ())), None if torque is None else tuple(torque)
        self._score = SessionScore(first.rate_hz, bank or UNNAMED, torque_bank)
        self._rotates = torque_bank is not None
        self._unscored: dict[str, list[Records]] = {MASTER: [], SLAVE: []}
        """What waits to be scored: a score costs by the call, not by the record."""
        self.settings: dict[str, Any] | None = None
        """As the daemons say them; None if they were not asked, or do not answer."""
        self.generation: int | None = None
        self.settings_asked_at: int | None = None
        """The count of changes in the records when the daemons were last asked."""
        self._sides: dict[str, _Side] = {}
        self._felt = felt.FeltError(first.rate_hz)
        self._backlog: deque[_Shown] = deque()
        self.admit(first)

    def admit(self, feed: Feed) -> None:
        """Add a side."""
        self._sides[feed.side] = _Side(feed)

    @property
    def score(self) -> SessionScore:
        """Of everything that was read."""
        if any(self._unscored.values()):
            self._score.add(*(joined(self._unscored[side]) for side in (MASTER, SLAVE)))
            self._unscored = {MASTER: [], SLAVE: []}
        return self._score

    @property
    def feeds(self) -> dict[str, Feed]:
        return {name: side.feed for name, side in sorted(self._sides.items())}

    @property
    def ended(self) -> bool:
        """Whether nothing more can come."""
        return all(side.feed.drained for side in self._sides.values())

    @property
    def seen_from_start(self) -> bool:
        """Whether every record of both sides was seen, so that the figures are those of the whole session."""
        return all(side.feed.lost == 0 for side in self._sides.values())

    @property
    def settings_count(self) -> int | None:
        """How many changes are in force, as the newest record says; None before the first."""
        last = [side.last for side in self._sides.values() if side.last is not None]
        return int(last[0]["settings"]) if last else None

    @property
    def faults(self) -> dict[str, dict[str, int]]:
        """How often each fault began, by side and name."""
        return {
            name: {Fault(number).name.lower(): count for number, count in sorted(side.faults.items())}
            for name, side in sorted(self._sides.items())
        }

    @property
    def last(self) -> dict[str, Any]:
        """The newest record of each side that has one."""
        return {name: side.last for name, side in sorted(self._sides.items()) if side.last is not None}

    @property
    def pace(self) -> dict[str, Pace]:
        """By channel, as the side that sends it has it."""
        senders = {"force": SLAVE, "position": MASTER}
        return {channel: self._sides[side].pace if side in self._sides else Pace() for channel, side in senders.items()}

    def close(self) -> None:
        for side in self._sides.values():
            side.feed.close()

    def look(self, *, show: bool = True) -> list[dict[str, Any]]:
        """Take what has come, and return the messages that show it, if they are wanted."""
        empty = np.empty(0, DTYPE)
        taken = {name: side.take() for name, side in sorted(self._sides.items())}
        for name, (records, _) in taken.items():
            if len(records):
                self._unscored[name].append(records)
        if any(sum(map(len, waiting)) > UNSCORED_S * self.rate_hz for waiting in self._unscored.values()):
            assert self.score
        master, slave = (taken.get(name, (empty, empty)) for name in (MASTER, SLAVE))
        shown = [_Shown(name, rows, rows) for name, (_, rows) in taken.items() if len(rows)]
        if len(self._sides) == 2:
            pairs = self._felt.add(master[0], slave[1])
            shown += [_Shown("felt", *pairs)] if len(pairs[0]) else []
        self._remember(shown)
        return [self._message(*of) for of in shown] if show else []

    def backlog(self) -> list[dict[str, Any]]:
        """The messages of the last seconds, for a page that opens."""
        kinds = sorted({shown.kind for shown in self._backlog}, key=lambda kind: (kind == "felt", kind))
        of_kind = {kind: [shown for shown in self._backlog if shown.kind == kind] for kind in kinds}
        return [
            self._message(kind, joined(each.first for each in shown), joined(each.second for each in shown))
            for kind, shown in of_kind.items()
        ]

    def hello(self) -> dict[str, Any]:
        """The greeting; `readonly` is whether nobody may change anything."""
        told = hello(self.name, {name: side.feed.description for name, side in self._sides.items()}, remote=self.remote)
        if self.settings is not None:
            told |= {"settings": self.settings, "generation": self.generation}
        return told | {"rate_hz": self.rate_hz, "seen_from_start": self.seen_from_start}

    def figures(self) -> dict[str, Any]:
        """All figures so far, and those of the last second."""
        pace = self.pace
        told: dict[str, Any] = {
            "type": "figures",
            "session": self.name,
            "figures": self.score.summary(),
            "faults": self.faults,
            "faults_now": {name: _fault(side.last) for name, side in sorted(self._sides.items())},
            "ended": self.ended,
            "seen_from_start": self.seen_from_start,
            "packets_per_s_now": {channel: of.packets_per_s for channel, of in pace.items()},
            "reduction_now": {channel: of.reduction for channel, of in pace.items()},
        }
        if self.settings is not None:
            told |= {"settings": self.settings, "generation": self.generation}
        return told

    def _message(self, kind: str, first: Records, second: Records) -> dict[str, Any]:
        if kind == "felt":
            return felt.message(first, second, self.origin)
        return samples.message(kind, first, self.origin, rotation=self._rotates)

    def _remember(self, shown: list[_Shown]) -> None:
        self._backlog.extend(shown)
        newest = max((float(side.last["at"]) for side in self._sides.values() if side.last is not None), default=0.0)
        while self._backlog and float(self._backlog[0].first["at"][-1]) < newest - BACKLOG_S:
            self._backlog.popleft()


def _fault(record: Any) -> str | None:
    return None if record is None or not record["fault"] else Fault(int(record["fault"])).name.lower()
