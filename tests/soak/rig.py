"""Two daemons, their key and the relay between them, as the launcher makes them; nothing is left at the end."""

import os
import signal
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp
from time import monotonic
from types import TracebackType
from typing import Any, Self

import yaml

from tests.program import free_port
from tests.soak.wallclock import WallClock, wall_clock
from tests.soak.wire import Wire
from weberlink.protocol.keys import generate
from weberlink.system.configuration import SIDES, Configuration, load
from weberlink.system.launcher import Daemon
from weberlink.system.order import DaemonOrder
from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.ring import default_path

CONFIGURATION = Path(__file__).parents[2] / "configs" / "loopback.yaml"
LINK = "127.0.0.1"
SILENCE_MS = 250.0
"""A shared machine stalls for up to 110 ms now and then, which is not the fault that is being looked for."""


class RigError(RuntimeError):
    """A daemon has ended by itself, or could not be started."""


class Life:
    """A daemon from its start to its end, and all that its telemetry has said.

    Attributes:
        reader: of its ring; outlives it.
        last: the newest record; None before the first.
        overrun: records that nobody read in time.
    """

    def __init__(self, order: DaemonOrder, environment: Mapping[str, str]) -> None:
        self.order = order
        self.began = monotonic()
        with _environment(environment):
            self.daemon = Daemon(order)
        self._reader: RingReader | None = None
        self._overrun = 0
        self.last: Any = None

    @property
    def pid(self) -> int:
        return self.daemon.pid

    @property
    def overrun(self) -> int:
        return self._overrun if self._reader is None else self._reader.overrun

    @property
    def started_wall_s(self) -> float | None:
        """When the daemon made its ring, by its own wall clock; None while it has none."""
        return None if self._reader is None else self._reader.started_wall_s

    def read(self) -> Records | None:
        """What it has written since the last look; None if it has no ring yet."""
        if self._reader is None and not self._open():
            return None
        assert self._reader is not None
        records = self._reader.read()
        if len(records):
            self.last = records[-1]
        return records

    def _open(self) -> bool:
        try:
            reader = RingReader(self.order.ring)
        except FileNotFoundError:
            return False
        if reader.pid != self.pid:  # of the life before, which was killed
            reader.close()
            return False
        self._reader = reader
        return True

    def close(self) -> None:
        """Let go of the ring, which stays until the next life replaces it."""
        if self._reader is not None:
            self._overrun = self._reader.overrun
            self._reader.close()
            self._reader = None


class Rig:
    """A running system, as a context manager that leaves no process and no file behind.

    Args:
        seed: of the relay.
        steps: whether the wall clock of the daemons is to be stepped, where that can be done.
        silence_ms: limit of silence.
        file: the configuration, whose link is replaced.
        overrides: for the daemons, as of `--set`.
    """

    def __init__(
        self,
        *,
        seed: int = 1,
        steps: bool = False,
        silence_ms: float = SILENCE_MS,
        file: Path = CONFIGURATION,
        overrides: tuple[str, ...] = (),
    ) -> None:
        self._seed = seed
        self._origin, self._overrides = file, overrides
        self._steps = steps
        self._silence_ms = silence_ms
        self.wall: WallClock | None = None
        self._stack = ExitStack()
        self.lives: dict[str, Life] = {}

    def __enter__(self) -> Self:
        self.folder = Path(mkdtemp(prefix="weberlink-soak-"))
        self._stack.callback(_remove, self.folder)
        try:
            self.slave_address = (LINK, free_port())
            if self._steps:
                self.wall = self._stack.enter_context(wall_clock(self.folder))
            self.wire = self._stack.enter_context(Wire(self.slave_address, self._seed))
            self.file = self._write_configuration()
            self.configuration: Configuration = load(self.file, self._overrides)
            self._stack.callback(self._end)
            for side in reversed(SIDES):
                self.start(side)
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stack.close()

    def _write_configuration(self) -> Path:
        key = self.folder / "soak.key"
        generate(key)
        described = yaml.safe_load(self._origin.read_text(encoding="utf-8"))
        described["link"] = {
            "listen": "{}:{}".format(*self.slave_address),
            "slave": "{}:{}".format(*self.wire.front),
            "security": "psk",
            "key_file": str(key),
            "silence_ms": self._silence_ms,
        }
        file = self.folder / "soak.yaml"
        file.write_text(yaml.safe_dump(described, sort_keys=False), encoding="utf-8")
        return file

    @property
    def silence(self) -> float:
        return self.configuration.system.link.silence_ms * 1e-3

    @property
    def rate_hz(self) -> float:
        return self.configuration.system.rate_hz

    def ring(self, side: str) -> str:
        return str(default_path(f"{os.getpid()}-{side}"))

    def start(self, side: str, *also: str) -> Life:
        """Start a daemon, with these overrides too; any earlier one of that side must have ended."""
        overrides = (*self._overrides, *also)
        order = DaemonOrder(side, str(self.file), overrides, self.ring(side), parent=os.getpid())
        life = self.lives[side] = Life(order, {} if self.wall is None else self.wall.environment)
        return life

    def kill(self, side: str) -> tuple[Life, Records | None]:
        """kill -9; returns what has ended, and the rest of its telemetry."""
        life = self.lives.pop(side)
        os.kill(life.pid, signal.SIGKILL)
        life.daemon.finish()
        rest = life.read()
        life.close()
        return life, rest

    def signal(self, side: str, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            os.kill(self.lives[side].pid, number)

    def stop(self) -> dict[str, dict[str, Any]]:
        """End both in order, the master first; returns their summaries."""
        summaries = {}
        for side in SIDES:
            if (life := self.lives.get(side)) is not None:
                life.daemon.stop(signal.SIGTERM)
                summaries[side] = life.daemon.finish()
                life.read()
        return summaries

    def _end(self) -> None:
        for life in self.lives.values():
            if life.daemon.running:
                with suppress(ProcessLookupError):
                    os.kill(life.pid, signal.SIGCONT)
                life.daemon.stop(signal.SIGTERM)
        for life in self.lives.values():
            life.daemon.finish()
        for life in self.lives.values():
            life.close()
        for side in SIDES:  # and what a killed daemon left beside its ring
            ring = Path(self.ring(side))
            for path in ring.parent.glob(f"{ring.stem}.*"):
                path.unlink()


def _remove(folder: Path) -> None:
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()


@contextmanager
def _environment(changes: Mapping[str, str]) -> Iterator[None]:
    """What a child that is started now inherits."""
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
