"""The live view for Foxglove on rings that are filled by hand, read by a client."""

import json
from collections import defaultdict
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any, Self

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from plugins.figures.tests.sources import daemons, description, records, write
from plugins.ros2.tests.rigs import ring
from tests.program import weberlink
from tests.wait import until
from weberlink_figures.message import ENCAPSULATION, SCHEMA_TEXT
from weberlink_foxglove.bridge import FoxgloveBridge
from weberlink_ros2.follow import FIND_S, SessionFollower
from weberlink_ros2.markers import CUBE, DELETE_ALL
from weberlink_ros2.messages import decode

TOPICS = 14
HEAD = 13  # bytes before a message: kind, subscription and log time


class FoxgloveClient:
    """Subscribes to all topics of a server on this host, and keeps what it is sent."""

    def __init__(self, port: int) -> None:
        self.types: dict[str, str] = {}
        self.schemas: dict[str, str] = {}
        self.messages: dict[str, list[bytes]] = defaultdict(list)
        self.told: list[dict[str, Any]] = []
        self._names: dict[int, str] = {}
        self._socket = connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"], max_size=None, legacy=True)  # type: ignore[list-item]
        self._thread = Thread(target=self._read, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._socket.close()
        self._thread.join()

    def answer(self, op: str, to: str, **content: Any) -> dict[str, Any]:
        known = len(self.told)
        self._socket.send(json.dumps({"op": op, **content}))
        return until(lambda: next((each for each in self.told[known:] if each["op"] == to), {}), to)

    def _read(self) -> None:
        with suppress(ConnectionClosed):
            for message in self._socket:
                if isinstance(message, bytes):
                    self.messages[self._names[int.from_bytes(message[1:5], "little")]].append(message[HEAD:])
                else:
                    self._take(json.loads(message))

    def _take(self, document: dict[str, Any]) -> None:
        for channel in document.get("channels", ()):
            self.types[channel["topic"]] = channel["schemaName"]
            self.schemas[channel["topic"]] = channel["schema"]
            self._names[channel["id"]] = channel["topic"]
            wish = [{"id": channel["id"], "channelId": channel["id"]}]
            self._socket.send(json.dumps({"op": "subscribe", "subscriptions": wish}))
        self.told.append(document)


class View:
    """A bridge that follows the rings of a folder, and a client; time passes by `look` only."""

    def __init__(self, folder: Path, *, allow_changes: bool = False) -> None:
        self.said: list[str] = []
        self.bridge = FoxgloveBridge("127.0.0.1", 0, allow_changes=allow_changes, tell=self.said.append)
        self._follower = SessionFollower(self.bridge, None, self.said.append, folder)
        self.client = FoxgloveClient(self.bridge.server.port)
        self._now = 0.0

    def look(self) -> None:
        self._now += FIND_S
        self._follower.look(self._now)

    def until(self, topic: str, count: int = 1) -> list[bytes]:
        until(lambda: self.look() or len(self.client.messages[topic]) >= count, f"{count} messages of {topic}")  # type: ignore[func-returns-value]
        return self.client.messages[topic]

    def parsed(self, topic: str, count: int) -> list[Any]:
        """The same, as ROS reads them."""
        return [decode(message, self.client.types[topic]) for message in self.until(topic, count)]

    def ask(self, name: str) -> dict[str, Any]:
        return self.client.answer("setParameters", "status", parameters=[{"name": name, "value": 0.2}])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.client.close()
        self._follower.close()
        self.bridge.close()


def test_every_tick_comes_as_it_was_recorded(tmp_path: Path) -> None:
    made = records(300, seed=1)
    with View(tmp_path) as seen, ring(tmp_path, "slave") as slave:
        until(lambda: len(seen.client.types) == TOPICS, "all topics")
        seen.look()
        seen.client.answer("getParameters", "parameterValues", parameterNames=[], id="is subscribed")
        for piece in np.split(made, [1, 100, 299]):
            write(slave, piece)
            seen.look()
        messages = seen.until("/weberlink/slave", len(made))
        assert seen.client.schemas["/weberlink/slave"] == SCHEMA_TEXT
        assert messages == [ENCAPSULATION + row.tobytes() for row in made]


def test_the_next_session_takes_the_place_of_the_last(tmp_path: Path) -> None:
    with View(tmp_path) as seen:
        with ring(tmp_path, "slave") as slave:
            write(slave, records(20))
            seen.until("/weberlink/log")
        seen.look()
        with ring(tmp_path, "slave", 8, description("slave", "scene-box.yaml")) as slave:
            write(slave, records(20))
            scenes: list[Any] = []
            while not any(each.markers[-1].type == CUBE for each in scenes):
                scenes = seen.parsed("/weberlink/scene", len(scenes) + 1)
            boxed = next(index for index, each in enumerate(scenes) if each.markers[-1].type == CUBE)
            assert [each.action for each in scenes[boxed - 1].markers] == [DELETE_ALL]
            seen.client.messages["/diagnostics"].clear()
            status = seen.parsed("/diagnostics", 2)[-1].status  # the first one tells the end of the former session
            assert status[0].hardware_id == "8" and {each.level for each in status} <= {0, 1, 2}


@pytest.mark.parametrize(
    ("allow", "name", "why"),
    [
        (False, "weber", "--allow-changes"),
        (True, "weber", "no running session"),
        (True, "stop", "no parameter stop"),
        (True, "emergency", "no parameter emergency"),
    ],
)
def test_a_refused_parameter_says_why(tmp_path: Path, allow: bool, name: str, why: str) -> None:
    with View(tmp_path, allow_changes=allow) as seen:
        told = seen.ask(name)
        assert why in told["message"] and told["level"] == 2 and why in seen.said[-1]
        assert seen.client.answer("getParameters", "parameterValues", parameterNames=[], id="1")["parameters"] == []


def test_a_permitted_parameter_is_up_to_the_daemons(tmp_path: Path) -> None:
    with daemons(tmp_path) as sides, View(tmp_path, allow_changes=True) as seen:
        seen.look()
        assert "a daemon of a test" in seen.ask("weber")["message"]
        assert [side.proposed for side in sides if side.proposed] == [[{"weber": 0.2}]], "the two agree by themselves"


def test_an_address_that_others_can_reach_is_asked_for() -> None:
    for address in ("0.0.0.0", "::", "192.0.2.1"):
        said = weberlink("bridge", "foxglove", "--listen", address).complaint()
        assert f"--listen {address}" in said and "--public" in said
