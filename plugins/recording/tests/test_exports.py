"""`record export`: one contract for every format, and the layouts of ROS and of LeRobot (v3.0)."""

import csv
import json
from collections import defaultdict
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from plugins.recording.tests import arm_sessions as arms
from plugins.recording.tests.records import of_arms
from tests.program import weberlink
from tests.session.systems import CONFIGS
from weberlink.telemetry.record import TURNS
from weberlink_figures.session import Layout
from weberlink_figures.watching.ros import quaternions
from weberlink_recording.lerobot_frames import NoFramesError, frames_of
from weberlink_recording.reader import read_recording
from weberlink_recording.ros_export import RATE_HZ
from weberlink_recording.session import RecordedSession
from weberlink_recording.writer import RecordingWriter

parquet = pytest.importorskip("pyarrow.parquet")

TICKS = 3000
FRAME = 34  # ticks of a window: the longest time between two frames at 30 Hz

STRIDE = round(1000.0 / RATE_HZ)
Messages = dict[str, list[tuple[int, Any]]]
Sides = dict[str, Any]


def export(path: Path, to: str, *further: object) -> str:
    ended = weberlink("record", "export", path, "--to", to, *further)
    assert (ended.status, ended.errors) == (0, ""), ended
    return ended.output


@cache
def decoded(path: Path) -> Messages:
    """The messages as ROS tools read them, by topic."""
    found: Messages = defaultdict(list)
    with path.open("rb") as file:
        for _, channel, message, content in make_reader(
            file, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            found[channel.topic].append((message.log_time, content))
    return found


def column(dataset: Path, key: str) -> Any:
    (path,) = sorted((dataset / "data").rglob("*.parquet"))
    return np.array(parquet.read_table(path, columns=[key])[key].to_pylist())


@pytest.fixture(scope="module")
def sides() -> Sides:
    """Of two arms."""
    return {side: arms.records(side, TICKS) for side in ("master", "slave")}


@pytest.fixture(scope="module")
def grasp(sides: Sides, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return of_arms(tmp_path_factory.mktemp("arms") / "session.mcap", sides)


@pytest.fixture(scope="module")
def turn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of six degrees of freedom, in virtual time; some values are not known."""
    made = tmp_path_factory.mktemp("turn")
    assert weberlink("simulate", CONFIGS / "rotation.yaml", "--duration", 2, "--record", made / "s.mcap").status == 0
    whole = read_recording(made / "s.mcap")
    whole.records["slave"]["rtt_us"][[0, 7]] = np.nan
    with RecordingWriter.create(made / "session.mcap", whole.facts) as writer:
        for side, records in whole.records.items():
            writer.add_side(whole.origins[side])
            writer.write(side, records)
    return made / "session.mcap"


# --- the contract

Table = dict[str, Any]


AXES = {"turn": (*"xyz", *TURNS), "grasp": (*arms.NAMES, "gripper")}


def flat(records: Any, session: str) -> Table:
    """A column of numbers for each axis of each field."""
    columns = {}
    for name in records.dtype.names:
        values = records[name].astype(float)
        axes = [""] if values.ndim == 1 else [f"_{axis}" for axis in ("xyz" if values.shape[1] == 3 else AXES[session])]
        columns |= {f"{name}{axis}": each for axis, each in zip(axes, values.reshape(len(values), -1).T, strict=False)}
    return columns


def read_csv(folder: Path, side: str, _: str) -> Table:
    with (folder / f"session-{side}.csv").open(newline="", encoding="utf-8") as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, np.array(rows, float).T, strict=True))


def read_parquet(folder: Path, side: str, _: str) -> Table:
    table = parquet.read_table(folder / f"session-{side}.parquet")
    return {name: table[name].to_numpy().astype(float) for name in table.column_names}


def read_ros(folder: Path, side: str, session: str) -> Table:
    ticks = [tick for _, tick in decoded(folder / "session-ros.mcap")[f"/weberlink/{side}"]]
    names = ticks[0].__slots__
    columns: Table = {}
    for name in names:
        values = np.array([vector(getattr(tick, name)) for tick in ticks], float).T
        axes = ("xyz" if len(values) == 3 else AXES[session]) if len(values) > 1 else [""]
        columns |= {f"{name}_{axis}" if axis else name: each for axis, each in zip(axes, values, strict=False)}
    return columns


def vector(message: Any, names: str = "xyz") -> list[float]:
    if hasattr(message, "x"):
        return [getattr(message, name) for name in names]
    return list(message) if hasattr(message, "__len__") else [message]


READERS: dict[str, Callable[[Path, str, str], Table]] = {"csv": read_csv, "parquet": read_parquet, "ros": read_ros}
WRITTEN = {"csv": "session-slave.csv", "parquet": "session-slave.parquet", "ros": "session-ros.mcap"}
WRITTEN |= {"lerobot": "session-lerobot"}


@pytest.mark.parametrize(("to", "session"), [("csv", "turn"), ("parquet", "grasp"), ("ros", "turn"), ("ros", "grasp")])
def test_every_value_is_read_back_by_the_formats_own_reader(
    to: str, session: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    path = request.getfixturevalue(session)
    export(path, to, "--out", tmp_path)
    for side, records in read_recording(path).records.items():
        found, expected = READERS[to](tmp_path, side, session), flat(records, session)
        assert set(expected) <= set(found)
        for name, values in expected.items():
            np.testing.assert_array_equal(found[name].astype(np.float32), values.astype(np.float32), name)


@pytest.mark.parametrize("to", WRITTEN)
def test_an_export_writes_all_or_nothing_and_over_nothing(
    to: str, grasp: Path, tmp_path: Path, small_disk: Path
) -> None:
    full = weberlink("record", "export", grasp, "--to", to, "--out", small_disk)
    assert "No space left" in full.complaint(1)
    assert list(small_disk.iterdir()) == []
    out = tmp_path / "out"
    (out / WRITTEN[to]).mkdir(parents=True)
    refused = weberlink("record", "export", grasp, "--to", to, "--out", out)
    assert WRITTEN[to] in refused.complaint()
    assert [each.name for each in out.rglob("*")] == [WRITTEN[to]]


@pytest.mark.parametrize(
    ("to", "sides_kept", "ticks", "status", "written"),
    [
        ("csv", ["master"], TICKS, 0, ["session-master.csv"]),
        ("lerobot", ["master"], TICKS, 2, []),
        ("csv", ["master", "slave"], 0, 2, []),
        ("lerobot", ["master", "slave"], FRAME - 1, 2, []),
    ],
)
def test_a_side_or_records_that_are_not_there(
    to: str, sides_kept: list[str], ticks: int, status: int, written: list[str], sides: Sides, tmp_path: Path
) -> None:
    path = of_arms(tmp_path / "session.mcap", {side: sides[side][:ticks] for side in sides_kept})
    ended = weberlink("record", "export", path, "--to", to)
    assert (ended.status, ended.errors.count("\n")) == (status, int(status != 0)), ended
    assert [each.name for each in tmp_path.iterdir() if each != path] == written


# --- ROS


@pytest.fixture(scope="module")
def messages(turn: Path) -> Messages:
    export(turn, "ros")
    return decoded(turn.with_name("session-ros.mcap"))


def test_poses_and_forces_are_those_of_the_ticks(turn: Path, messages: Messages) -> None:
    records = read_recording(turn).records
    for pose, wrench, side, place, force in (
        ("hand", "felt", "master", "position", "output"),
        ("robot", "measured", "slave", "output", "raw"),
    ):
        few = records[side][::STRIDE]
        poses = [message.pose for _, message in messages[f"/weberlink/{pose}"]]
        np.testing.assert_array_equal([vector(each.position) for each in poses], few[place][:, :3])
        turns = [vector(each.orientation, "xyzw") for each in poses]
        np.testing.assert_allclose(turns, quaternions(few[place][:, 3:6]), atol=1e-12)
        wrenches = [message.wrench for _, message in messages[f"/weberlink/{wrench}"]]
        np.testing.assert_array_equal([vector(each.force) for each in wrenches], few[force][:, :3])
        np.testing.assert_allclose([vector(each.torque) for each in wrenches], few[force][:, 3:6], rtol=1e-6)
        assert {message.header.frame_id for _, message in messages[f"/weberlink/{wrench}"]} == {wrench}


def test_arms_have_joint_states(grasp: Path, sides: Sides, tmp_path: Path) -> None:
    export(grasp, "ros", "--out", tmp_path)
    found = decoded(tmp_path / "session-ros.mcap")
    assert set(found) == {f"/weberlink/{name}" for name in ("master", "slave", "leader", "follower")}
    for topic, side, torque in (("leader", "master", "output"), ("follower", "slave", "raw")):
        states = [message for _, message in found[f"/weberlink/{topic}"]]
        few = sides[side][::STRIDE]
        assert all(list(state.name) == [*arms.NAMES, "gripper"] and not len(state.velocity) for state in states)
        np.testing.assert_array_equal([list(state.position) for state in states], few["position"][:, : arms.AXES])
        np.testing.assert_array_equal([list(state.effort) for state in states], few[torque][:, : arms.AXES])


# --- LeRobot


@pytest.fixture(scope="module")
def dataset(grasp: Path) -> Path:
    export(grasp, "lerobot", "--task", "grasp the cube")
    return grasp.with_name("session-lerobot")


def scaled(angles: Any) -> Any:
    """Joints in degrees, the gripper from 0 to 100 of its range."""
    values = np.degrees(angles.astype(np.float64))
    low, high = arms.GRIPPER_RAD
    values[..., -1] = 100.0 * (angles[..., -1] - low) / (high - low)
    return values.astype(np.float32)


def test_frames_are_regular_and_their_values_those_of_the_ticks(dataset: Path, sides: Sides) -> None:
    ticks = np.rint(column(dataset, "session.time") * arms.RATE).astype(int)
    assert len(ticks) == int((TICKS - FRAME) / arms.RATE * 30) + 1
    np.testing.assert_allclose(column(dataset, "timestamp"), np.arange(len(ticks)) / 30, atol=1e-6)
    np.testing.assert_allclose(np.diff(column(dataset, "session.time")), 1 / 30, atol=1e-9)
    for key, side, name, scale in (
        ("observation.state", "slave", "position", scaled),
        ("action", "master", "raw", scaled),
        ("observation.force_window", "slave", "raw", np.asarray),
        ("observation.motion_window", "slave", "position", scaled),
        ("leader.force_window", "master", "output", np.asarray),
        ("leader.motion_window", "master", "raw", scaled),
    ):
        count = FRAME if key.endswith("window") else 1
        shown = column(dataset, key).reshape(len(ticks), count, arms.AXES)
        expected = np.array([scale(sides[side][name][tick - count + 1 : tick + 1, : arms.AXES]) for tick in ticks])
        np.testing.assert_allclose(shown, expected, rtol=1e-6, atol=1e-6, err_msg=key)
    assert np.diff(ticks).max() <= FRAME, "windows leave no tick out"


def test_layout_is_that_of_lerobot(dataset: Path) -> None:
    info, stats = (
        json.loads((dataset / f"meta/{name}.json").read_text(encoding="utf-8")) for name in ("info", "stats")
    )
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", 30, "so101_follower")
    assert info["features"]["action"]["names"] == [f"{name}.pos" for name in (*arms.NAMES, "gripper")]
    (table,) = (parquet.read_table(path) for path in (dataset / "data").rglob("*.parquet"))
    assert set(table.column_names) == set(info["features"]) == set(stats)
    for key, feature in info["features"].items():
        (width,) = feature["shape"]
        assert len(feature["names"] or [None]) == len(stats[key]["mean"]) == len(stats[key]["q99"]) == width
        assert stats[key]["count"] == [table.num_rows]
        kind = table.schema.field(key).type
        plain = {"float32": "float", "float64": "double"}.get(feature["dtype"], feature["dtype"])
        assert str(kind) == plain or (kind.list_size, str(kind.value_type)) == (width, "float")
    (episode,) = parquet.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert episode["tasks"] == ["grasp the cube"]
    assert (episode["dataset_from_index"], episode["dataset_to_index"]) == (0, info["total_frames"])
    tasks = parquet.read_table(dataset / "meta/tasks.parquet")
    assert tasks.to_pydict() == {"task_index": [0], "__index_level_0__": ["grasp the cube"]}


def session(sides: Sides, **other: Any) -> RecordedSession:
    both = sides | other
    return RecordedSession(both["master"], both["slave"], Layout.of(arms.SYSTEM, arms.RATE, ("zoh",), None))


def test_episodes_end_where_nobody_leads(sides: Sides) -> None:
    master, slave = sides["master"].copy(), sides["slave"].copy()
    master["ramping"][1000:1300] = 2
    slave["state"][2000:2200] = 5
    frames = frames_of(session(sides, master=master, slave=slave), 30)
    ticks = np.rint(frames.times * arms.RATE).astype(int)
    assert not np.isin(ticks, [*range(1000, 1300), *range(2000, 2200)]).any()
    assert ticks[np.cumsum((0, *frames.lengths[:-1]))].tolist() == [each + FRAME - 1 for each in (0, 1300, 2200)]
    master["ramping"] = 1
    with pytest.raises(NoFramesError):
        frames_of(session(sides, master=master), 30)


def test_missing_ticks_hold_and_long_gaps_end(sides: Sides) -> None:
    kept = np.ones(TICKS, bool)
    kept[500:505] = kept[1500:1700] = False
    frames = frames_of(session(sides, slave=sides["slave"][kept]), 50)
    assert (len(frames.lengths), frames.held) == (2, 5)
    frame = int(np.searchsorted(frames.times, 0.505))
    tick = round(frames.times[frame] * arms.RATE)
    (window,) = (each.values for each in frames.features if each.key == "observation.force_window")
    first = window.reshape(-1, 20, arms.AXES)[frame, :, 0]
    held = [each if kept[each] else 499 for each in range(tick - 19, tick + 1)]
    np.testing.assert_allclose(first, sides["slave"]["raw"][held, 0], rtol=1e-6)
