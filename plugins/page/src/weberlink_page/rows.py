"""Selects the records to draw, and lists them for JSON."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.config import SLAVE
from weberlink.telemetry.reader import Records
from weberlink_figures.session import Layout
from weberlink_figures.watching.rows import listed

ROWS_PER_S = 250.0  # rows per second of a side, besides the ticks that sent an update
_INTEGERS = ("ticks_missed", "datagrams_sent", "updates_sent", "state", "fault", "sent", "ramping", "model", "settings")
COLUMNS: dict[str, int | None] = (
    dict.fromkeys(("position", "raw", "output", "bound", "energy", "surface", "surface_size"), 7)
    | {"surface_stiffness": 2}
    | dict.fromkeys(("lateness_us", "work_us", "rtt_us", "one_way_us", "jitter_us"), 1)
    | dict.fromkeys(_INTEGERS)
)
"""Columns of a row, with their decimal places; None for integers."""
SECOND_STREAM: dict[str, int | None] = {"second_updates_sent": None, "second_sent": None, "second_bound": 7}
"""Further columns of a session with a second stream: a rotation, or a gripper."""
CARTESIAN = ("bound", "second_bound", "surface", "surface_size", "surface_stiffness", "model")
"""Those that a session in joint space lacks."""


class Thinning:
    """Selects every Nth record of a side, and all that sent an update or changed state or fault."""

    def __init__(self, rate_hz: float) -> None:
        self._every = max(1, int(np.ceil(rate_hz / ROWS_PER_S)))
        self._passed = 0
        self._before: tuple[int, int] | None = None

    def choose(self, records: Records) -> Records:
        """The rows to show."""
        count = len(records)
        if not count:
            return records
        keep = (np.arange(self._passed, self._passed + count) % self._every == 0) | (records["sent"] > 0)
        keep |= records["second_sent"] > 0
        for place, name in enumerate(("state", "fault")):
            values = records[name].astype(np.int64)
            before = values[0] if self._before is None else self._before[place]
            keep |= np.diff(values, prepend=before) != 0
        self._before = (int(records["state"][-1]), int(records["fault"][-1]))
        self._passed += count
        chosen: Records = records[keep]
        return chosen


def samples_message(side: str, rows: Records, origin: float, layout: Layout) -> dict[str, Any]:
    """Message with rows of one side; `origin` is the start of the session on the clock of the rows [s]."""
    columns = COLUMNS if len(layout.from_slave) == 1 else COLUMNS | SECOND_STREAM
    if layout.joints:
        columns = {name: digits for name, digits in columns.items() if name not in CARTESIAN}
    values = {name: rows[name] for name in columns}
    values |= {name: values[name][:, : len(layout.axes)] for name in ("position", "raw", "output")}
    if layout.joints and side == SLAVE:
        columns, values = columns | {"bound": 7}, values | {"bound": layout.deadbands(rows)}

    def column(values: NDArray[Any], digits: int | None) -> list[Any]:
        if digits is None:
            numbers: list[Any] = values.tolist()
            return numbers
        return listed(values, digits) if values.ndim == 1 else [listed(axis, digits) for axis in values.T]

    return {
        "type": "samples",
        "side": side,
        "t": listed(rows["at"] - origin, 6),
        "columns": {name: column(values[name], digits) for name, digits in columns.items()},
    }
