"""The simulated robot as a process, and what it knows: one row per step of physics in a mapped file.

The judged driver sees the robot's interface only; the judge also reads this.
"""

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from random import Random
from time import monotonic, sleep
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

READY = "Server ready for new client connection"
READY_S, STOP_S = 60.0, 10.0
ROWS = 200_000  # steps that the file holds, in a ring: 200 s at 1 kHz
ROW = np.dtype(
    [
        ("at", "f8"),  # CLOCK_MONOTONIC [s]
        ("step", "i8"),  # counts from 1; 0: the row was never written
        ("q", "f8", 7),
        ("dq", "f8", 7),
        ("torque", "f8", 7),  # applied to the joints, gravity compensation not included [N m]
        ("tip", "f8", 3),  # of the flange in the base frame [m]
        ("force", "f8", 3),  # of the table on the arm, base frame [N]
        ("moving", "i8"),  # 1 while a client controls the arm
        ("reflex", "i8"),  # 1 while an error is latched
        ("success", "f8"),  # control_command_success_rate of the last 100 cycles
        ("lost", "i8"),  # consecutive cycles without a command
    ]
)
LONGEST_LAG_S = 0.1
AT_REST = 0.005  # joint speed below which the simulator itself calls the arm settled [rad/s]
Rows = NDArray[Any]


class TruthWriter:
    """Of the simulator, by its thread of physics."""

    def __init__(self, path: Path) -> None:
        self._rows = np.memmap(path, ROW, "w+", shape=(ROWS,))
        self._step = 0

    def next_row(self) -> Any:
        """The row to fill; `close_row` publishes it."""
        return self._rows[self._step % ROWS]

    def close_row(self, row: Any) -> None:
        self._step += 1
        row["step"] = self._step


class SimulatedRobot:
    """franka-sim in a process of its own, which answers; ended by `close`.

    Raises:
        RuntimeError: it ended or did not become ready; the message has the end of its log.
    """

    def __init__(self, folder: Path, host: str, lenient: bool = False) -> None:
        self.host, self._rows, log = host, folder / "truth.rows", folder / "simulator.log"
        command = [sys.executable, "-m", "trials.franka.simulator", "--host", host, "--truth", str(self._rows)]
        with log.open("wb") as out:
            self._process = subprocess.Popen(
                [*command, "--parent", str(os.getpid()), *["--lenient"] * lenient],
                **{"stdin": subprocess.DEVNULL, "stdout": out, "stderr": out, "start_new_session": True},
            )
        deadline = monotonic() + READY_S
        # franka-sim's own check takes states from 127.0.0.1 only.
        while READY not in (said := log.read_text(encoding="utf-8")):
            if self._process.poll() is not None or monotonic() > deadline:
                self.close()
                raise RuntimeError(f"franka-sim did not become ready:\n{said[-2000:]}")
            sleep(0.1)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def signal(self, number: int) -> None:
        with suppress(ProcessLookupError):
            os.kill(self._process.pid, number)

    def close(self) -> None:
        if self._process.poll() is None:
            self.signal(signal.SIGCONT)
            self.signal(signal.SIGINT)
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def since(self, began: float) -> Rows:
        """All rows from `began` (monotonic) on, in the order of time; the file holds the last steps only."""
        rows = np.array(np.memmap(self._rows, ROW, "r"))
        rows = rows[(rows["step"] > 0) & (rows["at"] >= began)]
        return rows[np.argsort(rows["step"])]

    def latest(self) -> Any:
        rows = np.memmap(self._rows, ROW, "r")
        return np.array(rows[int(np.argmax(rows["step"]))])[()]

    def seconds_to_rest(self, since: float, within: float, hold: float) -> float | None:
        """Time from `since` until no joint is faster than `AT_REST` for `hold` seconds; None if not in time."""
        while True:
            is_over = monotonic() > since + within + hold
            rows = self.since(since)
            moving = rows["at"][np.abs(rows["dq"]).max(axis=1) > AT_REST]
            last = moving[-1] if len(moving) else since
            if len(rows) and last <= since + within and rows["at"][-1] - last > hold:
                return float(last - since)
            if is_over:
                return None
            sleep(0.05)


def own_address() -> str:
    """A loopback address of this process: libfranka has one port, and others may simulate a robot here too."""
    random = Random(os.getpid())
    return f"127.{random.randrange(1, 255)}.{random.randrange(256)}.{random.randrange(1, 255)}"


def likeness(rows: Rows, at: NDArray[np.float64], force: NDArray[np.float64]) -> float:
    """Correlation of a force that was recorded at these times with that of the simulator, at the best of all lags.

    It is negative for the wrong sign.
    """
    times = np.arange(rows["at"][0] + LONGEST_LAG_S, min(rows["at"][-1], at[-1]), 1e-3)

    def newest(times: Any, at: Any, values: Any) -> Any:
        return values[np.clip(np.searchsorted(at, times, side="right") - 1, 0, len(at) - 1)].ravel()

    ours = newest(times, at, force)
    true = (newest(times - lag, rows["at"], rows["force"]) for lag in np.arange(0.0, LONGEST_LAG_S, 1e-3))
    return max(float(each @ ours / np.sqrt(max((each @ each) * (ours @ ours), 1e-12))) for each in true)
