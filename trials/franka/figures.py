"""Figures of a session with the simulated robot: its pace, and its force at the hand against the simulator's."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from trials.franka.robot import Rows, SimulatedRobot

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
