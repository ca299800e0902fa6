"""Records to write and read again, and the mapping of a file for tests that damage one."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from plugins.recording.tests import arm_sessions
from weberlink.telemetry.reader import DTYPE
from weberlink_figures.message import ENCAPSULATION, SCHEMA_NAME, SCHEMA_TEXT, TOPICS
from weberlink_recording.container import metadata_of
from weberlink_recording.writer import Origin, RecordingWriter

SIDES = ("master", "slave")
FACTS = {"bank": "zoh plane", "configuration": "rate_hz: 1000\n# ü\n"}
WALL_S, MONOTONIC_S = 1_763_700_000.123456, 5000.25


def origin(side: str) -> Origin:
    return Origin(side, 1000.0, WALL_S, MONOTONIC_S)


def noise(count: int, seed: int, first: int = 0) -> NDArray[np.void]:
    """Records of random bytes, so that floats may be NaN with any payload; ticks and times rise."""
    rng = np.random.default_rng(seed)
    records = np.frombuffer(rng.bytes(count * DTYPE.itemsize), DTYPE).copy()
    records["tick"] = np.arange(first, first + count)
    records["at"] = MONOTONIC_S + records["tick"] / 1000.0
    return records


def small_file(path, pieces: int = 4, each: int = 5) -> dict[str, NDArray[np.void]]:
    """A finished recording of a few chunks; returns its records."""
    written = {side: noise(pieces * each, seed) for seed, side in enumerate(SIDES)}
    with RecordingWriter.create(path, FACTS) as writer:
        for side in SIDES:
            writer.add_side(origin(side))
        for piece in range(pieces):
            for side in SIDES:
                writer.write(side, written[side][piece * each : (piece + 1) * each])
            writer.flush()
    return written


def same(records: NDArray[np.void], expected: NDArray[np.void]) -> bool:
    return records.tobytes() == expected.tobytes()


def frames_of(data: bytes) -> list:
    """The frames of a finished file, as the library reads them, its chunks as such."""
    return list(StreamReader(io.BytesIO(data), emit_chunks=True).records)


def of_arms(path: Path, sides: dict[str, NDArray[np.void]]) -> Path:
    """A recording of a session of two arms, whose records come in pieces from both sides in turn."""
    with RecordingWriter.create(path, arm_sessions.FACTS) as writer:
        for side in sides:
            writer.add_side(Origin(side, arm_sessions.RATE, 1e9 + 10.0, 10.0))
        for first in range(0, max(map(len, sides.values())), 500):
            for side, records in sides.items():
                writer.write(side, records[first : first + 500])
            writer.flush()
    return path


def write_elsewhere(
    path: Path,
    sides: dict[str, NDArray[np.void]],
    *,
    text: str = SCHEMA_TEXT,
    changes: dict[str, Any] | None = None,
    compression: CompressionType = CompressionType.NONE,
    chunked: bool = True,
    facts: dict[str, str] | None = None,
    origins: dict[str, Origin] | None = None,
) -> None:
    """A recording as another program would write it, message by message, between messages of its own."""
    changes = {"encoding": "ros2msg", "message": "cdr", "metadata": None, "head": ENCAPSULATION} | (changes or {})
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, chunk_size=4000, use_chunking=chunked)
        writer.start("ros2", "another")
        strange = writer.register_channel(
            "/tf", "cdr", writer.register_schema("tf2_msgs/msg/TFMessage", "ros2msg", b"x")
        )
        schema = writer.register_schema(SCHEMA_NAME, changes["encoding"], text.encode())
        channels = {}
        for side in sides:
            metadata = (
                metadata_of((origins or {}).get(side) or origin(side))
                if changes["metadata"] is None
                else changes["metadata"]
            )
            channels[side] = writer.register_channel(TOPICS[side], changes["message"], schema, metadata)
        for index in range(max(map(len, sides.values()))):
            writer.add_message(strange, index, b"\0" * (index % 40), index)
            for side, records in sides.items():
                if index < len(records):
                    data = changes["head"] + records[index].tobytes()
                    writer.add_message(channels[side], index, data, index, index)
        if facts is not None:
            writer.add_metadata("weberlink", facts)
            writer.add_metadata("end", {"outcome": "complete"})
        writer.finish()
