"""Types of ROS 2 messages: their hash, and their bytes (plain CDR)."""

from functools import cache
from typing import Any

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from weberlink_figures.message import ENCAPSULATION


@cache
def types() -> Typestore:
    """The message types of ROS 2 Jazzy; those that are used here are the same in Humble, Kilted and Rolling."""
    return get_typestore(Stores.ROS2_JAZZY)


def type_hash(type_name: str) -> str:
    """The hash of a type (RIHS01, REP-2016), for example of "geometry_msgs/msg/PoseStamped"; raises ValueError if ROS 2
    Jazzy has no such type.
    """
    try:
        return str(types().hash_rihs01(type_name))
    except KeyError as error:
        raise ValueError(f"ROS 2 has no message type {type_name}") from error


def encode_body(message: Any, type_name: str) -> bytes:
    """The body of a message of `types`, little endian, without the encapsulation header."""
    return bytes(types().serialize_cdr(message, type_name))[len(ENCAPSULATION) :]


def decode(cdr: bytes, type_name: str) -> Any:
    """A received message, with its encapsulation header and of either byte order, with the fields of its type; raises
    ValueError if the bytes are no such message.
    """
    try:
        return types().deserialize_cdr(cdr, type_name)
    except Exception as error:  # rosbags names no errors: what comes depends on the bytes
        raise ValueError(f"{len(cdr)} bytes are no {type_name}: {error}") from error
