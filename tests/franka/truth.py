"""What the simulator knows: one row per step of physics in a file that another process maps.

The judged driver sees the robot's interface only; the judge also reads this.
"""

from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep

import numpy as np
from numpy.typing import NDArray

ROWS = 200_000
"""Steps that the file holds, in a ring: 200 s at 1 kHz."""
JOINTS = 7
ROW = np.dtype(
    [
        ("at", "f8"),  # CLOCK_MONOTONIC [s]
        ("step", "i8"),  # counts from 1; 0: the row was never written
        ("q", "f8", JOINTS),
        ("dq", "f8", JOINTS),
        ("torque", "f8", JOINTS),  # applied to the joints, gravity compensation not included [N m]
        ("tip", "f8", 3),  # of the flange in the base frame [m]
        ("force", "f8", 3),  # of the table on the arm, base frame [N]
        ("moving", "i8"),  # 1 while a client controls the arm
        ("reflex", "i8"),  # 1 while an error is latched
        ("success", "f8"),  # control_command_success_rate of the last 100 cycles
        ("lost", "i8"),  # consecutive cycles without a command
    ]
)
AT_REST = 0.005
"""Joint speed below which the simulator itself calls the arm settled [rad/s]."""

Rows = NDArray[np.void]


class TruthWriter:
    """Of the simulator: rows by its thread of physics, arrivals by its thread of the network."""

    def __init__(self, path: Path, length: int = ROWS) -> None:
        self._rows = np.memmap(path, ROW, "w+", shape=(length,))
        self._arrivals = np.memmap(arrivals_beside(path), np.float64, "w+", shape=(length,))
        self._length, self._step, self._arrived = length, 0, 0

    def next_row(self) -> np.void:
        """The row to fill; `close_row` publishes it."""
        return self._rows[self._step % self._length]

    def close_row(self, row: np.void) -> None:
        self._step += 1
        row["step"] = self._step

    def arrived(self, at: float) -> None:
        """A command arrived."""
        self._arrivals[self._arrived % self._length] = at
        self._arrived += 1


def arrivals_beside(path: Path) -> Path:
    """The times at which commands arrived, of the same length."""
    return path.with_suffix(".arrivals")


@dataclass(frozen=True)
class Truth:
    """A reader of the file."""

    path: Path

    def since(self, began: float) -> Rows:
        """All rows from `began` (monotonic) on, in the order of time; the file holds the last steps only."""
        rows = np.array(np.memmap(self.path, ROW, "r"))
        rows = rows[(rows["step"] > 0) & (rows["at"] >= began)]
        return rows[np.argsort(rows["step"])]

    def arrivals(self, began: float, ended: float) -> NDArray[np.float64]:
        """When commands arrived in this span (monotonic) [s]."""
        times = np.array(np.memmap(arrivals_beside(self.path), np.float64, "r"))
        return np.sort(times[(times >= began) & (times <= ended)])

    def latest(self) -> np.void:
        rows = np.memmap(self.path, ROW, "r")
        return np.array(rows[int(np.argmax(rows["step"]))])[()]

    def seconds_to_rest(self, since: float, within: float, hold: float) -> float | None:
        """Time from `since` until no joint is faster than `AT_REST` for `hold` seconds; None if not in time."""
        while True:
            ended = monotonic() > since + within + hold
            rows = self.since(since)
            moving = rows["at"][np.abs(rows["dq"]).max(axis=1) > AT_REST]
            last = moving[-1] if len(moving) else since
            if len(rows) and last <= since + within and rows["at"][-1] - last > hold:
                return float(last - since)
            if ended:
                return None
            sleep(0.05)
