"""`record export --to ros`: what ROS tools read of a recording, layouts for them, the package of our message."""

import json
import re
from collections import defaultdict
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from typer.testing import CliRunner

from tests.apps import arm_sessions
from tests.system.systems import CONFIGS
from weberlink.apps.ros_export import RATE_HZ
from weberlink.cli import app
from weberlink.telemetry.recording.message import SCHEMA_NAME, SCHEMA_TEXT
from weberlink.telemetry.recording.reader import Recording, read_recording
from weberlink.telemetry.recording.ros import quaternions
from weberlink.telemetry.recording.ros_package import files

PACKAGE = CONFIGS.parent / "plugins" / "weberlink_msgs"
Messages = dict[str, list[tuple[int, Any]]]


def weberlink(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.stderr
    return result.stdout


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recording, Path]:
    """A session with rotation in virtual time, and its file for ROS tools."""
    path = tmp_path_factory.mktemp("ros") / "touch.mcap"
    weberlink("simulate", CONFIGS / "rotation.yaml", "--duration", 2, "--record", path)
    assert "touch-ros.mcap: " in weberlink("record", "export", path, "--to", "ros")
    return read_recording(path), path.with_name("touch-ros.mcap")


@pytest.fixture(scope="module")
def messages(exported: tuple[Recording, Path]) -> Messages:
    return decoded(exported[1])


def decoded(path: Path) -> Messages:
    found: Messages = defaultdict(list)
    with path.open("rb") as file:
        for _, channel, message, content in make_reader(
            file, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            found[channel.topic].append((message.log_time, content))
    return found


def vector(message: Any, names: str = "xyz") -> list[float]:
    return [getattr(message, name) for name in names]


def test_poses_and_forces_are_those_of_the_ticks(exported: tuple[Recording, Path], messages: Messages) -> None:
    records, stride = exported[0].records, round(1000.0 / RATE_HZ)
    master, slave = records["master"][::stride], records["slave"][::stride]
    for topic, side, place, turn in (
        ("/weberlink/hand", master, "position", "rotation_raw"),
        ("/weberlink/robot", slave, "output", "rotation_output"),
    ):
        poses = [message.pose for _, message in messages[topic]]
        np.testing.assert_array_equal([vector(pose.position) for pose in poses], side[place])
        turns = np.array([vector(pose.orientation, "xyzw") for pose in poses])
        np.testing.assert_allclose(turns, quaternions(side[turn].astype(float)), atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(turns, axis=1), 1.0)
    for topic, side, force, torque in (
        ("/weberlink/felt", master, "output", "rotation_output"),
        ("/weberlink/measured", slave, "raw", "rotation_raw"),
    ):
        wrenches = [message.wrench for _, message in messages[topic]]
        np.testing.assert_array_equal([vector(each.force) for each in wrenches], side[force])
        np.testing.assert_allclose([vector(each.torque) for each in wrenches], side[torque], rtol=1e-6)
    assert {message.header.frame_id for _, message in messages["/weberlink/felt"]} == {"felt"}


def test_frames_carry_bodies_and_forces(messages: Messages) -> None:
    found: dict[str, list[Any]] = defaultdict(list)
    for _, message in messages["/tf"]:
        for each in message.transforms:
            assert each.header.frame_id == "weberlink"
            found[each.child_frame_id].append(each.transform)
    assert set(found) == {"hand", "felt", "robot", "measured"}
    for body, force in (("hand", "felt"), ("robot", "measured")):
        for a, b in zip(found[body], found[force], strict=True):
            assert vector(a.translation) == vector(b.translation)
            assert vector(b.rotation, "xyzw") == [0.0, 0.0, 0.0, 1.0]
    assert any(vector(each.rotation) != [0.0, 0.0, 0.0] for each in found["robot"])


def test_stamps_are_log_times_and_rise(messages: Messages) -> None:
    for topic in ("/weberlink/hand", "/weberlink/measured"):
        stamps = [message.header.stamp.sec * 10**9 + message.header.stamp.nanosec for _, message in messages[topic]]
        assert stamps == [at for at, _ in messages[topic]]
        assert set(np.diff(stamps)) == {round(1e9 / RATE_HZ)}


def test_every_tick_is_in_the_file_too(exported: tuple[Recording, Path], messages: Messages) -> None:
    recording, path = exported
    again = read_recording(path)
    assert again.complete
    for side in ("master", "slave"):
        assert again.records[side].tobytes() == recording.records[side].tobytes()
        assert len(messages[f"/weberlink/{side}"]) == len(recording.records[side])
    assert path.stat().st_size < 1.5 * recording.path.stat().st_size


def test_three_degrees_of_freedom_have_no_turn(exported: tuple[Recording, Path], tmp_path: Path) -> None:
    path = tmp_path / "alone.mcap"
    weberlink("simulate", CONFIGS / "loopback.yaml", "--duration", 0.3, "--record", path)
    weberlink("record", "export", path, "--to", "ros")
    _, message = decoded(path.with_name("alone-ros.mcap"))["/weberlink/hand"][-1]
    assert vector(message.pose.orientation, "xyzw") == [0.0, 0.0, 0.0, 1.0]


def resolved(messages: Messages, topic: str, fields: list[str]) -> float:
    value: Any = messages[topic][-1][1]
    for name in fields:
        value = getattr(value, name)
    return float(value)


def test_foxglove_layout_names_what_is_there(messages: Messages) -> None:
    layout = json.loads((CONFIGS / "foxglove-layout.json").read_text(encoding="utf-8"))
    panels = layout["configById"]
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", ())]
    assert len(paths) >= 8
    for path in paths:
        topic, *fields = path.split(".")
        resolved(messages, topic, fields)
    space = panels["3D!weberlink"]
    assert set(space["topics"]) <= set(messages)
    frames = {each.child_frame_id for _, message in messages["/tf"] for each in message.transforms} | {"weberlink"}
    assert {name.removeprefix("frame:") for name in space["transforms"]} == frames
    assert sorted(re.findall(r'"((?:3D|Plot)!\w+)"', json.dumps(layout["layout"]))) == sorted(panels)


def test_plotjuggler_layout_names_what_is_there(messages: Messages) -> None:
    curves = [curve.attrib["name"] for curve in ElementTree.parse(CONFIGS / "plotjuggler-layout.xml").iter("curve")]
    assert len(curves) >= 10
    for name in curves:
        _, first, second, *fields = name.split("/")
        resolved(messages, f"/{first}/{second}", fields)


def test_ros_package_is_that_of_the_recordings() -> None:
    there = {str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*") if path.is_file()}
    assert there == set(files()), "write it with: python -m weberlink.telemetry.recording.ros_package"
    for name, text in files().items():
        assert (PACKAGE / name).read_text(encoding="utf-8") == text, name
    assert SCHEMA_NAME == "weberlink_msgs/msg/Tick"
    assert SCHEMA_TEXT.startswith((PACKAGE / "msg" / "Tick.msg").read_text(encoding="utf-8"))
    assert ElementTree.parse(PACKAGE / "package.xml").findtext("name") == "weberlink_msgs"
    used = set(re.findall(r"^(\w+)/\w+ ", SCHEMA_TEXT, re.M))
    assert used == {"geometry_msgs"}, "dependencies of the package"


def test_arms_have_joint_states(tmp_path: Path) -> None:
    ticks = {side: arm_sessions.records(side, 500) for side in ("master", "slave")}
    path = arm_sessions.recording(tmp_path / "arms.mcap", ticks)
    assert "joint states" in weberlink("record", "export", path, "--to", "ros")
    found = decoded(tmp_path / "arms-ros.mcap")
    assert set(found) == {"/weberlink/master", "/weberlink/slave", "/weberlink/leader", "/weberlink/follower"}
    names, places = [*arm_sessions.NAMES, "gripper"], list(arm_sessions.PLACES)
    for topic, side, torque in (("leader", "master", "joint_output"), ("follower", "slave", "joint_raw")):
        states = [message for _, message in found[f"/weberlink/{topic}"]]
        few = ticks[side][:: round(1000.0 / RATE_HZ)]
        assert all(list(state.name) == names and not len(state.velocity) for state in states)
        np.testing.assert_array_equal([list(state.position) for state in states], few["joint_position"][:, places])
        np.testing.assert_array_equal([list(state.effort) for state in states], few[torque][:, places])
    _, tick = found["/weberlink/slave"][100]
    assert list(tick.joint_raw) == ticks["slave"]["joint_raw"][100].tolist()
