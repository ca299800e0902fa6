"""The trace of a simulated session: commanded position and measured force of the robot, as `master.trace` reads it."""

from pathlib import Path

import numpy as np

from weberlink.master.trace import COLUMNS, Trace, as_trace
from weberlink.protocol.states import State
from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import DTYPE


class TraceRecorder:
    """Collects the records of the slave while it is engaged."""

    def __init__(self) -> None:
        self._pieces: list[Records] = []

    def add(self, master: Records, slave: Records) -> None:  # noqa: ARG002 - the same call as that of a score
        """Take the next records of both sides."""
        self._pieces.append(slave[slave["state"] == State.ENGAGED.value])

    @property
    def trace(self) -> Trace:
        """The unrounded trace; needs at least one engaged tick."""
        records = np.concatenate(self._pieces)
        return as_trace(np.column_stack((records["at"] - records["at"][0], records["output"], records["raw"])))

    def save(self, path: Path) -> int:
        """Write the trace with all digits, so that the same numbers are read back; returns the number of rows.

        Raises:
            OSError: the file cannot be written.
        """
        records = np.concatenate([np.empty(0, DTYPE), *self._pieces])
        time = records["at"] - (records["at"][0] if len(records) else 0.0)
        rows = np.column_stack((time, records["output"], records["raw"])).tolist()
        lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in rows)]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return len(records)
