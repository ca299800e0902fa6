"""Nodes on Zenoh sessions of this process: who hears whom, and what is open to others."""

import json
import socket
import time
from contextlib import suppress
from pathlib import Path

import pytest
import zenoh

from plugins.ros2.tests.rigs import endpoint
from tests.wait import until
from weberlink_figures.message import ENCAPSULATION
from weberlink_ros2.messages import encode_body, types
from weberlink_ros2.names import Attachment, Qos
from weberlink_ros2.node import CONFIG_VARIABLE, Node, NodeError, Publisher

STRING = "std_msgs/msg/String"
BODY = encode_body(types().types[STRING]("hello"), STRING)
Heard = list[tuple[bytes, Attachment]]


def hear(node: Node, topic: str = "/chatter") -> Heard:
    heard: Heard = []
    node.subscribe(topic, STRING, lambda cdr, attachment: heard.append((cdr, attachment)))
    return heard


def published(node: Node, heard: Heard) -> Publisher:
    publisher = node.publisher("/chatter", STRING)
    until(lambda: publisher.put_body(BODY, 5) or heard, "a message")
    return publisher


@pytest.mark.realtime
def test_messages_come_with_time_and_source_and_nodes_listen_on_loopback_alone() -> None:
    before, where = listening(), endpoint()
    with Node("first", connect=where) as first, Node("second", connect=where) as second:
        heard, elsewhere = hear(second), hear(second, "/other")
        other = first.publisher("/chatter", STRING, Qos(reliable=False))
        published(first, heard)
        first_source = heard[0][1].source
        heard.clear()
        other.put_body(BODY, 6)
        until(lambda: any(told.stamp_ns == 6 for _, told in heard), "a message")
        (message,) = [message for message in heard if message[1].stamp_ns == 6]
        assert message[0] == ENCAPSULATION + BODY
        assert len(message[1].source) == 16 and message[1].source != first_source and message[1].sequence == 1
        assert not elsewhere
        assert first.is_router and not second.is_router and first.connections == second.connections == 1
        assert {address for address, _ in listening() - before} <= {socket.inet_aton("127.0.0.1")[::-1].hex().upper()}


@pytest.mark.realtime
def test_other_domains_hear_nothing() -> None:
    where = endpoint()
    with Node("first", 1, where) as first, Node("second", 1, where) as same, Node("third", 2, where) as other:
        heard, unheard = hear(same), hear(other)
        publisher = published(first, heard)
        until(lambda: other.connections, "a connection")
        publisher.put_body(BODY, 0)
        time.sleep(0.1)
        assert not unheard


@pytest.mark.realtime
def test_a_router_elsewhere_forwards_messages() -> None:
    where = endpoint().replace("127.0.0.1", "127.0.0.2")
    with pytest.raises(NodeError, match="Unable to connect"):
        Node("first", connect=where)
    config = zenoh.Config.from_json5(json.dumps({"mode": "router", "listen": {"endpoints": [where]}}))
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config), Node("first", connect=where) as first, Node("second", connect=where) as second:
        heard = hear(second)
        published(first, heard)
        assert not first.is_router and first.connections == second.connections == 1


def listening() -> set[tuple[str, str]]:
    """Address and port of the sockets of this process that listen for TCP, and of those of UDP."""
    inodes = set()
    for link in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # that of the folder itself
            inodes.add(str(link.readlink()).removeprefix("socket:[").removesuffix("]"))
    found = set()
    for kind, states in (("tcp", {"0A"}), ("tcp6", {"0A"}), ("udp", {"07"}), ("udp6", {"07"})):
        for line in Path(f"/proc/net/{kind}").read_text(encoding="ascii").splitlines()[1:]:
            fields = line.split()
            if fields[3] in states and fields[9] in inodes:
                address, _, port = fields[1].partition(":")
                found.add((address, port))
    return found


def test_a_closed_node_says_so() -> None:
    node = Node("first", connect=endpoint())
    publisher = node.publisher("/chatter", STRING)
    for _ in range(2):
        node.close()
    with pytest.raises(NodeError, match="closed"):
        publisher.put_body(BODY, 0)


def test_the_file_of_the_environment_configures_the_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, where = tmp_path / "session.json5", endpoint()
    monkeypatch.setenv(CONFIG_VARIABLE, str(file))
    with pytest.raises(NodeError, match=r"session\.json5"):
        Node("first")
    without = {"multicast": {"enabled": False}}
    file.write_text(json.dumps({"mode": "peer", "listen": {"endpoints": [where]}, "scouting": without}))
    with Node("first") as first, socket.create_connection(("127.0.0.1", int(where.rpartition(":")[2])), timeout=5):
        assert not first.is_router
