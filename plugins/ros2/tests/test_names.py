"""Keys, tokens, hashes and attachments: as rmw_zenoh documents them, and as zenoh-ros2-sdk builds and reads them."""

from importlib import import_module
from typing import Any

import pytest
from hypothesis import given, strategies as st

from weberlink_figures.message import ENCAPSULATION
from weberlink_figures.watching.ros import SCHEMAS
from weberlink_ros2.messages import decode, encode_body, type_hash, types
from weberlink_ros2.names import (
    PUBLISHER,
    SUBSCRIPTION,
    Attachment,
    NodeName,
    Qos,
    Topic,
    check_domain,
    check_endpoint,
    check_node_name,
    check_topic,
)

STRING = "std_msgs/msg/String"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
CHATTER = Topic("/chatter", STRING, STRING_HASH)
LISTENER = NodeName(2, "aac3178e146ba6f1fc6e6a4085e77f21", "listener")


def others(module: str) -> Any:
    """A module of zenoh-ros2-sdk, which may be missing."""
    pytest.importorskip("zenoh_ros2_sdk", exc_type=ImportError)
    return import_module(f"zenoh_ros2_sdk.{module}")


def test_names_are_those_of_the_design_document() -> None:
    """Examples of docs/design.md of ros2/rmw_zenoh."""
    string = f"std_msgs::msg::dds_::String_/{STRING_HASH}"
    assert CHATTER.key(0) == f"0/chatter/{string}"
    assert CHATTER._replace(name="/robot1/chatter").key(0) == f"0/robot1/chatter/{string}"
    node = "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0"
    assert LISTENER.token() == f"{node}/0/NN/%/%/listener"
    for kind, letters, depth in ((SUBSCRIPTION, "MS", 10), (PUBLISHER, "MP", 7)):
        token = f"{node}/10/{letters}/%/%/listener/%chatter/{string}/::,{depth}:,:,:,,"
        assert LISTENER.endpoint_token(10, kind, CHATTER, Qos(depth=depth)) == token


def test_hashes_are_those_that_ros_prints() -> None:
    """std_msgs/String in docs/design.md of ros2/rmw_zenoh; TFMessage as `ros2 topic info -v /tf` of Jazzy prints it."""
    assert type_hash(STRING) == STRING_HASH
    assert type_hash("tf2_msgs/msg/TFMessage") == (
        "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
    )


@pytest.mark.parametrize("name", [*SCHEMAS, "diagnostic_msgs/msg/DiagnosticArray"])
def test_sdk_computes_the_same_hash(name: str) -> None:
    get_type_hash = others("utils").get_type_hash
    own, *parts = types().generate_msgdef(name, ros_version=2)[0].split("=" * 80 + "\n")
    dependencies = {}
    for part in parts:
        first, _, text = part.partition("\n")
        package, _, message = first.removeprefix("MSG: ").partition("/")
        dependencies[f"{package}/msg/{message}"] = text
    assert get_type_hash(name, msg_definition=own, dependencies=dependencies) == type_hash(name)


def test_sdk_reads_our_attachment_and_we_its() -> None:
    sdk, values = others("attachment"), (7, 123_456_789, bytes(range(16)))
    data = Attachment(*values).to_bytes()
    assert sdk.Attachment(*values).to_bytes() == data
    assert sdk.Attachment.from_bytes(data) == sdk.Attachment(*values)
    assert Attachment.from_bytes(data) == Attachment(*values)


@given(st.binary(max_size=40))
def test_no_other_bytes_are_an_attachment(data: bytes) -> None:
    if len(data) == 33 and data[16] == 16:
        return
    with pytest.raises(ValueError, match=r"bytes"):
        Attachment.from_bytes(data)


@pytest.mark.parametrize("kind", [PUBLISHER, SUBSCRIPTION])
def test_token_tells_its_topic(kind: str) -> None:
    for topic in (CHATTER, Topic("/arm/left/pose", "geometry_msgs/msg/PoseStamped", "RIHS01_0")):
        token = LISTENER.endpoint_token(10, kind, topic, Qos())
        assert Topic.of_token(token) == topic
        for other in (LISTENER.token(), topic.key(2), "", f"{token}/more"):
            with pytest.raises(ValueError, match="not the token"):
                Topic.of_token(other)


@pytest.mark.parametrize(
    ("check", "what", "good", "wrong"),
    [
        (check_topic, "topic", ("/x", "/a/b_1"), ("chatter", "/", "/x/", "//x", "/1x", "/a b", "/a*", "/a/**")),
        (check_node_name, "node", ("a", "a_1"), ("", "a/b", "1a", "a-b", "a*")),
        (check_domain, "domain", (0, 232), (-1, 233)),
        (
            check_endpoint, "endpoint", ("tcp/localhost:7447", "tcp/127.0.0.1:1"),
            ("localhost", "tcp/localhost", "tcp/:7447", "http/localhost:1", "tcp/a b:1"),
        ),
        (type_hash, "type", (STRING,), ("PoseStamped", "geometry_msgs/PoseStamped", "geometry_msgs/msg/Nothing")),
    ],
)  # fmt: skip
def test_names_that_ros_refuses_are_refused(
    check: Any, what: str, good: tuple[Any, ...], wrong: tuple[Any, ...]
) -> None:
    for each in good:
        check(each)
    for each in wrong:
        with pytest.raises(ValueError, match=what):
            check(each)


def test_other_bytes_are_no_message() -> None:
    message = types().types[STRING]("a")
    body = encode_body(message, STRING)
    assert decode(ENCAPSULATION + body, STRING) == message
    for wrong in (b"", ENCAPSULATION, ENCAPSULATION + body[:-1], b"\xff" * 64):
        with pytest.raises(ValueError, match="are no std_msgs"):
            decode(wrong, STRING)
