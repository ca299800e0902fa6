"""The simulated robot as a process, what it knows, and figures of that: one row per step of physics in a mapped file.

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
AT_REST = 0.005  # joint speed below which the simulator itself calls the arm settled [rad/s]
Rows = NDArray[Any]


class TruthWriter:
    """Of the simulator: rows by its thread of physics, times of arrival by its thread of the network."""

    def __init__(self, path: Path) -> None:
        self._rows = np.memmap(path, ROW, "w+", shape=(ROWS,))
        self._arrivals = np.memmap(path.with_suffix(".arrivals"), np.float64, "w+", shape=(ROWS,))
        self._step = self._arrived = 0

    def next_row(self) -> Any:
        """The row to fill; `close_row` publishes it."""
        return self._rows[self._step % ROWS]

    def close_row(self, row: Any) -> None:
        self._step += 1
        row["step"] = self._step

    def arrived(self) -> None:
        """A command arrives now."""
        self._arrivals[self._arrived % ROWS] = monotonic()
        self._arrived += 1


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

    def arrivals(self, began: float, ended: float) -> NDArray[np.float64]:
        """When commands arrived in this span (monotonic) [s]."""
        times = np.array(np.memmap(self._rows.with_suffix(".arrivals"), np.float64, "r"))
        return np.sort(times[(times >= began) & (times <= ended)])

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


TOUCHES_N = 0.5  # force in the simulator from which the arm counts as touching
LONGEST_LAG_S = 0.1
LAG_STEP_S = 0.001

Series = NDArray[np.float64]
Found = dict[str, Any]


def pace(robot: SimulatedRobot, began: float, ended: float) -> Found:
    """How regularly the robot was answered between two times (monotonic) [s], while a client controlled the arm.

    `success` is the mean of the robot's `control_command_success_rate`; `lost` are cycles without a command, and the
    robot stops at 20 `lost_in_a_row`. `period_ms` are p50, p99 and maximum between two commands as they arrive at the
    robot, `robot_ms` between two steps of the robot, which is late by itself on a busy machine.
    """
    rows = robot.since(began)
    rows = rows[(rows["at"] <= ended) & (rows["moving"] == 1)]
    if len(rows) < 2:
        raise ValueError("nobody controlled the arm")
    arrivals, lost = robot.arrivals(rows["at"][0], rows["at"][-1]), rows["lost"]
    return {
        "seconds": float(rows["at"][-1] - rows["at"][0]),
        "commands": len(arrivals),
        "success": float(rows["success"][rows["at"] > rows["at"][0] + 0.2].mean()),
        "lost": int((np.diff(lost, prepend=0) > 0).sum()),
        "lost_in_a_row": int(lost.max()),
        "period_ms": spread(1e3 * np.diff(arrivals)),
        "robot_ms": spread(1e3 * np.diff(rows["at"])),
    }


def spread(values: Series) -> list[float]:
    return [float(value) for value in np.percentile(values, [50, 99, 100])]


def likeness(rows: Rows, at: Series, force: Series) -> Found:
    """How a force that was recorded at these times follows that of the simulator.

    `correlation` at the lag at which both agree best is negative for the wrong sign; `gain` is of the regression on the
    force in the simulator, `error_n` the RMS difference while the arm touches.
    """
    times = np.arange(rows["at"][0] + LONGEST_LAG_S, min(rows["at"][-1], at[-1]), 1e-3)
    ours = _at(times, at, force)
    lags = np.arange(0.0, LONGEST_LAG_S, LAG_STEP_S)
    lag = max(lags, key=lambda lag: _correlation(_at(times - lag, rows["at"], rows["force"]), ours))
    true = _at(times - lag, rows["at"], rows["force"])
    touching = np.linalg.norm(true, axis=1) > TOUCHES_N
    if not touching.any():
        raise ValueError("the arm never touched the table")
    error = np.linalg.norm(true - ours, axis=1)[touching]
    return {
        "lag_ms": float(1e3 * lag),
        "correlation": _correlation(true, ours),
        "gain": float((true * ours).sum() / (true * true).sum()),
        "error_n": float(np.sqrt((error**2).mean())),
        "most_n": float(np.linalg.norm(ours, axis=1).max()),
    }


def contact(rows: Rows) -> Found:
    """How long, how often and how hard the arm touched the table."""
    size = np.linalg.norm(rows["force"], axis=1)
    touching = size > TOUCHES_N
    times = int((np.diff(touching.astype(int)) > 0).sum())
    seconds = float(np.diff(rows["at"])[touching[:-1]].sum())
    return {"seconds": seconds, "times": times, "most_n": float(size.max())}


def _at(times: Series, at: Series, values: Series) -> Series:
    """The newest value at each time, shape (n, 3)."""
    newest = np.clip(np.searchsorted(at, times, side="right") - 1, 0, len(at) - 1)
    return np.asarray(values[newest], dtype=np.float64)


def _correlation(a: Series, b: Series) -> float:
    scale = float(np.sqrt((a * a).sum() * (b * b).sum()))
    return float((a * b).sum()) / scale if scale > 0.0 else 0.0
