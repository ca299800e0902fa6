"""A ROS 2 node on a Zenoh session: publishers and subscriptions that rmw_zenoh takes for its own.

As rmw_zenoh does, a node connects to the Zenoh router of this host, finds other nodes through it, and then talks to
them directly. Where there is no router on this host the first node takes its place, on the loopback interface only.
With a router elsewhere the node is a client, since nodes there cannot reach its loopback interface.
"""

import json
import os
from collections.abc import Callable
from hashlib import blake2b
from typing import Final, Self

import zenoh

from weberlink_figures.message import ENCAPSULATION
from weberlink_ros2.messages import type_hash
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
    publishers_of,
)

ROUTER: Final = "tcp/localhost:7447"  # where nodes look for the router of their host
CONFIG_VARIABLE: Final = "ZENOH_SESSION_CONFIG_URI"
"""Environment variable of rmw_zenoh: path of a file that configures the session."""
ANSWER_S: Final = 1.0
_LOOPBACK: Final = ("tcp/localhost:", "tcp/127.0.0.1:")

Received = Callable[[bytes, "Attachment"], None]
"""Called with a message (CDR with its encapsulation header), the time when it was published [ns since 1970], and the
identity of its publisher (16 bytes)."""


class NodeError(OSError):
    """The Zenoh session could not be opened, or has failed."""


class Node:
    """A node; it is alive for others until it is closed or its process ends.

    Args:
        name: of the node.
        domain: as ROS_DOMAIN_ID; nodes of different domains do not see each other.
        connect: endpoint of the router, such as "tcp/192.168.1.5:7447"; None for that of the file named by
            `CONFIG_VARIABLE`, or else `ROUTER`.

    Raises:
        ValueError: no such domain, a name that ROS does not allow, or no endpoint.
        NodeError: the session cannot be opened.
    """

    def __init__(self, name: str, domain: int = 0, connect: str | None = None) -> None:
        check_node_name(name)
        self._domain = check_domain(domain)
        # Whether this node has taken the place of the router of its host.
        self._session, self.is_router = _open(connect)
        self._name = NodeName(domain, str(self._session.info.zid()), name)
        self._endpoints = 0
        self._tokens = [self._session.liveliness().declare_token(self._name.token())]

    def publisher(self, topic: str, type_name: str, qos: Qos | None = None) -> "Publisher":
        """Announce a topic, such as "/weberlink/hand" of "geometry_msgs/msg/PoseStamped"; raises ValueError for a name
        that ROS does not allow, or a type that it does not have.
        """
        quality = qos or Qos()
        key, token = self._announce(PUBLISHER, topic, type_name, quality)
        reliability = zenoh.Reliability.RELIABLE if quality.reliable else zenoh.Reliability.BEST_EFFORT
        # As rmw_zenoh for KEEP_LAST: who does not read fast enough loses messages, and holds up nobody.
        raw = self._session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP, reliability=reliability
        )
        return Publisher(raw, blake2b(token.encode(), digest_size=16).digest())

    def subscribe(self, topic: str, type_name: str, callback: Received, qos: Qos | None = None) -> None:
        """Receive the messages of a topic, in a thread of Zenoh; what no ROS publisher sent is left out. Raises
        ValueError as `publisher`.
        """

        def receive(sample: zenoh.Sample) -> None:
            attached = sample.attachment
            try:
                attachment = Attachment.from_bytes(bytes(attached) if attached is not None else b"")
            except ValueError:
                return  # rmw_zenoh drops it as well
            callback(bytes(sample.payload), attachment)

        key, _ = self._announce(SUBSCRIPTION, topic, type_name, qos or Qos())
        self._session.declare_subscriber(key, receive)

    def published(self, topic: str) -> set[Topic]:
        """The types that a topic is published as, by any node; waits for the answers, at most `ANSWER_S`."""
        try:
            replies = self._session.liveliness().get(publishers_of(self._domain, topic), timeout=ANSWER_S)
            return {Topic.of_token(str(reply.ok.key_expr)) for reply in replies if reply.ok is not None}
        except zenoh.ZError as error:
            raise NodeError(f"cannot ask for the publishers of {topic}: {error}") from error

    @property
    def connections(self) -> int:
        """Number of routers and other nodes that this one is connected to."""
        return len(self._session.info.routers_zid()) + len(self._session.info.peers_zid())

    def close(self) -> None:
        """Leave; others see at once that the node is gone. May be called again."""
        if not self._session.is_closed():
            self._session.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _announce(self, kind: str, name: str, type_name: str, qos: Qos) -> tuple[str, str]:
        """Key and token of a new endpoint, whose token is declared."""
        topic = Topic(check_topic(name), type_name, type_hash(type_name))
        self._endpoints += 1
        token = self._name.endpoint_token(self._endpoints, kind, topic, qos)
        self._tokens.append(self._session.liveliness().declare_token(token))
        return topic.key(self._domain), token


class Publisher:
    """Publishes messages of one topic; made by `Node.publisher`."""

    def __init__(self, raw: zenoh.Publisher, source: bytes) -> None:
        self._raw, self._source = raw, source  # of the Zenoh session, and its identity, 16 bytes
        self.sequence = 0  # number of messages published

    def put_body(self, cdr: bytes, stamp_ns: int) -> None:
        """Publish the body of a message, little endian, at a time [ns since 1970]; NodeError if the node was closed."""
        self.sequence += 1
        attachment = Attachment(self.sequence, stamp_ns, self._source)
        try:
            self._raw.put(ENCAPSULATION + cdr, attachment=attachment.to_bytes())
        except zenoh.ZError as error:
            raise NodeError(f"cannot publish: {error}") from error


def _open(connect: str | None) -> tuple[zenoh.Session, bool]:
    """A session, and whether it is the router of this host."""
    file = os.environ.get(CONFIG_VARIABLE)
    router = ROUTER if connect is None else check_endpoint(connect)
    try:
        if file:
            config = zenoh.Config.from_file(file)
            if connect is not None:
                config.insert_json5("connect/endpoints", json.dumps([connect]))
            return zenoh.open(config), False
        if router.startswith(_LOOPBACK):
            try:
                return zenoh.open(_config("router", [router.replace("localhost", "127.0.0.1")], [])), True
            except zenoh.ZError:
                pass  # the address is in use: there is a router, or a node in its place
            return zenoh.open(_config("peer", ["tcp/127.0.0.1:0"], [router])), False
        return zenoh.open(_config("client", [], [router])), False
    except zenoh.ZError as error:
        raise NodeError(
            f"cannot open a Zenoh session with {file or router}: {str(error).partition(' at /')[0]}"
        ) from error


def _config(mode: str, listen: list[str], connect: list[str]) -> zenoh.Config:
    """As DEFAULT_RMW_ZENOH_SESSION_CONFIG.json5 and DEFAULT_RMW_ZENOH_ROUTER_CONFIG.json5, on loopback."""
    config = zenoh.Config()
    values = {"mode": mode, "listen/endpoints": listen, "connect/endpoints": connect}
    scouting = {"scouting/multicast/enabled": False, "scouting/gossip/enabled": True}
    for path, value in (values | scouting).items():
        config.insert_json5(path, json.dumps(value))
    return config
