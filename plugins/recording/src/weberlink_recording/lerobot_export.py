"""`record export --to lerobot`: a session as a LeRobotDataset of format v3.0, which lerobot 0.4 and later open.

The layout follows `lerobot/datasets` of release 0.4.4: meta/info.json, meta/stats.json, meta/tasks.parquet, a table of
the episodes, and one of the frames. Recordings hold no pictures, so there are no videos.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from weberlink_recording.lerobot_frames import Frames

VERSION = "v3.0"
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES = Path("meta/episodes/chunk-000/file-000.parquet")
FILES_PER_CHUNK, DATA_FILE_MB, VIDEO_FILE_MB = 1000, 100, 200
"""Limits that recordings which are appended to the dataset follow: the defaults of LeRobot."""
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
FILE_BYTES = DATA_FILE_MB * 10**6
"""A data file takes episodes until it has so many bytes; an episode is never split."""

Table = dict[str, NDArray[Any]]
Stats = dict[str, dict[str, list[float]]]


def write_dataset(frames: Frames, task: str, robot: str | None, folder: Path) -> str:
    """Write a dataset; returns in words what is in it.

    Args:
        frames: of all episodes.
        task: what was done, in words; the same for every episode.
        robot: kind of the follower; None if it is not known.
        folder: that is not there yet.

    Raises:
        OSError: it cannot be written.
    """
    table = _table(frames)
    for path in (folder / EPISODES, folder / "meta/info.json"):
        path.parent.mkdir(parents=True, exist_ok=True)
    files = list(_files(frames, table))
    begin = 0
    for number, episodes in enumerate(files):
        end = begin + sum(frames.lengths[episode] for episode in episodes)
        path = folder / DATA.format(chunk_index=0, file_index=number)
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(_arrow({key: values[begin:end] for key, values in table.items()}), path)
        begin = end
    pq.write_table(_episodes(frames, table, task, files), folder / EPISODES)
    pq.write_table(_tasks(task), folder / "meta/tasks.parquet")
    _write_json(folder / "meta/stats.json", {key: _stats(values) for key, values in table.items()})
    _write_json(folder / "meta/info.json", _info(frames, table, robot))
    return _told(frames)


def _table(frames: Frames) -> Table:
    """The columns of the frames, each of shape (frames, width)."""
    count = len(frames.times)
    in_episode = np.concatenate([np.arange(length) for length in frames.lengths])
    episode = np.repeat(np.arange(len(frames.lengths)), frames.lengths)
    return {feature.key: feature.values for feature in frames.features} | {
        "session.time": frames.times[:, None],
        "timestamp": (in_episode / frames.fps).astype(np.float32)[:, None],
        "frame_index": in_episode[:, None],
        "episode_index": episode[:, None],
        "index": np.arange(count)[:, None],
        "task_index": np.zeros((count, 1), np.int64),
    }


def _files(frames: Frames, table: Table) -> Iterator[list[int]]:
    """The episodes of each data file."""
    frame_bytes = sum(values.itemsize * values.shape[1] for values in table.values())
    own: list[int] = []
    size = 0
    for episode, length in enumerate(frames.lengths):
        if own and size + length * frame_bytes > FILE_BYTES:
            yield own
            own, size = [], 0
        own.append(episode)
        size += length * frame_bytes
    yield own


def _arrow(table: Table) -> pa.Table:
    """One value as a number, several as a list of fixed length, as LeRobot declares them to Hugging Face datasets."""
    columns = {}
    for key, values in table.items():
        flat = pa.array(np.ascontiguousarray(values).ravel())
        width = values.shape[1]
        columns[key] = flat if width == 1 else pa.FixedSizeListArray.from_arrays(flat, width)
    return pa.table(columns)


def _stats(values: NDArray[Any]) -> dict[str, list[float]]:
    """Statistics of each column, by which policies scale their input."""
    quantiles = np.quantile(values, list(QUANTILES.values()), axis=0)
    return {
        "min": values.min(axis=0).tolist(),
        "max": values.max(axis=0).tolist(),
        "mean": values.mean(axis=0, dtype=np.float64).tolist(),
        "std": values.std(axis=0, dtype=np.float64).tolist(),
        "count": [len(values)],
        **{name: quantile.tolist() for name, quantile in zip(QUANTILES, quantiles, strict=True)},
    }


def _episodes(frames: Frames, table: Table, task: str, files: list[list[int]]) -> pa.Table:
    file_of = {episode: number for number, episodes in enumerate(files) for episode in episodes}
    rows = []
    begin = 0
    for episode, length in enumerate(frames.lengths):
        stats: Stats = {key: _stats(values[begin : begin + length]) for key, values in table.items()}
        rows.append(
            {
                "episode_index": episode,
                "tasks": [task],
                "length": length,
                "data/chunk_index": 0,
                "data/file_index": file_of[episode],
                "dataset_from_index": begin,
                "dataset_to_index": begin + length,
                **{f"stats/{key}/{name}": value for key, of in stats.items() for name, value in of.items()},
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
            }
        )
        begin += length
    return pa.Table.from_pylist(rows)


def _tasks(task: str) -> pa.Table:
    """The table of the tasks; LeRobot reads it with pandas, and the task is the index of a row."""
    index = "__index_level_0__"
    kinds = {"task_index": "int64", index: "unicode"}
    described = [
        {
            "name": None if name == index else name,
            "field_name": name,
            "pandas_type": kind,
            "numpy_type": "object" if name == index else kind,
            "metadata": None,
        }
        for name, kind in kinds.items()
    ]
    metadata = {"index_columns": [index], "column_indexes": [], "columns": described, "pandas_version": "2.0.0"}
    table = pa.table({"task_index": [0], index: [task]})
    return table.replace_schema_metadata({"pandas": json.dumps(metadata)})


def _info(frames: Frames, table: Table, robot: str | None) -> dict[str, Any]:
    names = {feature.key: list(feature.names) for feature in frames.features}
    features = {
        key: {"dtype": str(values.dtype), "shape": [values.shape[1]], "names": names.get(key)}
        for key, values in table.items()
    }
    return {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": len(frames.lengths),
        "total_frames": len(frames.times),
        "total_tasks": 1,
        "chunks_size": FILES_PER_CHUNK,
        "data_files_size_in_mb": DATA_FILE_MB,
        "video_files_size_in_mb": VIDEO_FILE_MB,
        "fps": frames.fps,
        "splits": {"train": f"0:{len(frames.lengths)}"},
        "data_path": DATA,
        "video_path": None,
        "features": features,
    }


def _write_json(path: Path, document: dict[str, Any]) -> None:
    path.write_text(json.dumps(document, indent=4), encoding="utf-8")


def _told(frames: Frames) -> str:
    episodes = f"{len(frames.lengths)} episode{'s' if len(frames.lengths) > 1 else ''}"
    led = f"{len(frames.times)} frames at {frames.fps} Hz, of the {frames.lead_s:.1f} s of {frames.span_s:.1f} s"
    names = [name for feature in frames.features for name in feature.names]
    gripper = (
        "; the gripper is in radians, since the recording does not tell its range" if "gripper.rad" in names else ""
    )
    held = f"; {frames.held} missing ticks repeat the tick before" if frames.held else ""
    return f"{episodes}, {led} in which the leader led{held}{gripper}; no pictures, since recordings hold none"
