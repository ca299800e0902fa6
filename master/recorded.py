"""A recording as a trace: what one side of a session did and felt while it was engaged.

Owns the choice of what of a recording stands for position and force. Needs the library that reads MCAP (extra:
recording), so that it is imported on use.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from weberlink.master.trace import FEWEST_ROWS, Array, TraceError
from weberlink.protocol.states import State
from weberlink.telemetry.recording.reader import RecordingError, read_recording

Side = Literal["master", "slave"]

SIGNALS = {"slave": ("output", "raw"), "master": ("raw", "output")}
"""Position and force of each side: commanded and measured of the robot, measured and displayed of the device."""


def table_of(path: Path, sides: Sequence[Side]) -> Array:
    """Time [s] from the first engaged tick, position [m] and force [N], shape (n, 7), of the first side that is there.

    Raises:
        TraceError: it is no recording, lacks the side, or holds no session.
    """
    try:
        recording = read_recording(path)
    except RecordingError as error:
        raise TraceError(str(error)) from None
    side = next((side for side in sides if len(recording.records.get(side, ()))), None)
    if side is None:
        held = ", ".join(recording.records) or "neither"
        raise TraceError(f"{path}: expected the {sides[0]}'s side of a session, found {held}")
    records = recording.records[side]
    lacks = {*SIGNALS[side], "at", "state"} - set(records.dtype.names or ())
    if lacks:
        raise TraceError(f"{path}: the {side}'s records lack {', '.join(sorted(lacks))}")
    position, force = SIGNALS[side]
    engaged = records[records["state"] == State.ENGAGED.value]
    finite = np.isfinite(engaged[position]).all(axis=1) & np.isfinite(engaged[force]).all(axis=1)
    engaged = engaged[finite]
    if len(engaged) < FEWEST_ROWS:
        raise TraceError(f"{path}: expected at least {FEWEST_ROWS} ticks of an engaged session, found {len(engaged)}")
    if not (np.diff(engaged["at"]) > 0.0).all():
        raise TraceError(f"{path}: the time of the {side}'s ticks does not rise; the recording is damaged")
    return np.column_stack((engaged["at"] - engaged["at"][0], engaged[position], engaged[force]))
