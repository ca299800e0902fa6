"""The rows that a page draws: which records, and how they become JSON. Knows no page and no clock."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.system.scoring.session import Records

ROWS_PER_S = 250.0
"""Of one side; ticks that sent an update come on top."""
COLUMNS = {
    "position": 7,
    "raw": 7,
    "decoded": 5,
    "output": 7,
    "bound": 7,
    "tank": 7,
    "surface": 7,
    "surface_size": 7,
    "surface_stiffness": 2,
    "lateness_us": 1,
    "work_us": 1,
    "codec_us": 1,
    "rtt_us": 1,
    "one_way_us": 1,
    "ticks_missed": None,
    "slew_ticks": None,
    "datagrams_sent": None,
    "datagrams_received": None,
    "datagrams_lost": None,
    "bytes_sent": None,
    "updates_sent": None,
    "repeats": None,
    "state": None,
    "fault": None,
    "control": None,
    "selected": None,
    "sent": None,
    "received": None,
    "clipped": None,
    "ramping": None,
    "model": None,
    "settings": None,
    "buttons": None,
    "position_selected": None,
}
"""By name, the decimal places that are worth sending; None for integers."""
ROTATION = {"rotation_raw": 6, "rotation_output": 6, "rotation_bound": 7, "rotation_sent": None}
"""The same of what a session of six degrees of freedom has besides."""


class Thinning:
    """Chooses every Nth record of a side, and all that sent an update or changed state or fault.

    Args:
        rate_hz: of the records [Hz].
    """

    def __init__(self, rate_hz: float) -> None:
        self._every = max(1, int(np.ceil(rate_hz / ROWS_PER_S)))
        self._passed = 0
        self._before: tuple[int, int] | None = None

    def choose(self, records: Records) -> Records:
        """The rows to show of the next records."""
        count = len(records)
        if not count:
            return records
        keep = (np.arange(self._passed, self._passed + count) % self._every == 0) | (records["sent"] > 0)
        keep |= records["rotation_sent"] > 0
        for place, name in enumerate(("state", "fault")):
            values = records[name].astype(np.int64)
            before = values[0] if self._before is None else self._before[place]
            keep |= np.diff(values, prepend=before) != 0
        self._before = (int(records["state"][-1]), int(records["fault"][-1]))
        self._passed += count
        chosen: Records = records[keep]
        return chosen


def message(side: str, rows: Records, origin: float, *, rotation: bool = False) -> dict[str, Any]:
    """Rows of one side as the page takes them.

    Args:
        side: of the rows.
        rows: to show.
        origin: the beginning of the session on their clock [s].
        rotation: whether the session has six degrees of freedom.
    """
    columns = COLUMNS | ROTATION if rotation else COLUMNS
    return {
        "type": "samples",
        "side": side,
        "t": listed(rows["at"] - origin, 6),
        "columns": {name: _column(rows[name], digits) for name, digits in columns.items()},
    }


def _column(values: NDArray[Any], digits: int | None) -> list[Any]:
    if digits is None:
        numbers: list[Any] = values.tolist()
        return numbers
    if values.ndim == 1:
        return listed(values, digits)
    return [listed(axis, digits) for axis in values.T]


def listed(values: NDArray[Any], digits: int) -> list[float | None]:
    """Numbers as JSON has them: rounded, and None for what is not finite."""
    wide = np.asarray(values, dtype=np.float64)
    numbers: list[float | None] = np.round(wide, digits).tolist()
    finite = np.isfinite(wide)
    if not finite.all():
        for place in np.flatnonzero(~finite).tolist():
            numbers[place] = None
    return numbers
