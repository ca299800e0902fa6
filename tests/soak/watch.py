"""Observe a rig from outside (telemetry, memory, descriptors, queues), and apply the laws that hold at every moment."""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import monotonic, sleep

import numpy as np

from tests.soak import laws
from tests.soak.processes import Footprint, footprint, socket_queue
from tests.soak.rig import Life, Rig, RigError
from tests.soak.wire import Books
from weberlink.system.configuration import MASTER, SIDES, SLAVE
from weberlink.system.scoring.session import Records

LOOK_S = 0.05
SAMPLE_S = 1.0
LONGEST_MEMORY_S = 60.0
_QUIET_LOOKS = 5


@dataclass
class Samples:
    """What a process held, over one life: time [s] and footprint."""

    name: str
    taken: list[tuple[float, Footprint]] = field(default_factory=list)
    at_rest: Footprint | None = None
    """In its first quiet moment."""

    def series(self, quantity: str) -> list[tuple[float, float]]:
        return [(at, float(getattr(held, quantity))) for at, held in self.taken]


class Watch:
    """Follows a rig.

    Attributes:
        ticks: that were seen.
        overruns: records that nobody read in time; of these nothing is known.
        samples: of each process of each life.
        longest_queue: bytes that once waited in the socket of a side.
    """

    def __init__(self, rig: Rig, say: Callable[[str], None]) -> None:
        self._rig = rig
        self._say = say
        self._period = 1.0 / rig.rate_hz
        self._recent: dict[str, list[Records]] = {side: [] for side in SIDES}
        self._firsts: dict[int, Records] = {}
        self._former: dict[int, Records] = {}
        self._sampled_at = 0.0
        self._overruns_of_the_dead = 0
        self._relay_late = 0.0
        self.ticks = 0
        self.samples: dict[int, Samples] = {}
        self.longest_queue = dict.fromkeys(SIDES, 0)
        self.extra: dict[str, int] = {}
        """Other processes to be sampled, by name."""

    @property
    def overruns(self) -> int:
        return self._overruns_of_the_dead + sum(life.overrun for life in self._rig.lives.values())

    def begin(self) -> None:
        """Forget what was seen before: a new stretch begins."""
        self.look()
        self.books()
        self._relay_late = 0.0
        for side in SIDES:
            self._recent[side] = []

    def seen(self, side: str) -> Records:
        """What a side has written since `begin`."""
        return np.concatenate([laws.nothing(), *self._recent[side]])

    def both(self) -> dict[str, Records]:
        return {side: self.seen(side) for side in SIDES}

    def look(self) -> None:
        """Take what is new, and apply the laws that hold at every moment."""
        for side, life in list(self._rig.lives.items()):
            self._take(side, life, life.read())
        if monotonic() - self._sampled_at >= SAMPLE_S:
            self._sampled_at = monotonic()
            self._sample()

    def bury(self, life: Life, rest: Records | None) -> None:
        """Take what a daemon that was killed has left."""
        self._overruns_of_the_dead += life.overrun
        self._take(life.order.side, life, rest)
        self._firsts.pop(life.pid, None)
        self._former.pop(life.pid, None)

    def _take(self, side: str, life: Life, records: Records | None) -> None:
        if records is None or not len(records):
            return
        self.ticks += len(records)
        self._recent[side].append(records)
        del self._recent[side][: -int(LONGEST_MEMORY_S / LOOK_S)]
        before = self._former.get(life.pid)
        joined = records if before is None else np.concatenate([before, records])
        self._former[life.pid] = records[-1:].copy()
        first = self._firsts.setdefault(life.pid, records[:1].copy())
        since_birth = records if before is None else np.concatenate([first, records])
        found = laws.counters_grow(joined) + laws.deadlines_hold(since_birth, self._period)
        if side == MASTER:
            found += laws.force_rests(records)
        for text in found:
            self._say(f"{side}: {text}")

    def _sample(self) -> None:
        pids = {life.pid: side for side, life in self._rig.lives.items()}
        pids |= {pid: name for name, pid in self.extra.items()}
        for pid, name in pids.items():
            held = footprint(pid)
            if held is not None:
                self.samples.setdefault(pid, Samples(name)).taken.append((monotonic(), held))
        for side, port in self._ports().items():
            self.longest_queue[side] = max(self.longest_queue[side], socket_queue(port).waiting)

    def _ports(self) -> dict[str, int]:
        master = self.books().master
        return {SLAVE: self._rig.slave_address[1]} | ({} if master is None else {MASTER: master[1]})

    def wait(self, seconds: float) -> None:
        """Go on looking for so long.

        Raises:
            RigError: a daemon has ended by itself.
        """
        self.until(lambda: False, seconds)

    def until(self, condition: Callable[[], bool], limit: float) -> bool:
        """Go on looking until the condition holds; False if it does not within the limit [s].

        Raises:
            RigError: a daemon has ended by itself.
        """
        deadline = monotonic() + limit
        while True:
            self.look()
            if condition():
                return True
            for side, life in self._rig.lives.items():
                if not life.daemon.running:
                    raise RigError(f"the {side} has ended by itself: {life.daemon.finish()['outcome']}")
            left = deadline - monotonic()
            if left <= 0.0:
                return False
            sleep(min(LOOK_S, left))

    def state_of(self, side: str) -> int:
        """The newest state; 0 before the first record."""
        life = self._rig.lives.get(side)
        return 0 if life is None or life.last is None else int(life.last["state"])

    def engaged(self, since: float = 0.0) -> bool:
        """Whether both are in a session, by a record of a tick after `since` [s]."""
        return all(self.state_of(side) == laws.ENGAGED and self._rig.lives[side].last["at"] > since for side in SIDES)

    def stall(self) -> float:
        """Longest time that either side, or the relay, stood still since `begin` [s]."""
        self.books()
        return max([laws.longest_gap(self.seen(side), self._period) for side in SIDES] + [self._relay_late])

    def books(self) -> Books:
        """Of the relay, as of now; what it was late is not forgotten."""
        books = self._rig.wire.books()
        self._relay_late = max(self._relay_late, books.late)
        return books

    def rest(self) -> list[str]:
        """The laws of a quiet moment: descriptors, threads, queues."""
        found = []
        for side, life in self._rig.lives.items():
            held = footprint(life.pid)
            if held is None:
                continue
            samples = self.samples.setdefault(life.pid, Samples(side))
            if samples.at_rest is None:
                samples.at_rest = held
            found += [f"{side}: {text}" for text in laws.holds_no_more(samples.at_rest, held)]
        waiting: dict[str, list[int]] = {side: [] for side in SIDES}
        for _ in range(_QUIET_LOOKS):
            for side, port in self._ports().items():
                waiting[side].append(socket_queue(port).waiting)
            sleep(0.01)
        return found + [f"{side}: {text}" for side in SIDES for text in laws.queue_drains(waiting[side])]
