"""`record export --to ros`: a recording as an MCAP file for Foxglove, RViz and other ROS tools.

Beside every tick it has the topics of `weberlink_figures.watching.ros` at `RATE_HZ`.
They are made here and not while recording: the recorder stays cheap, its files lean, and old recordings gain them too.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from mcap.records import Metadata
from numpy.typing import NDArray

from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.recorders import COMPLETE
from weberlink_figures.message import SCHEMA_NAME, SCHEMA_TEXT, Origin, Rows
from weberlink_figures.watching.ros import SCHEMAS, shown
from weberlink_recording.container import END, FACTS, QOS, McapFile, framed, metadata_of
from weberlink_recording.session import RecordedSession

RATE_HZ = 100.0  # of poses, forces and frames; ticks are not thinned out
CHUNK_ROWS = 4096


def write_ros(session: RecordedSession, origins: Mapping[str, Origin], facts: Mapping[str, str], path: Path) -> int:
    """Write a file that is not there yet; returns the number of messages. The clock of the first origin is that of the
    session.
    """
    clock, channels = next(iter(origins.values())), dict[str, int]()
    file = McapFile.create(path, Metadata(FACTS, dict(facts)))
    try:
        numbers = {name: file.add_schema(name, text) for name, text in ((SCHEMA_NAME, SCHEMA_TEXT), *SCHEMAS.items())}
        some = slice(None, None, max(1, round(session.layout.rate_hz / RATE_HZ)))
        for side, records in session.sides.items():
            times = clock.log_times_ns(records["at"])
            origin = Origin(side, session.layout.rate_hz, clock.wall_s, clock.monotonic_s)
            channel = file.add_channel(origin.topic, numbers[SCHEMA_NAME], metadata_of(origin))
            own = np.empty(len(records), DTYPE)  # the fields of this release; those of another may have more
            for name in DTYPE.names or ():
                own[name] = records[name]
            _add(file, channel, times, own)
            for topic, schema, bodies in shown(side, records[some], times[some], session.layout.joints):
                if topic not in channels:
                    channels[topic] = file.add_channel(topic, numbers[schema], QOS)
                _add(file, channels[topic], times[some], bodies)
        file.finish(Metadata(END, {"outcome": COMPLETE}))
    finally:
        file.close()
    return file.messages.total()


def _add(file: McapFile, channel: int, times_ns: NDArray[np.uint64], bodies: Rows) -> None:
    """Messages of one channel in chunks; a chunk has messages of one size."""
    rows = framed(channel, file.messages[channel], times_ns, bodies)
    for first in range(0, len(rows), CHUNK_ROWS):
        file.add_chunk(rows[first : first + CHUNK_ROWS])
