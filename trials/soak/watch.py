"""Observe a session from outside (telemetry, memory, descriptors, queues), and apply the laws of every moment."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic, sleep

import numpy as np

from tests.program import ENGAGED, Records
from trials.relay import Books
from trials.rig import NOTHING, Session, Side
from trials.soak import laws
from trials.soak.laws import Footprint
from weberlink.config import MASTER, SIDES, SLAVE

LOOK_S = 0.05
SAMPLE_S = 1.0
LONGEST_MEMORY_S = 60.0
_QUIET_LOOKS = 5


class SoakError(RuntimeError):
    """The soak cannot go on, or somebody wants it to end; what was seen until then is told."""


def footprint(pid: int) -> Footprint | None:
    """What a process holds, by /proc; None if there is no such process any more."""
    base = Path(f"/proc/{pid}")
    try:
        lines = "".join((base / name).read_text(errors="replace") for name in ("smaps_rollup", "status")).splitlines()
        held = {name: rest.split()[0] for name, _, rest in (line.partition(":") for line in lines) if rest.split()}
        numbers = (int(held[name]) for name in ("Rss", "Private_Dirty"))
        return Footprint(*numbers, sum(1 for _ in (base / "fd").iterdir()), int(held["Threads"]))
    except (OSError, KeyError):
        return None


def cpu_seconds(pid: int) -> float:
    """Time on a processor that all threads of a process have had; 0 if it has gone."""
    try:
        tasks = Path(f"/proc/{pid}/task").glob("*/schedstat")
        return 1e-9 * sum(int(path.read_text(encoding="ascii").split()[0]) for path in tasks)
    except OSError:
        return 0.0


@dataclass
class Life:
    """Of one daemon: what it held at which time [s], and in its first quiet moment; its first and its newest record."""

    side: str
    taken: list[tuple[float, Footprint]] = field(default_factory=list)
    at_rest: Footprint | None = None
    first: Records = field(default_factory=NOTHING.copy)
    newest: Records = field(default_factory=NOTHING.copy)


class Watch:
    """Follows a session; `say` is told each violation."""

    def __init__(self, session: Session, say: Callable[[str], None]) -> None:
        self._session, self._say = session, say
        self.period = 1.0 / session.configuration.system.rate_hz
        self._recent: dict[str, list[Records]] = {side: [] for side in SIDES}
        self._sampled_at = self._relay_late = 0.0
        self.ticks = self._buried_overruns = 0
        self.lives: dict[int, Life] = {}  # of all daemons, by process id
        self.longest_queue = dict.fromkeys(SIDES, 0)  # bytes that once waited in the socket

    @property
    def overruns(self) -> int:
        return self._buried_overruns + sum(side.ring.overrun for side in self._session.sides.values() if side.ring)

    def begin(self) -> None:
        """Forget what was seen before: a new stretch begins."""
        self.look()
        self.books()
        self._relay_late = 0.0
        self._recent = {side: [] for side in SIDES}

    def seen(self, side: str) -> Records:
        return np.concatenate([NOTHING, *self._recent[side]])

    def both(self) -> dict[str, Records]:
        return {side: self.seen(side) for side in SIDES}

    def look(self) -> None:
        """Take what is new, and apply the laws that hold at every moment."""
        for side in list(self._session.sides.values()):
            self._take(side)
        if monotonic() - self._sampled_at >= SAMPLE_S:
            self._sampled_at = monotonic()
            for pid, life in self.lives.items():
                if (held := footprint(pid)) is not None:
                    life.taken.append((monotonic(), held))
            for name, waiting in self._queues().items():
                self.longest_queue[name] = max(self.longest_queue[name], waiting)

    def bury(self, side: Side) -> None:
        """Take what a side that has ended has left."""
        self._take(side)
        self._buried_overruns += side.ring.overrun if side.ring else 0
        side.__exit__(None, None, None)

    def _take(self, side: Side) -> None:
        records = side.take()
        if not len(records):
            return
        life = self.lives.setdefault(side.daemon, Life(side.side))
        if not len(life.first):
            life.first = records[:1]
        self.ticks += len(records)
        self._recent[side.side].append(records)
        del self._recent[side.side][: -int(LONGEST_MEMORY_S / LOOK_S)]
        joined, life.newest = np.concatenate([life.newest, records]), records[-1:]
        for text in laws.always(joined, life.first, self.period, side.side):
            self._say(f"{side.side}: {text}")

    def _queues(self) -> dict[str, int]:
        master = self.books().master
        ports = {SLAVE: self._session.slave_address[1]} | ({} if master is None else {MASTER: master[1]})
        rows = [line.split() for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]]
        waiting = [(int(row[1].partition(":")[2], 16), int(row[4].partition(":")[2], 16)) for row in rows]
        return {side: sum(count for at, count in waiting if at == port) for side, port in ports.items()}

    def wait(self, seconds: float) -> None:
        self.until(lambda: False, seconds)

    def until(self, condition: Callable[[], object], limit: float) -> bool:
        """Go on looking until the condition holds; False if it does not within the limit [s]."""
        deadline = monotonic() + limit
        while True:
            self.look()
            if condition():
                return True
            for name, side in self._session.sides.items():
                if side.status is not None:
                    raise SoakError(f"the {name} has ended by itself: {side.outcome}")
            left = deadline - monotonic()
            if left <= 0.0:
                return False
            sleep(min(LOOK_S, left))

    def engaged(self, since: float = 0.0) -> bool:
        """Whether both are in a session, by a record of a tick after `since` [s]."""
        newest = [None if (side := self._session.sides.get(name)) is None else side.last for name in SIDES]
        return all(last is not None and last["state"] == ENGAGED and last["at"] > since for last in newest)

    def stall(self) -> float:
        """Longest time that either side, or the relay, stood still since `begin` [s]."""
        self.books()
        return max(*(laws.longest_gap(self.seen(side), self.period) for side in SIDES), self._relay_late)

    def books(self) -> Books:
        books = self._session.wire.books()
        self._relay_late = max(self._relay_late, books.late)
        return books

    def rest(self) -> list[str]:
        """The laws of a quiet moment: descriptors, threads, queues."""
        found = []
        for name, side in self._session.sides.items():
            if (held := footprint(side.daemon)) is not None and (life := self.lives.get(side.daemon)) is not None:
                life.at_rest = life.at_rest or held
                found += [f"{name}: {text}" for text in laws.holds_no_more(life.at_rest, held)]
        looks = []
        for _ in range(_QUIET_LOOKS):
            looks.append(self._queues())
            sleep(0.01)
        least = {side: min(look.get(side, 0) for look in looks) for side in SIDES}
        return found + [f"{side}: {n} bytes wait in the socket all the time" for side, n in least.items() if n]
