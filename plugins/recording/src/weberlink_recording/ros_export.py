"""`record export --to ros`: a recording as an MCAP file for Foxglove, RViz and other ROS tools.

Beside every tick it has the topics of `weberlink.watching.ros_topics` at `RATE_HZ`.
They are made here and not while recording: the recorder stays cheap, its files lean, and old recordings gain them too.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Metadata
from numpy.typing import NDArray

from weberlink.telemetry.message import (
    ENCAPSULATION,
    MESSAGE_ENCODING,
    SCHEMA_ENCODING,
    SCHEMA_NAME,
    SCHEMA_TEXT,
    Origin,
    Rows,
)
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.recorders import COMPLETE
from weberlink.watching.ros_messages import SCHEMAS
from weberlink.watching.ros_topics import shown
from weberlink_recording.container import END, FACTS, FRAME, McapFile, rows_of
from weberlink_recording.session import RecordedSession

RATE_HZ = 100.0
"""Of poses, forces and frames; ticks are not thinned out."""
CHUNK_ROWS = 4096
NO_PROFILE = {"offered_qos_profiles": ""}
"""Players of ROS 2 ask for this key; without a profile they use their default."""

Times = NDArray[np.uint64]


def write_ros(
    session: RecordedSession,
    origins: Mapping[str, Origin],
    facts: Mapping[str, str],
    path: Path,
) -> int:
    """Write the file; returns the number of messages.

    Args:
        session: both sides on one clock.
        origins: of the sides; the first one's clock is that of the session.
        facts: of the recording.
        path: of a file that is not there yet.

    Raises:
        OSError: it cannot be written.
    """
    clock, channels = next(iter(origins.values())), dict[str, int]()
    file = McapFile.create(path, Metadata(FACTS, dict(facts)))
    try:
        numbers = {SCHEMA_NAME: file.add_schema(SCHEMA_NAME, SCHEMA_ENCODING, SCHEMA_TEXT)}
        numbers |= {name: file.add_schema(name, SCHEMA_ENCODING, text) for name, text in SCHEMAS.items()}
        some = slice(None, None, max(1, round(session.rate_hz / RATE_HZ)))
        for side, records in session.sides.items():
            times = clock.log_times_ns(records["at"])
            origin = Origin(side, session.rate_hz, clock.wall_s, clock.monotonic_s)
            channel = file.add_channel(origin.topic, MESSAGE_ENCODING, numbers[SCHEMA_NAME], origin.to_metadata())
            _add(file, channel, times, _own_fields(records))
            for topic, schema, bodies in shown(side, records[some], times[some], session.arm):
                if topic not in channels:
                    channels[topic] = file.add_channel(topic, MESSAGE_ENCODING, numbers[schema], NO_PROFILE)
                _add(file, channels[topic], times[some], bodies)
        file.finish(Metadata(END, {"outcome": COMPLETE}))
    finally:
        file.close()
    return file.messages.total()


def _own_fields(records: Rows) -> Rows:
    """Records with the fields of this release; those of another may have more."""
    rows = np.empty(len(records), DTYPE)
    for name in DTYPE.names or ():
        rows[name] = records[name]
    return rows


def _add(file: McapFile, channel: int, times: Times, bodies: Rows) -> None:
    """Messages of one channel in chunks; a chunk has messages of one size."""
    layout = rows_of(bodies.dtype.itemsize)
    rows: Any = np.empty(len(bodies), layout)
    rows["opcode"], rows["length"] = Opcode.MESSAGE, layout.itemsize - FRAME.size
    rows["channel"], rows["sequence"] = channel, file.messages[channel] + np.arange(len(bodies))
    rows["log_time"] = rows["publish_time"] = times
    rows["encapsulation"] = np.void(ENCAPSULATION)
    rows["body"] = np.ascontiguousarray(bodies).view(layout["body"])
    for first in range(0, len(rows), CHUNK_ROWS):
        file.add_chunk(rows[first : first + CHUNK_ROWS])
