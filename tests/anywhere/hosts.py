"""A user's host in the test bed: a folder with the shipped file and the relay's secret, and commands typed there."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep
from types import TracebackType
from typing import Any, Self, TypeVar

import numpy as np

from tests.anywhere.testbed import MAILBOX_URL, SECRET, Home
from tests.program import ROOT, Program, Records, Telemetry
from weberlink.anywhere.peers import KEY_BYTES, Peer, PeerStore
from weberlink.protocol.states import State
from weberlink.telemetry.ring import default_path

T = TypeVar("T")
SHIPPED = ROOT / "configs" / "anywhere.yaml"
FILE = SHIPPED.name
ENGAGED = State.ENGAGED.value
LOOK_S = 0.01


def within(seconds: float, condition: Callable[[], T]) -> T | None:
    """The first value of the condition that counts as true; None if there is none in this time."""
    deadline = monotonic() + seconds
    while not (value := condition()):
        if monotonic() > deadline:
            return None
        sleep(LOOK_S)
    return value


class Host:
    """What a user has.

    Args:
        home: where the host is.
        folder: for its files; made.
    """

    def __init__(self, home: Home, folder: Path) -> None:
        self.home, self.folder = home, folder
        folder.mkdir()
        shutil.copy(SHIPPED, folder)
        secret = folder / "turn.secret"
        secret.touch(mode=0o600)
        secret.write_text(SECRET)
        self.peers = PeerStore(folder / "data" / "weberlink" / "peers")

    @property
    def prefix(self) -> tuple[str, ...]:
        """Runs a command in the user's folder."""
        user = (f"HOME={self.folder}", f"XDG_DATA_HOME={self.folder / 'data'}")
        return (*self.home.prefix, "env", f"--chdir={self.folder}", *user)

    def command(self, side: str, *arguments: str) -> "Command":
        """Type `weberlink SIDE anywhere.yaml ARGUMENTS`."""
        return Command(self, side, *arguments)


def acquaint(robot: Host, operator: Host) -> None:
    """Make two hosts known to each other, as pairing does."""
    key = bytes(range(KEY_BYTES))
    operator.peers.add(Peer("robot", "robot", "operator", "slave", key, MAILBOX_URL))
    robot.peers.add(Peer("operator", "operator", "robot", "master", key, MAILBOX_URL))


class Command(Program):
    """A side of a session as a process; dead at the end of the `with`.

    Attributes:
        began: when it was started, on the monotonic clock [s].
    """

    def __init__(self, host: Host, side: str, *arguments: str) -> None:
        self.side = side
        self._ring: Telemetry | None = None
        self._report = host.folder / f"{side}.json"
        self._report.unlink(missing_ok=True)
        self._output = (host.folder / f"{side}.txt").open("w+b")
        self.began = monotonic()
        super().__init__(
            *(side, FILE, "--json", self._report.name, *arguments), prefix=host.prefix, terminal=self._output.fileno()
        )

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        super().__exit__(kind, error, at)
        self._output.close()

    def __enter__(self) -> Self:
        return self

    @property
    def said(self) -> str:
        """What it has written for its user."""
        return Path(self._output.name).read_text(errors="replace")

    @property
    def report(self) -> dict[str, Any]:
        """Its report, once it has ended; empty if it gave none."""
        if not self._report.exists():
            return {}
        report: dict[str, Any] = json.loads(self._report.read_text(encoding="utf-8"))
        return report

    @property
    def status(self) -> int | None:
        """Exit status; None while it runs."""
        return self._process.poll()

    @property
    def records(self) -> Records:
        """All that its daemon has recorded so far."""
        if self._ring is None:
            if not default_path(f"{self.pid}-{self.side}").exists():
                return np.empty(0, np.dtype([("at", "<f8"), ("state", "u1")]))
            self._ring = self.telemetry(self.side)
        return self._ring.records

    def first_engaged(self, seconds: float, since: float = 0.0) -> float | None:
        """The first tick in a session from `since` on [s]; None if there is none in this time, or the command ends."""

        def first() -> float | None:
            records = self.records
            ticks = records["at"][(records["state"] == ENGAGED) & (records["at"] >= since)]
            return float(ticks[0]) if len(ticks) else None

        within(seconds, lambda: first() is not None or self.status is not None)
        return first()
