"""`record export --to lerobot`: a dataset has the values of the recording and LeRobot's layout v3.0."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.apps.arm_sessions import FACTS, GRIPPER_RAD, NAMES, PLACES, RATE, SYSTEM, recording, records
from tests.system.systems import CONFIGS
from weberlink.apps.lerobot_frames import NoFramesError, frames_of, samples_per_frame
from weberlink.cli import app
from weberlink.system.composition.following import build_follower
from weberlink.system.configuration import load
from weberlink.system.recorder import facts, facts_of
from weberlink.system.scoring.arm import arm_in
from weberlink.system.scoring.recorded import RecordedSession
from weberlink.telemetry.recording.message import RANGE
from weberlink.telemetry.recording.reader import read_recording

pytest.importorskip("pyarrow")

from pyarrow import parquet

TICKS = 3000
AXES = (*NAMES, "gripper")
ARM = arm_in(SYSTEM)
FRAME = 34
"""Ticks of a window: the longest time between two frames at 30 Hz."""


def export(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["record", "export", *map(str, arguments), "--to", "lerobot"])
    return result.exit_code, result.stdout, result.stderr


def one_line(errors: str, *parts: str) -> None:
    assert errors.count("\n") == 1 and errors.startswith("weberlink: ")
    for part in parts:
        assert part in errors


@pytest.fixture(scope="module")
def sides() -> dict[str, Any]:
    return {"master": records("master", TICKS), "slave": records("slave", TICKS)}


@pytest.fixture(scope="module")
def dataset(sides: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = recording(tmp_path_factory.mktemp("lerobot") / "grasp.mcap", sides)
    status, output, errors = export(path, "--task", "grasp the cube")
    assert (status, errors) == (0, "") and "1 episode" in output
    return path.with_name("grasp-lerobot")


def scaled(angles: np.ndarray) -> np.ndarray:
    """Joints in degrees, the gripper from 0 to 100 of its range."""
    values = np.degrees(angles.astype(np.float64))
    low, high = GRIPPER_RAD
    values[..., -1] = 100.0 * (angles[..., -1] - low) / (high - low)
    return values.astype(np.float32)


def column(dataset: Path, key: str) -> np.ndarray:
    (path,) = sorted((dataset / "data").rglob("*.parquet"))
    return np.array(parquet.read_table(path, columns=[key])[key].to_pylist())


def test_values_are_those_of_the_recording(dataset: Path, sides: dict[str, Any]) -> None:
    ticks = np.rint(column(dataset, "session.time") * RATE).astype(int)
    assert len(ticks) == int((TICKS - FRAME) / RATE * 30) + 1
    place = list(PLACES)
    for key, side, name in (
        ("observation.state", "slave", "joint_position"),
        ("action", "master", "joint_raw"),
    ):
        expected = scaled(sides[side][name][ticks][:, place])
        np.testing.assert_allclose(column(dataset, key), expected, rtol=1e-6, atol=1e-6, err_msg=key)
    for key, side, name in (
        ("observation.force_window", "slave", "joint_raw"),
        ("observation.motion_window", "slave", "joint_position"),
        ("leader.force_window", "master", "joint_output"),
        ("leader.motion_window", "master", "joint_raw"),
    ):
        windows = column(dataset, key).reshape(len(ticks), FRAME, len(place))
        expected = np.array([sides[side][name][tick - FRAME + 1 : tick + 1][:, place] for tick in ticks])
        if key.endswith("force_window"):
            np.testing.assert_array_equal(windows, expected, key)
        else:
            np.testing.assert_allclose(windows, scaled(expected), rtol=1e-6, atol=1e-6, err_msg=key)


def test_windows_leave_no_tick_out(dataset: Path, sides: dict[str, Any]) -> None:
    shoulder = column(dataset, "leader.motion_window").reshape(-1, FRAME, len(PLACES))[:, :, 0]
    last = np.rint(column(dataset, "session.time")[-1] * RATE).astype(int)
    every = np.degrees(sides["master"]["joint_raw"][: last + 1, 0].astype(np.float64)).astype(np.float32)
    assert set(every.tolist()) == set(shoulder.ravel().tolist())


def test_layout_is_that_of_lerobot(dataset: Path) -> None:
    info = json.loads((dataset / "meta/info.json").read_text(encoding="utf-8"))
    stats = json.loads((dataset / "meta/stats.json").read_text(encoding="utf-8"))
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", 30, "so101_follower")
    assert info["features"]["action"]["names"] == [f"{name}.pos" for name in AXES]
    (table,) = (parquet.read_table(path) for path in (dataset / "data").rglob("*.parquet"))
    assert set(table.column_names) == set(info["features"]) == set(stats)
    for key, feature in info["features"].items():
        (width,) = feature["shape"]
        assert len(feature["names"] or [None]) == width
        assert len(stats[key]["mean"]) == len(stats[key]["q99"]) == width
        assert stats[key]["count"] == [table.num_rows]
        kind = table.schema.field(key).type
        assert str(kind) == {"float32": "float", "float64": "double"}.get(feature["dtype"], feature["dtype"]) or (
            kind.list_size == width and str(kind.value_type) == "float"
        )
    (episode,) = parquet.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert episode["tasks"] == ["grasp the cube"]
    assert (episode["dataset_from_index"], episode["dataset_to_index"]) == (0, info["total_frames"])
    assert episode["stats/action/mean"] == stats["action"]["mean"]
    tasks = parquet.read_table(dataset / "meta/tasks.parquet")
    assert tasks.to_pydict() == {"task_index": [0], "__index_level_0__": ["grasp the cube"]}
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["__index_level_0__"]


def test_frame_times_are_regular(dataset: Path) -> None:
    times = column(dataset, "timestamp")
    np.testing.assert_allclose(times, np.arange(len(times)) / 30, atol=1e-6)
    np.testing.assert_allclose(np.diff(column(dataset, "session.time")), 1 / 30, atol=1e-9)


@pytest.mark.parametrize(("fps", "samples"), [(30, 34), (50, 20), (60, 17), (1000, 1)])
def test_window_covers_the_longest_frame(fps: int, samples: int) -> None:
    assert samples_per_frame(1000.0, fps) == samples


def test_episodes_end_where_nobody_leads(sides: dict[str, Any]) -> None:
    master, slave = sides["master"].copy(), sides["slave"].copy()
    master["ramping"][1000:1300] = 2
    slave["state"][2000:2200] = 5
    session = RecordedSession(master, slave, RATE, ("zoh",), arm=ARM)
    frames = frames_of(session, 30)
    assert len(frames.lengths) == 3
    ticks = np.rint(frames.times * RATE).astype(int)
    assert not np.isin(ticks, [*range(1000, 1300), *range(2000, 2200)]).any()
    begins = ticks[np.cumsum((0, *frames.lengths[:-1]))]
    assert begins.tolist() == [FRAME - 1, 1300 + FRAME - 1, 2200 + FRAME - 1]


def test_missing_ticks_hold_and_long_gaps_end(sides: dict[str, Any]) -> None:
    kept = np.ones(TICKS, bool)
    kept[500:505] = kept[1500:1700] = False
    session = RecordedSession(sides["master"], sides["slave"][kept], RATE, ("zoh",), arm=ARM)
    frames = frames_of(session, 50)
    assert (len(frames.lengths), frames.held) == (2, 5)
    (window,) = (each.values for each in frames.features if each.key == "observation.force_window")
    frame = int(np.searchsorted(frames.times, 0.505))
    tick = round(frames.times[frame] * RATE)
    first = window.reshape(-1, 20, len(PLACES))[frame, :, 0]
    held = [each if kept[each] else 499 for each in range(tick - 19, tick + 1)]
    np.testing.assert_array_equal(first, sides["slave"]["joint_raw"][held, 0])


def test_slave_on_another_clock_is_aligned(sides: dict[str, Any]) -> None:
    moved = sides["slave"].copy()
    moved["at"] += 0.0003  # within half a tick: its ticks stay those of the master's
    frames = frames_of(RecordedSession(sides["master"], moved, RATE, ("zoh",), arm=ARM), 30)
    (state,) = (each.values for each in frames.features if each.key == "observation.state")
    ticks = np.rint(frames.times * RATE).astype(int)
    joints = list(PLACES[:-1])
    apart = np.abs(np.radians(state[:, :-1]) - sides["slave"]["joint_position"][ticks][:, joints])
    assert apart.max() <= 0.5 * 0.002 + 1e-6


def test_files_of_two_hosts_give_the_same_frames(dataset: Path, sides: dict[str, Any], tmp_path: Path) -> None:
    elsewhere = sides["slave"].copy()
    elsewhere["at"] += 5000.0  # another host's clock; `peer_at` relates it to the master's
    paths = [
        recording(tmp_path / "operator.mcap", {"master": sides["master"]}),
        recording(tmp_path / "robot.mcap", {"slave": elsewhere}),
    ]
    status, _, errors = export(*paths)
    assert (status, errors) == (0, "")
    for key in ("observation.state", "action", "observation.force_window", "leader.force_window"):
        np.testing.assert_array_equal(column(tmp_path / "operator-lerobot", key), column(dataset, key), key)


def test_gripper_of_unknown_range_is_no_position(sides: dict[str, Any], tmp_path: Path) -> None:
    facts = {name: text for name, text in FACTS.items() if name not in RANGE}
    path = recording(tmp_path / "old.mcap", sides, facts)
    status, output, _ = export(path)
    assert status == 0 and "the gripper is in radians" in output
    info = json.loads((tmp_path / "old-lerobot/meta/info.json").read_text(encoding="utf-8"))
    assert info["features"]["action"]["names"] == [*(f"{name}.pos" for name in NAMES), "gripper.rad"]
    ticks = np.rint(column(tmp_path / "old-lerobot", "session.time") * RATE).astype(int)
    gripper = column(tmp_path / "old-lerobot", "action")[:, -1]
    np.testing.assert_array_equal(gripper, sides["master"]["joint_raw"][ticks][:, -1])


def test_recorded_session_tells_the_range_of_its_gripper(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    configuration = load(CONFIGS / "arms.yaml")
    lower, upper = (facts(configuration)[name].split() for name in RANGE)
    spec = build_follower(configuration).spec
    assert [*map(float, lower)] == [*spec.lower] and [*map(float, upper)] == [*spec.upper]
    told = {"system": configuration.system.model_dump(mode="json"), "bank": [], "lower_rad": [0.5], "upper_rad": [1.5]}
    assert [facts_of(told)[name] for name in RANGE] == ["0.5", "1.5"]
    alone = load(CONFIGS / "arms.yaml", sides=["master"])
    assert not set(RANGE) & set(facts(alone))


def test_value_that_is_no_number_is_refused(sides: dict[str, Any]) -> None:
    odd = sides["slave"].copy()
    odd["joint_raw"][700, 2] = np.nan
    with pytest.raises(NoFramesError, match="force_window"):
        frames_of(RecordedSession(sides["master"], odd, RATE, ("zoh",), arm=ARM), 30)


def test_cartesian_session_has_axes_of_space(tmp_path: Path) -> None:
    path = tmp_path / "turn.mcap"
    result = CliRunner().invoke(app, ["simulate", str(CONFIGS / "rotation.yaml"), "--duration", "1", "--record", path])
    assert result.exit_code == 0, result.stderr
    assert export(path, "--fps", 50)[0] == 0
    info = json.loads((tmp_path / "turn-lerobot/meta/info.json").read_text(encoding="utf-8"))
    state = info["features"]["observation.state"]["names"]
    window = info["features"]["observation.force_window"]["names"]
    assert window[:6] == [*(f"{axis}.force.0" for axis in "xyz"), *(f"rotation_{axis}.torque.0" for axis in "xyz")]
    assert state == [*(f"{axis}.pos" for axis in "xyz"), *(f"rotation_{axis}.pos" for axis in "xyz")]
    ticks = read_recording(path).records
    times = column(tmp_path / "turn-lerobot", "session.time")
    first = min(of["at"][0] for of in ticks.values())
    action = column(tmp_path / "turn-lerobot", "action")
    for time, values in zip(times, action, strict=True):
        at = int(np.argmin(np.abs(ticks["master"]["at"] - first - time)))
        expected = [*ticks["master"]["raw"][at], *ticks["master"]["rotation_raw"][at]]
        np.testing.assert_allclose(values, expected, rtol=1e-6, atol=1e-9)


class TestWhatCannotBeExported:
    def test_one_side_alone_is_refused(self, sides: dict[str, Any], tmp_path: Path) -> None:
        path = recording(tmp_path / "alone.mcap", {"master": sides["master"]})
        status, _, errors = export(path)
        assert status == 2
        one_line(errors, "alone.mcap", "give the slave's recording")
        assert not (tmp_path / "alone-lerobot").exists()

    def test_session_without_lead_is_refused(self, tmp_path: Path) -> None:
        both = {side: records(side, 300, lead_from=300) for side in ("master", "slave")}
        status, _, errors = export(recording(tmp_path / "still.mcap", both))
        assert status == 2
        one_line(errors, "still.mcap", "leader led")

    @pytest.mark.parametrize("fps", [0, 2000])
    def test_impossible_rate_is_refused(self, sides: dict[str, Any], tmp_path: Path, fps: int) -> None:
        status, _, errors = export(recording(tmp_path / "fast.mcap", sides), "--fps", fps)
        assert status == 2
        one_line(errors, "--fps")

    def test_cut_recording_gives_what_is_there(self, sides: dict[str, Any], tmp_path: Path) -> None:
        path = recording(tmp_path / "cut.mcap", sides)
        path.write_bytes(path.read_bytes()[: -(path.stat().st_size // 4)])
        status, output, errors = export(path)
        assert (status, errors) == (0, "")
        assert "cut off" in output
        assert len(column(tmp_path / "cut-lerobot", "action")) > 30

    def test_existing_dataset_is_left_alone(self, sides: dict[str, Any], tmp_path: Path) -> None:
        path = recording(tmp_path / "twice.mcap", sides)
        mine = tmp_path / "twice-lerobot"
        mine.mkdir()
        status, _, errors = export(path)
        assert status == 2
        one_line(errors, "twice-lerobot exists")
        assert not list(mine.iterdir())

    def test_full_disk_leaves_nothing(self, sides: dict[str, Any], tmp_path: Path, small_disk: Path) -> None:
        path = recording(tmp_path / "long.mcap", sides)
        status, _, errors = export(path, "--out", small_disk)
        assert status == 1 and "No space left" in errors and errors.count("\n") == 1
        assert list(small_disk.iterdir()) == []
