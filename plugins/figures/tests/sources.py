"""Records and sources made by hand, for what is tested without a daemon."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from tests.records import ticks as made_ticks
from tests.session.systems import CONFIGS
from tests.wait import loop_in_a_thread
from weberlink.config import load
from weberlink.protocol.states import State
from weberlink.session.composition.channels import banks
from weberlink.session.control_socket import ControlSocket, path_beside
from weberlink.session.tuning import LiveSettings, Tuning
from weberlink.telemetry.reader import DTYPE, Records
from weberlink.telemetry.ring import RingWriter
from weberlink.telemetry.runtime_directory import listening_socket
from weberlink_figures.session import joined
from weberlink_figures.watching.session import WatchedSession

RATE = 1000.0
WALL_OFFSET_S = 1_763_000_000.0
"""From the clock of the records to the wall clock."""
BANK = ("zoh", "linear", "plane", "sphere")


def records(ticks: int, *, first: int = 0, phase: float = 0.0, seed: int | None = None) -> Records:
    """Ticks of an engaged side; with a seed, everything that the felt error needs is noise."""
    tick = np.arange(first, first + ticks)
    unknown = dict.fromkeys(("rtt_us", "one_way_us", "peer_at"), np.nan)
    made = made_ticks(ticks, tick=tick, at=10.0 + phase + tick / RATE, state=State.ENGAGED.value, **unknown)
    if seed is not None:
        noise = np.random.default_rng(seed)
        for name in ("raw", "output", "decoded", "position"):
            made[name][:, :3] = noise.normal(size=(ticks, 3))
        made["bound"] = 1.5
    return made


def write(ring: RingWriter, made: Records) -> None:
    for record in made:
        values: list[float] = []
        for value in record.item():
            values += value.tolist() if isinstance(value, np.ndarray) else [value]
        ring.write(values)


def description(side: str, file: str | Path = "loopback.yaml") -> dict[str, Any]:
    """As a daemon of this configuration writes it, but for what may be changed."""
    system = load(CONFIGS / file).system
    force, torque = banks(system)
    return {
        "side": side,
        "file": file,
        "pid": 1,
        "rate_hz": system.rate_hz,
        "system": system.model_dump(mode="json", exclude={"link": {"key_file"}}),
        "bank": list(force),
        **({} if torque is None else {"torque_bank": list(torque)}),
        "changes": ["weber"],
    }


class HandSource:
    """A source as `RingSource` that is given its records by hand."""

    def __init__(self, side: str, *, began: float = 10.0, ring: Path = Path("/nonexistent/ring")) -> None:
        self.side, self.rate_hz, self.began, self.ring = side, RATE, began, ring
        self.wall_offset_s, self.description = WALL_OFFSET_S, description(side)
        self.in_order = self.drained = self.is_closed = self._over = False
        self.written = self.lost = 0
        self._waiting: list[Records] = []

    def put(self, made: Records) -> None:
        """Records for the next `read`."""
        self._waiting.append(made)
        self.written += len(made)

    def end(self, *, in_order: bool) -> None:
        """The writer has ended, and all its records were put."""
        self._over, self.in_order = True, in_order

    def read(self) -> Records:
        waiting, self._waiting = self._waiting, []
        self.drained = self._over
        return joined([np.empty(0, DTYPE), *waiting])

    def close(self) -> None:
        self.is_closed = True


def watched(*made: Records) -> WatchedSession:
    """A session of the slave's side that was looked at after each of these records."""
    source = HandSource("slave")
    session = WatchedSession("7", source)
    for piece in made:
        source.put(piece)
        session.look()
    return session


def pieces(made: Records, cuts: list[int]) -> list[Records]:
    return np.split(made, sorted(cut % (len(made) + 1) for cut in cuts))


class Daemon:
    """A side with its telemetry and its control socket, which notes when it was stopped."""

    def __init__(self, folder: Path, session: str, side: str, loop: asyncio.AbstractEventLoop) -> None:
        self.path = path = folder / f"weberlink-{session}-{side}.ring"
        self.ring = RingWriter(path, side=side, rate_hz=1000.0, capacity=10_000)
        self.ticks = 0
        self.tick(20)
        self.tuning = Tuning(LiveSettings(0.1, "zoh"), {}, lambda *_: None)
        self.proposed: list[object] = []
        self.halted_at: float | None = None
        self.control = ControlSocket(listening_socket(path_beside(path)), self)
        loop.call_soon_threadsafe(self.control.open, loop)

    def tick(self, count: int) -> None:
        write(self.ring, records(count, first=self.ticks, seed=self.ticks))
        self.ticks += count

    def propose(self, change: object, now: float) -> str | None:
        self.proposed.append(change)
        return "a daemon of a test makes no change"

    def stop(self, now: float, reason: str) -> None:
        raise AssertionError(reason)

    def emergency(self, now: float) -> None:
        self.halted_at = monotonic()

    def close(self) -> None:
        self.control.close()
        self.ring.close()


@contextmanager
def daemons(folder: Path, session: str = "7") -> Iterator[list[Daemon]]:
    """Both sides of a session, in a thread, that write a record each millisecond."""
    over: list[bool] = []

    async def tick() -> None:
        while not over:
            for side in sides:
                side.tick(20)
            await asyncio.sleep(0.02)

    with loop_in_a_thread() as loop:
        sides = [Daemon(folder, session, side, loop) for side in ("master", "slave")]
        ticking = asyncio.run_coroutine_threadsafe(tick(), loop)
        try:
            yield sides
        finally:
            over.append(True)
            ticking.result()
    for side in sides:
        side.close()
