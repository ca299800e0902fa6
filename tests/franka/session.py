"""A live session with the simulated robot at its end, what its daemons record, and the controller process it starts."""

import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from signal import SIGCONT, SIGTERM
from time import monotonic, sleep
from types import TracebackType
from typing import Any, Self

import numpy as np

from tests.franka.robot import SimulatedRobot
from tests.soak.rig import Life, Rig
from weberlink.protocol.states import State
from weberlink.system.configuration import SIDES, SLAVE
from weberlink.telemetry.reader import DTYPE

FILE = Path(__file__).parents[2] / "configs" / "franka.yaml"
CONTROLLER = b"weberlink.slave.robots.franka.controller"
ENGAGED = State.ENGAGED.value
LOOK_S = 0.05
MOVES_RAD_S = 0.02
"""Joint speed above which the arm follows the hand."""

Records = Any


class FrankaSession:
    """Both daemons before a simulated robot; a context manager that leaves no process behind.

    Args:
        folder: for files of the robot.
        host: where the robot listens.
        seed: of the relay between the daemons.
        lenient: of the robot.
        overrides: of the configuration, as of `--set`.
    """

    def __init__(
        self, folder: Path, host: str, seed: int, lenient: bool = False, overrides: Sequence[str] = ()
    ) -> None:
        self._folder, self._host, self._seed, self._lenient = folder, host, seed, lenient
        self._overrides = (f"slave.robot.host={host}", *overrides)
        self._stack = ExitStack()
        self._pieces: dict[str, list[Records]] = {side: [] for side in SIDES}

    def __enter__(self) -> Self:
        try:
            self._start_robot()
            self._stack.callback(self._close_robot)
            self.rig = Rig(seed=self._seed, file=FILE, overrides=self._overrides)
            self._stack.enter_context(self.rig)
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stack.close()

    def _start_robot(self) -> None:
        self.robot = SimulatedRobot(self._folder, self._host, self._lenient)
        try:
            self.robot.wait_until_ready()
        except BaseException:
            self.robot.close()
            raise

    def _close_robot(self) -> None:
        self.robot.close()

    def restart_robot(self) -> None:
        """Another robot in the place of this one."""
        self.robot.close()
        self._start_robot()

    def life(self, side: str) -> Life | None:
        return self.rig.lives.get(side)

    def watch(self, seconds: float) -> None:
        """Keep what the daemons record for so long."""
        until = monotonic() + seconds
        while (left := until - monotonic()) > 0.0:
            sleep(min(LOOK_S, left))
            self._read()

    def _read(self) -> None:
        for side, life in self.rig.lives.items():
            records = life.read()
            if records is not None and len(records):
                self._pieces[side].append(records.copy())

    def recorded(self, side: str, since: float) -> Records:
        """All records of a side from then on (monotonic)."""
        self._read()
        records = np.concatenate([np.empty(0, DTYPE), *self._pieces[side]])
        return records[records["at"] >= since]

    def follows(self) -> bool:
        """Whether both sides are in the session and the arm moves."""
        self._read()
        lasts = [life.last for life in self.rig.lives.values()]
        if len(lasts) < len(SIDES) or any(last is None or last["state"] != ENGAGED for last in lasts):
            return False
        if any(monotonic() - float(last["at"]) > 0.5 for last in lasts):
            return False
        row = self.robot.truth.latest()
        return bool(row["moving"]) and float(np.abs(row["dq"]).max()) > MOVES_RAD_S

    def wait_until_it_follows(self, within: float) -> float | None:
        """Seconds until the arm follows the hand; None if it does not in time."""
        began = monotonic()
        while monotonic() < began + within:
            if self.follows():
                return monotonic() - began
            self.watch(LOOK_S)
        return None

    def controller(self) -> int | None:
        """Process id of the controller that the slave daemon has started; None if there is none."""
        life = self.life(SLAVE)
        if life is None:
            return None
        return next((pid for pid in children(life.pid) if CONTROLLER in command_line(pid)), None)

    def end(self, side: str) -> dict[str, Any]:
        """Stop a daemon in order, or take what an ended one has said; returns its summary."""
        life = self.rig.lives.pop(side, None)
        if life is None:
            return {}
        life.daemon.stop(SIGCONT)
        life.daemon.stop(SIGTERM)
        summary = life.daemon.finish()
        life.read()
        life.close()
        return summary

    def wait_for_end(self, side: str, within: float) -> dict[str, Any] | None:
        """The summary of a daemon that ends by itself; None if it does not in time."""
        life = self.life(side)
        until = monotonic() + within
        while life is not None and life.daemon.running and monotonic() < until:
            self.watch(LOOK_S)
        return None if life is None or life.daemon.running else self.end(side)


def children(pid: int) -> Sequence[int]:
    """Direct children of all threads of a process."""
    found: list[int] = []
    for tasks in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            found += map(int, tasks.read_text(encoding="utf-8").split())
        except OSError:  # the thread has ended meanwhile
            continue
    return found


def command_line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def alive(pid: int | None) -> bool:
    """Whether a process runs; a zombie does not."""
    if pid is None:
        return False
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def send(pid: int | None, number: int) -> None:
    if pid is not None:
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            return
