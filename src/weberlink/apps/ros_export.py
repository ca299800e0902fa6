"""`export --to ros`: a recording as an MCAP file for Foxglove, RViz and other ROS tools.

Beside every tick it has, at `RATE_HZ`, poses of hand and robot, felt and measured forces, and the frames of all four;
of a session of arms, the states of the joints of leader and follower.
They are made here and not while recording: the recorder stays cheap, its files lean, and old recordings gain them too.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Metadata
from numpy.typing import NDArray

from weberlink.system.scoring.arm import ArmLayout
from weberlink.system.scoring.recorded import RecordedSession
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.recording.container import FRAME, McapFile, rows_of
from weberlink.telemetry.recording.message import (
    COMPLETE,
    ENCAPSULATION,
    END,
    FACTS,
    MESSAGE_ENCODING,
    SCHEMA_ENCODING,
    SCHEMA_NAME,
    SCHEMA_TEXT,
    Origin,
    Rows,
)
from weberlink.telemetry.recording.ros import SCHEMAS, Motion, joint_state, pose_stamped, transforms, wrench_stamped

RATE_HZ = 100.0
"""Of poses, forces and frames; ticks are not thinned out."""
CHUNK_ROWS = 4096
POSE, WRENCH, FRAMES, STATE = SCHEMAS
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
    clock, shown = next(iter(origins.values())), dict[str, int]()
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
            for topic, schema, bodies in _shown(side, records[some], times[some], session.arm):
                if topic not in shown:
                    shown[topic] = file.add_channel(topic, MESSAGE_ENCODING, numbers[schema], NO_PROFILE)
                _add(file, shown[topic], times[some], bodies)
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


def _shown(side: str, few: Rows, at: Times, arm: ArmLayout | None) -> Iterator[tuple[str, str, Rows]]:
    """Topic, schema and bodies of what a side shows."""
    if arm is not None:
        body, torques = ("leader", few["joint_output"]) if side == "master" else ("follower", few["joint_raw"])
        angles = few["joint_position"]
        yield f"/weberlink/{body}", STATE, joint_state(at, arm.axes, angles[:, arm.places], torques[:, arm.places])
        return
    zero = np.zeros((len(few), 3))
    if side == "master":
        body, force_name, place, turn = "hand", "felt", few["position"], few["rotation_raw"]
        force, torque = few["output"], few["rotation_output"]
    else:
        body, force_name, place, turn = "robot", "measured", few["output"], few["rotation_output"]
        force, torque = few["raw"], few["rotation_raw"]
    motion = Motion(at, place, np.asarray(turn, np.float64))
    yield f"/weberlink/{body}", POSE, pose_stamped(motion)
    yield f"/weberlink/{force_name}", WRENCH, wrench_stamped(at, force_name, force, np.asarray(torque, np.float64))
    # A force is in the fixed frame's axes, so it has a frame of its own that does not turn.
    yield "/tf", FRAMES, transforms({body: motion, force_name: Motion(at, place, zero)})


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
