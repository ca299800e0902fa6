"""`record export --to lerobot`: a session as a LeRobotDataset of format v3.0, which lerobot 0.4 and later open.

The layout follows `lerobot/datasets` of release 0.4.4: meta/info.json, meta/stats.json, meta/tasks.parquet, a table of
the episodes, and one of the frames. The JPEG pictures of each camera become the frames of one video (MJPEG in MP4):
nothing is encoded again, and every frame is a key frame, so that training reads any of them without its neighbours.
"""

import json
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from weberlink_recording.lerobot_frames import Frames, Video

VERSION = "v3.0"
DATA, EPISODES = "data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"
VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
SAMPLES = 20  # pictures of which the statistics are taken
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
Table = dict[str, NDArray[Any]]


def write_dataset(frames: Frames, task: str, robot: str | None, folder: Path) -> str:
    """Write a dataset; returns in words what is in it.

    Args:
        task: what was done, in words; the same for every episode.
        robot: kind of the follower; None if it is not known.
        folder: that is not there yet.

    Raises:
        OSError: it cannot be written.
        ValueError: the pictures of a camera differ in size.
    """
    table = _table(frames)
    for path in (DATA, EPISODES):
        (folder / path).parent.mkdir(parents=True)
    pq.write_table(_arrow(table), folder / DATA)
    videos = {video.camera: _write_video(video, frames.fps, folder) for video in frames.videos}
    pq.write_table(_episodes(frames, table, task), folder / EPISODES)
    pq.write_table(_tasks(task), folder / "meta/tasks.parquet")
    stats: dict[str, Any] = {key: _stats(values) for key, values in table.items()}
    for key, (_, pixels) in videos.items():  # of each colour, from 0 to 1, in shape (3, 1, 1)
        of = _stats(pixels.reshape(-1, 3) / 255.0)
        stats[key] = {name: [[[value]] for value in values] for name, values in of.items()} | {"count": [len(pixels)]}
    info = _info(frames, table, robot)
    info["features"] |= {key: feature for key, (feature, _) in videos.items()}
    for name, document in (("stats", stats), ("info", info)):
        (folder / f"meta/{name}.json").write_text(json.dumps(document, indent=4), encoding="utf-8")
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


def _episodes(frames: Frames, table: Table, task: str) -> pa.Table:
    rows, begin = [], 0
    for episode, length in enumerate(frames.lengths):
        stats = {key: _stats(values[begin : begin + length]) for key, values in table.items()}
        rows.append(
            {"episode_index": episode, "tasks": [task], "length": length, "data/chunk_index": 0, "data/file_index": 0}
            | {"dataset_from_index": begin, "dataset_to_index": begin + length}
            | {f"videos/{video.camera}/{name}": 0 for video in frames.videos for name in ("chunk_index", "file_index")}
            | {f"videos/{video.camera}/from_timestamp": begin / frames.fps for video in frames.videos}
            | {f"videos/{video.camera}/to_timestamp": (begin + length) / frames.fps for video in frames.videos}
            | {f"stats/{key}/{name}": value for key, of in stats.items() for name, value in of.items()}
            | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        )
        begin += length
    return pa.Table.from_pylist(rows)


def _tasks(task: str) -> pa.Table:
    """The table of the tasks; LeRobot reads it with pandas, and the task is the index of a row."""
    index = "__index_level_0__"
    columns = [
        {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, field, kind, numpy in (
            ("task_index", "task_index", "int64", "int64"),
            (None, index, "unicode", "object"),
        )
    ]
    metadata = {"index_columns": [index], "column_indexes": [], "columns": columns, "pandas_version": "2.0.0"}
    return pa.table({"task_index": [0], index: [task]}).replace_schema_metadata({"pandas": json.dumps(metadata)})


def _info(frames: Frames, table: Table, robot: str | None) -> dict[str, Any]:
    names = {feature.key: list(feature.names) for feature in frames.features}
    features = {
        key: {"dtype": str(values.dtype), "shape": [values.shape[1]], "names": names.get(key)}
        for key, values in table.items()
    }
    return {
        **{"codebase_version": VERSION, "robot_type": robot, "fps": frames.fps, "features": features},
        **{"total_episodes": len(frames.lengths), "total_frames": len(frames.times), "total_tasks": 1},
        # The defaults of LeRobot, for what is appended.
        **{"chunks_size": 1000, "data_files_size_in_mb": 100, "video_files_size_in_mb": 200},
        "video_path": VIDEO if frames.videos else None,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "splits": {"train": f"0:{len(frames.lengths)}"},
    }


def _write_video(video: Video, fps: int, folder: Path) -> tuple[dict[str, Any], NDArray[np.uint8]]:
    """Write the video; returns its feature, and some of its pictures, shape (n, height, width, 3)."""
    import av  # noqa: PLC0415 - an optional library

    places = np.unique(np.linspace(0, len(video.jpegs) - 1, SAMPLES).astype(int))
    pixels = [_decoded(av, video.jpegs[place]) for place in places]
    height, width, _ = pixels[0].shape
    if any(each.shape != pixels[0].shape for each in pixels):
        raise ValueError(f"{video.camera}: its pictures differ in size")
    path = folder / VIDEO.format(video_key=video.camera, chunk_index=0, file_index=0)
    path.parent.mkdir(parents=True)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=fps)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuvj420p"
        for place, jpeg in enumerate(video.jpegs):
            packet = av.Packet(jpeg)
            packet.stream, packet.time_base = stream, Fraction(1, fps)
            packet.pts = packet.dts = place
            packet.duration, packet.is_keyframe = 1, True
            container.mux(packet)
    told = {"height": height, "width": width, "codec": "mjpeg", "pix_fmt": "yuvj420p", "fps": fps, "channels": 3}
    info = {f"video.{name}": value for name, value in told.items()} | {"video.is_depth_map": False, "has_audio": False}
    names = ["height", "width", "channels"]
    return {"dtype": "video", "shape": [height, width, 3], "names": names, "info": info}, np.stack(pixels)


def _decoded(av: Any, jpeg: bytes) -> NDArray[np.uint8]:
    """The pixels of a JPEG, shape (height, width, 3)."""
    with av.open(BytesIO(jpeg), format="mjpeg") as container:
        pixels: NDArray[np.uint8] = next(container.decode(video=0)).to_ndarray(format="rgb24")
        return pixels


def _told(frames: Frames) -> str:
    names = [name for feature in frames.features for name in feature.names]
    parts = [
        f"{len(frames.lengths)} episode{'s' if len(frames.lengths) > 1 else ''}, {len(frames.times)} frames at "
        f"{frames.fps} Hz, of the {frames.lead_s:.1f} s of {frames.span_s:.1f} s in which the leader led",
        *([f"{frames.held} missing ticks repeat the tick before"] if frames.held else []),
        *(["the gripper is in radians, since the recording does not tell its range"] if "gripper.rad" in names else []),
        *(f"pictures of {video.camera.rpartition('.')[2]}" for video in frames.videos),
        *([] if frames.videos else ["no pictures, since the recording holds none"]),
    ]
    return "; ".join(parts)
