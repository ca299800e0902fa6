"""The whole session at a glance: bins that double in width when they are full, so that memory stays bounded."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.system.configuration import MASTER, SIDES, SLAVE
from weberlink.system.scoring.arm import ArmLayout
from weberlink.system.scoring.session import Records
from weberlink.watching.rows import listed

MOST_BINS = 600
FIRST_STEP_S = 0.1
"""Width of a bin at the beginning [s]."""

Bins = NDArray[np.float64]
Indices = NDArray[np.intp]


class _Column(NamedTuple):
    """How the bins of a column are filled and merged, and their value without a record."""

    add: np.ufunc
    empty: float


_MAXIMUM, _SUM = _Column(np.fmax, np.nan), _Column(np.add, 0.0)
COLUMNS = {
    "force_master": _MAXIMUM,
    "force_slave": _MAXIMUM,
    "felt_max": _MAXIMUM,
    "packets": _SUM,
    "missed": _SUM,
    "rtt_master": _SUM,
    "rtt_slave": _SUM,
    "heard_master": _SUM,
    "heard_slave": _SUM,
    "records": _SUM,
}


class History:
    """Largest force and felt error, packets, mean round trip and missed ticks of each stretch of a session.

    Force and round trip are those of the master: what the operator felt. Of a slave alone they are those of the robot.
    Packets are the updates of both sides.

    Args:
        rate_hz: tick rate [Hz].
        origin: start of the session on the clock of the records [s]; what was before counts for the first bin.
        arm: the axes of a session in joint space, whose force is the torque of one of them; None for another session.
    """

    def __init__(self, rate_hz: float, origin: float, arm: ArmLayout | None = None) -> None:
        self._arm = arm
        self.step_s = FIRST_STEP_S
        """Width of a bin [s]."""
        self._period = 1.0 / rate_hz
        self._origin = origin
        self._bins = {name: np.full(MOST_BINS, column.empty) for name, column in COLUMNS.items()}
        self._used = 0
        self._until = 0.0
        self._counters: dict[str, dict[str, int]] = {side: {} for side in SIDES}

    def add(self, side: str, records: Records) -> None:
        """Take the next records of a side."""
        if not len(records):
            return
        at = self._places(records["at"])
        self._until = max(self._until, float(records["at"][-1]) - self._origin + self._period)
        self._put(f"force_{side}", at, self._force(side, records))
        self._put("records", at, np.ones(len(records)))
        self._put("packets", at, self._increments(side, records, "updates_sent", "sent"))
        if self._arm is not None:
            self._put("packets", at, self._increments(side, records, "gripper_updates_sent", "gripper_sent"))
        self._put("missed", at, self._increments(side, records, "ticks_missed", None))
        rtt = np.asarray(records["rtt_us"], dtype=np.float64)
        known = np.isfinite(rtt)
        self._put(f"rtt_{side}", at[known], rtt[known])
        self._put(f"heard_{side}", at[known], np.ones(int(known.sum())))

    def add_felt(self, at: NDArray[np.float64], deadbands: NDArray[np.float64]) -> None:
        """Take felt errors [deadbands] at times on the clock of the records [s]; NaN counts for nothing."""
        if len(at):
            self._put("felt_max", self._places(at), deadbands)

    def message(self, session: str) -> dict[str, Any]:
        """The history for the page; a column is null where nothing is known."""
        used, bins = self._used, {name: column[: self._used] for name, column in self._bins.items()}
        starts = np.arange(used) * self.step_s
        lengths = np.clip(self._until - starts, self._period, self.step_s)
        is_seen = bins["records"] > 0
        of = MASTER if np.isfinite(bins["force_master"]).any() else SLAVE
        with np.errstate(invalid="ignore", divide="ignore"):
            rtt_ms = 1e-3 * bins[f"rtt_{of}"] / bins[f"heard_{of}"]
        return {
            "type": "history",
            "session": session,
            "step_s": self.step_s,
            "columns": {
                "t": listed(starts, 6),
                "force_max": listed(bins[f"force_{of}"], 6),
                "felt_max": listed(bins["felt_max"], 4),
                "packets": listed(np.where(is_seen, bins["packets"] / lengths, np.nan), 3),
                "rtt_ms": listed(rtt_ms, 4),
                "missed": [int(count) for count in bins["missed"]],
            },
        }

    def _force(self, side: str, records: Records) -> NDArray[np.float64]:
        """The force at each tick [N]; of an arm, the largest torque of an axis [N m]."""
        field = "output" if side == MASTER else "raw"
        if self._arm is None:
            return np.asarray(np.linalg.norm(np.asarray(records[field], dtype=np.float64), axis=1))
        return np.asarray(np.abs(records[f"joint_{field}"][:, self._arm.places]).max(axis=1), dtype=np.float64)

    def _places(self, at: NDArray[np.float64]) -> Indices:
        """Bins of moments, after as many doublings as it takes."""
        since = np.maximum(at - self._origin, 0.0)
        while since[-1] >= MOST_BINS * self.step_s:
            self._double()
        places = np.minimum((since / self.step_s).astype(np.intp), MOST_BINS - 1)
        self._used = max(self._used, int(places[-1]) + 1)
        return places

    def _double(self) -> None:
        for name, column in COLUMNS.items():
            merged = np.full(MOST_BINS, column.empty)
            merged[: MOST_BINS // 2] = column.add.reduce(self._bins[name].reshape(-1, 2), axis=1)
            self._bins[name] = merged
        self._used = (self._used + 1) // 2
        self.step_s *= 2.0

    def _put(self, name: str, places: Indices, values: NDArray[Any]) -> None:
        COLUMNS[name].add.at(self._bins[name], places, values)

    def _increments(self, side: str, records: Records, name: str, first: str | None) -> NDArray[np.int64]:
        """What each record adds to a counter; the first one adds its own flag, as what was before was not seen."""
        counter = records[name].astype(np.int64)
        before = self._counters[side].get(name)
        if before is None:
            before = int(counter[0]) - (0 if first is None else int(records[first][0]))
        self._counters[side][name] = int(counter[-1])
        return np.maximum(np.diff(counter, prepend=before), 0)
