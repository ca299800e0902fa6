"""The live view for Foxglove on rings that are filled by hand, read by a client."""

import json
import re
from base64 import b64decode
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
from foxglove import Parameter
from foxglove.websocket import WebSocketServer
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.descriptor_pb2 import FileDescriptorSet

from tests.apps import arm_sessions
from tests.apps.bridge.foxglove_client import FoxgloveClient
from tests.system.processes import until
from tests.system.systems import CONFIGS
from tests.watching.sources import description, records, write
from weberlink.apps.bridge.follow import FIND_S, SessionFollower
from weberlink.apps.bridge.foxglove.bridge import FoxgloveBridge
from weberlink.system.description import Description
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.recording.message import ENCAPSULATION, SCHEMA_TEXT
from weberlink.telemetry.ring import RingWriter

MESSAGES = {
    "foxglove.FrameTransforms": FrameTransforms,
    "foxglove.JointStates": JointStates,
    "foxglove.Log": Log,
    "foxglove.PoseInFrame": PoseInFrame,
    "foxglove.SceneUpdate": SceneUpdate,
}


class View:
    """A bridge that follows the rings of a folder; time passes by `look` only."""

    def __init__(self, folder: Path, *, allow_changes: bool) -> None:
        self.said: list[str] = []
        self.bridge = FoxgloveBridge("127.0.0.1", 0, allow_changes=allow_changes, tell=self.said.append)
        self._follower = SessionFollower(self.bridge, None, self.said.append, folder)
        self._now = 0.0

    def look(self) -> None:
        self._now += FIND_S
        self._follower.look(self._now)

    def until(self, client: FoxgloveClient, topic: str, count: int = 1) -> list[bytes]:
        """Messages of a topic, once there are so many."""

        def enough() -> bool:
            self.look()
            return len(client.messages[topic]) >= count

        until(enough, f"{count} messages of {topic}")
        return client.messages[topic]

    def close(self) -> None:
        self._follower.close()
        self.bridge.close()


@contextmanager
def view(folder: Path, *, allow_changes: bool = False) -> Iterator[View]:
    one = View(folder, allow_changes=allow_changes)
    try:
        yield one
    finally:
        one.close()


def ring(folder: Path, side: str, session: int = 7, described: Any = None) -> RingWriter:
    path = folder / f"weberlink-{session}-{side}.ring"
    Description(path, described or description(side)).publish()
    return RingWriter.create(path, side=side, rate_hz=1000.0, capacity=4096)


def parsed(client: FoxgloveClient, topic: str) -> list[Any]:
    """Messages as the published classes read them; they have no field that these do not know."""
    kind = MESSAGES[client.types[topic]]
    read = [kind.FromString(message) for message in client.messages[topic]]
    for message in read:
        before = message.ByteSize()
        message.DiscardUnknownFields()
        assert message.ByteSize() == before, topic
    return read


def test_every_tick_comes_as_it_was_recorded(tmp_path: Path) -> None:
    made = records(300, seed=1)
    with view(tmp_path) as seen, ring(tmp_path, "slave") as slave, FoxgloveClient(seen.bridge.port) as client:
        until(lambda: len(client.types) == 13, "all topics")
        seen.look()
        client.answer("getParameters", "parameterValues", parameterNames=[], id="is subscribed")
        for piece in np.split(made, [1, 100, 299]):
            write(slave, piece)
            seen.look()
        messages = seen.until(client, "/weberlink/slave", len(made))
        assert client.schemas["/weberlink/slave"] == SCHEMA_TEXT
        assert {message[: len(ENCAPSULATION)] for message in messages} == {ENCAPSULATION}
        body = b"".join(message[len(ENCAPSULATION) :] for message in messages)
        assert np.frombuffer(body, DTYPE).tobytes() == made.tobytes()


def test_messages_are_of_the_published_schemas(tmp_path: Path) -> None:
    with view(tmp_path) as seen, ring(tmp_path, "slave") as slave, ring(tmp_path, "master") as master:
        seen.look()
        with FoxgloveClient(seen.bridge.port) as client:
            until(lambda: len(client.types) == 13, "all topics")
            client.answer("getParameters", "parameterValues", parameterNames=[], id="is subscribed")
            made = records(50, seed=1)
            made["rotation_output"] = made["rotation_raw"] = (0.0, 0.0, np.pi / 2)
            for writer in (slave, master):
                write(writer, made)
            for topic in ("/weberlink/robot", "/weberlink/bodies", "/tf", "/weberlink/log", "/weberlink/felt_error"):
                seen.until(client, topic)
            pose = parsed(client, "/weberlink/robot")[-1]
            assert pose.frame_id == "weberlink" and pose.timestamp.ToNanoseconds() > 1e18
            place = [getattr(pose.pose.position, axis) for axis in "xyz"]
            assert place == made["output"][-1].tolist()
            turn = [getattr(pose.pose.orientation, axis) for axis in "xyzw"]
            assert turn == pytest.approx([0.0, 0.0, 0.5**0.5, 0.5**0.5])
            frames = {each.child_frame_id: each for each in parsed(client, "/tf")[-1].transforms}
            assert set(frames) == {"hand", "robot"} and frames["hand"].translation.x == made["position"][-1][0]
            assert {each.name for each in parsed(client, "/weberlink/log")} <= {"master", "slave"}
            bodies = parsed(client, "/weberlink/bodies")[-1].entities
            assert [each.id for each in bodies] == ["robot", "hand", "surface"]
            felt = json.loads(client.messages["/weberlink/felt_error"][-1])
            assert felt["deadbands"] == pytest.approx(felt["error"] / felt["bound"])
        for topic, name in client.types.items():
            if name in MESSAGES:
                files = FileDescriptorSet.FromString(b64decode(client.schemas[topic])).file
                fields = {f"{file.package}.{kind.name}": kind for file in files for kind in file.message_type}[
                    name
                ].field
                published = MESSAGES[name].DESCRIPTOR.fields_by_name
                assert {each.name: each.number for each in fields} == {key: of.number for key, of in published.items()}


def test_a_new_client_is_told_what_was_before(tmp_path: Path) -> None:
    with view(tmp_path) as seen, ring(tmp_path, "slave") as slave:
        write(slave, records(20))
        seen.look()
        for _ in range(2):
            with FoxgloveClient(seen.bridge.port, {"/weberlink/scene", "/weberlink/log"}) as client:
                seen.until(client, "/weberlink/scene")
                seen.until(client, "/weberlink/log")
                (scene,) = parsed(client, "/weberlink/scene")
                assert [each.id for each in scene.entities] == ["solid 0", "solid 1"]  # of configs/loopback.yaml
                texts = [each.message for each in parsed(client, "/weberlink/log")]
                assert len(texts) == len(set(texts)) and "began at 1000 Hz" in texts[0]


def test_the_next_session_takes_the_place_of_the_last(tmp_path: Path) -> None:
    box = description("slave", "scene-box.yaml")
    with view(tmp_path) as seen, FoxgloveClient(seen.bridge.port) as client:
        with ring(tmp_path, "slave") as slave:
            write(slave, records(20))
            seen.until(client, "/weberlink/log")
        seen.look()
        with ring(tmp_path, "slave", 8, box) as slave:
            write(slave, records(20))
            scenes = len(client.messages["/weberlink/scene"])
            seen.until(client, "/weberlink/scene", scenes + 1)
            newest = parsed(client, "/weberlink/scene")[-1]
            assert newest.deletions and [bool(each.cubes) for each in newest.entities][-1]
            client.messages["/diagnostics"].clear()
            seen.look()
            status = json.loads(seen.until(client, "/diagnostics")[-1])["status"]
            assert status[0]["hardware_id"] == "8" and {each["level"] for each in status} <= {0, 1, 2}
        client.messages["/diagnostics"].clear()
        ended = json.loads(seen.until(client, "/diagnostics", 8)[-1])["status"]
        assert ended[0]["level"] == 3 and ended[0]["message"] == "over"


def test_arms_have_joint_states(tmp_path: Path) -> None:
    for side, torque in (("master", "joint_output"), ("slave", "joint_raw")):
        folder = tmp_path / side
        folder.mkdir()
        topic = f"/weberlink/{'leader' if side == 'master' else 'follower'}"
        made = arm_sessions.records(side, 30)
        described = {"side": side, "system": arm_sessions.SYSTEM}
        with view(folder) as seen, FoxgloveClient(seen.bridge.port, {topic, "/weberlink/hand"}) as client:
            with ring(folder, side, described=described) as writer:
                seen.look()
                until(lambda client=client: len(client.types) == 13, "all topics")  # type: ignore[misc]
                client.answer("getParameters", "parameterValues", parameterNames=[], id="is subscribed")
                write(writer, made)
                seen.until(client, topic)
            joints = parsed(client, topic)[-1].joints
            assert [each.name for each in joints] == [*arm_sessions.NAMES, "gripper"]
            places = list(arm_sessions.PLACES)
            assert [each.position for each in joints] == made["joint_position"][-1][places].tolist()
            assert [each.effort for each in joints] == made[torque][-1][places].tolist()
            assert not joints[0].HasField("velocity") and not client.messages["/weberlink/hand"]


@pytest.mark.parametrize(("allow", "why"), [(False, "--allow-changes"), (True, "no running session")])
def test_a_refused_parameter_says_why(tmp_path: Path, allow: bool, why: str) -> None:
    with view(tmp_path, allow_changes=allow) as seen, FoxgloveClient(seen.bridge.port) as client:
        wish = [{"name": "weber", "value": 0.2}]
        told = client.answer("setParameters", "status", parameters=wish)
        assert why in told["message"] and told["level"] == 2 and why in seen.said[-1]
        none = client.answer("getParameters", "parameterValues", parameterNames=[], id="1")
        assert none["parameters"] == []


def test_a_session_without_a_description_is_shown(tmp_path: Path) -> None:
    path = tmp_path / "weberlink-7-slave.ring"
    with view(tmp_path) as seen, RingWriter.create(path, side="slave", rate_hz=1000.0, capacity=4096) as slave:
        seen.look()
        with FoxgloveClient(seen.bridge.port) as client:
            seen.until(client, "/weberlink/scene")
            write(slave, records(20))
            for topic in ("/weberlink/slave", "/weberlink/bodies", "/weberlink/log", "/diagnostics"):
                seen.until(client, topic)
            assert not parsed(client, "/weberlink/scene")[-1].entities


def test_layout_names_topics_that_are_there(tmp_path: Path) -> None:
    layout = json.loads((CONFIGS / "foxglove-live-layout.json").read_text(encoding="utf-8"))
    panels = layout["configById"]
    with view(tmp_path) as seen, FoxgloveClient(seen.bridge.port) as client:
        until(lambda: len(client.types) == 13, "all topics")
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", ())]
    assert len(paths) > 15
    for path in paths:
        topic, field, *rest = re.split(r"[.\[]", path)
        assert topic in client.types, path
        if client.types[topic] == "weberlink_msgs/msg/Tick":
            assert DTYPE[field].subdtype is not None if rest else DTYPE[field].subdtype is None, path
        elif client.types[topic] == "foxglove.JointStates":
            assert field == "joints" and rest[-1] in ("position", "effort"), path
        else:
            assert field in json.loads(client.schemas[topic])["properties"], path
    assert set(panels["3D!weberlink"]["topics"]) < set(client.types)
    topics = {
        panel["topicToRender"]: client.types[panel["topicToRender"]]
        for panel in panels.values()
        if "topicToRender" in panel
    }
    assert topics == {"/weberlink/log": "foxglove.Log", "/diagnostics": "diagnostic_msgs/DiagnosticArray"}
    placed = re.findall(r'"(\w+!\w+)"', json.dumps([layout["layout"], panels["Tab!weberlink"]]))
    assert sorted(placed) == sorted(panels)


def test_a_client_may_ask_for_a_change_while_the_server_starts() -> None:
    said: list[str] = []
    asking: list[Thread] = []

    class Hasty(FoxgloveBridge):
        def _serve(self, listen: str, port: int) -> WebSocketServer:
            client: Any = None
            asking.append(Thread(target=self.on_set_parameters, args=(client, [Parameter("weber", value=0.2)])))
            asking[0].start()
            asking[0].join(0.1)
            return super()._serve(listen, port)

    bridge = Hasty("127.0.0.1", 0, allow_changes=False, tell=said.append)
    asking[0].join(10.0)
    bridge.close()
    assert [line.partition(": ")[:1] for line in said] == [("refused",)]
