"""Names of rmw_zenoh: keys of topics, liveliness tokens, quality of service, and what is attached to a message.

Source: docs/design.md and the functions qos_to_keyexpr and AttachmentData of https://github.com/ros2/rmw_zenoh.
"""

import re
from dataclasses import dataclass
from functools import partial
from struct import Struct, error
from typing import Final, NamedTuple

LARGEST_DOMAIN: Final = 232  # of ROS_DOMAIN_ID; larger ones have no ports under DDS
PUBLISHER: Final = "MP"
SUBSCRIPTION: Final = "MS"
_NODE: Final = "NN"
_TOKENS: Final = "@ros2_lv"
_NO_NAME: Final = "%"  # an empty enclave or namespace

_TOKEN_PARTS: Final = 13  # of the token of an endpoint

_ATTACHMENT: Final = Struct("<qqB16s")  # sequence number, time of the source [ns], length of the identity, identity
_IDENTITY_BYTES: Final = 16

_NODE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_ENDPOINT = re.compile(r"(tcp|tls|udp|quic|ws)/[^\s/]+:\d{1,5}")
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/msg/([A-Z][A-Za-z0-9]*)")


@dataclass(frozen=True)
class Qos:
    """Quality of service as other nodes read it; volatile, the last `depth` messages are kept."""

    reliable: bool = True
    depth: int = 10

    def text(self) -> str:
        """As in a token; parts that have the default of rmw_zenoh are left out, see qos_to_keyexpr."""
        return f"{'' if self.reliable else 2}::,{'' if self.depth == _DEFAULT_DEPTH else self.depth}:,:,:,,"


_DEFAULT_DEPTH: Final = 42


class Topic(NamedTuple):
    """A topic and its type."""

    name: str  # with its namespace, for example "/weberlink/hand"
    type_name: str  # for example "geometry_msgs/msg/PoseStamped"
    type_hash: str  # of its definition, "RIHS01_" and 64 hexadecimal digits

    def key(self, domain: int) -> str:
        """Under which its messages are put."""
        return f"{domain}{self.name}/{_dds(self.type_name)}/{self.type_hash}"

    @classmethod
    def of_token(cls, token: str) -> "Topic":
        """The topic of the token of a publisher or subscription; raises ValueError if it is none."""
        parts = token.split("/")
        if parts[0] != _TOKENS or len(parts) != _TOKEN_PARTS or parts[5] not in (PUBLISHER, SUBSCRIPTION):
            raise ValueError(f"not the token of a publisher or subscription: {token!r}")
        package, _, name = parts[10].removesuffix("_").partition("::msg::dds_::")
        return cls(parts[9].replace("%", "/"), f"{package}/msg/{name}", parts[11])


class NodeName(NamedTuple):
    """A node; `session` is the id of its Zenoh session."""

    domain: int
    session: str
    name: str

    def token(self) -> str:
        """Announces the node while it is alive; its own number is 0."""
        return f"{_TOKENS}/{self.domain}/{self.session}/0/0/{_NODE}/{_NO_NAME}/{_NO_NAME}/{self.name}"

    def endpoint_token(self, number: int, kind: str, topic: Topic, qos: Qos) -> str:
        """Announces a publisher or subscription, the `kind`; its number is unique within the session, from 1."""
        node = f"{_TOKENS}/{self.domain}/{self.session}/0/{number}/{kind}/{_NO_NAME}/{_NO_NAME}/{self.name}"
        return "/".join((node, topic.name.replace("/", "%"), _dds(topic.type_name), topic.type_hash, qos.text()))


class Attachment(NamedTuple):
    """What a publisher attaches to each message."""

    sequence: int  # 1 for the first message
    stamp_ns: int  # when it was published, on the wall clock [ns since 1970]
    source: bytes  # identity of the publisher, 16 bytes

    def to_bytes(self) -> bytes:
        return _ATTACHMENT.pack(self.sequence, self.stamp_ns, _IDENTITY_BYTES, self.source)

    @classmethod
    def from_bytes(cls, data: bytes) -> "Attachment":
        """Raises ValueError if the bytes are not an attachment of rmw_zenoh."""
        try:
            sequence, stamp_ns, length, source = _ATTACHMENT.unpack(data)
        except error as reason:
            raise ValueError(f"an attachment has {_ATTACHMENT.size} bytes, got {len(data)}") from reason
        if length != _IDENTITY_BYTES:
            raise ValueError(f"the identity of a publisher has {_IDENTITY_BYTES} bytes, got {length}")
        return cls(sequence, stamp_ns, source)


def check_domain(domain: int) -> int:
    """Raises ValueError if there is no such domain."""
    if not 0 <= domain <= LARGEST_DOMAIN:
        raise ValueError(f"a ROS domain is 0 to {LARGEST_DOMAIN}, got {domain}")
    return domain


def _check(pattern: re.Pattern[str], rule: str, text: str) -> str:
    """The text; raises ValueError with the rule if ROS, or Zenoh, does not allow it."""
    if not pattern.fullmatch(text):
        raise ValueError(f"{rule}, got {text!r}")
    return text


check_endpoint = partial(_check, _ENDPOINT, "a Zenoh endpoint is like tcp/192.168.1.5:7447")
check_node_name = partial(_check, _NODE_NAME, "the name of a ROS node has letters, digits and underscores only")
check_topic = partial(_check, _TOPIC, "the name of a ROS topic is like /weberlink/target")


def publishers_of(domain: int, name: str) -> str:
    """The key expression of the tokens of all publishers of a topic, whatever their type."""
    return f"{_TOKENS}/{domain}/*/*/*/{PUBLISHER}/*/*/*/{name.replace('/', '%')}/*/*/*"


def _dds(type_name: str) -> str:
    """The name of a type under DDS, which rmw_zenoh has kept."""
    match = _TYPE.fullmatch(type_name)
    if match is None:
        raise ValueError(f"the name of a ROS type is like geometry_msgs/msg/PoseStamped, got {type_name!r}")
    package, name = match.groups()
    return f"{package}::msg::dds_::{name}_"
