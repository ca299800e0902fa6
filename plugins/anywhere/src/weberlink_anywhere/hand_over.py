"""What the process that finds paths and the daemon that uses them tell each other, on a Unix socket of whole messages.

The finder runs ICE on sockets of its own. When a path is found, it hands the socket to the daemon and stops reading it.
From then on the daemon reads it, and returns STUN messages to the finder, which goes on answering and asking on the
same socket. So the datagrams of a session take no way through a second process.
"""

import os
import socket
from collections.abc import Callable
from contextlib import ExitStack, suppress
from ipaddress import ip_address
from typing import Any, NamedTuple

import msgpack

from weberlink.protocol.events import Address
from weberlink.text import one_line

LONGEST_MESSAGE = 4096
LONGEST_TEXT = 500
"""Characters of each text in a message, all of them printable."""
STUN_COOKIE = b"\x21\x12\xa4\x42"
"""Bytes 4 to 7 of every STUN message (RFC 8489 section 5)."""
ENGAGED, SILENT, GONE = "engaged", "silent", "gone"
"""States of the session with a peer, as the daemon tells the finder."""


def is_stun(data: bytes) -> bool:
    """Whether a datagram is a STUN message: by its first byte (RFC 7983), and by its cookie.

    Every value of the first byte is also one of our datagrams', so the cookie decides: a datagram of a session has its
    four bytes with probability 2^-32, and is then lost like any other.
    """
    return data[:1] <= b"\x03" and data[4:8] == STUN_COOKIE


class PathFound(NamedTuple):
    """Finder to daemon, with the descriptor of a bound socket: a path that ICE has validated.

    Args:
        number: of this path, unique in the life of the finder.
        place: which of several it is, from 0; it replaces the former path of this place to the same peer.
        peer: name of the peer on the wire.
        remote: where to send to.
        channel: TURN channel (RFC 8656 section 12) in which to wrap what is sent to `remote`, the relay; None without.
        route: "direct", "punched" or "relayed".
        via: name of the relay, or "".
        interface: network interface of this host, or "".
    """

    number: int
    place: int
    peer: str
    remote: Address
    channel: int | None = None
    route: str = "direct"
    via: str = ""
    interface: str = ""


class PathLost(NamedTuple):
    """Finder to daemon: close this path."""

    number: int


class PathNews(NamedTuple):
    """Finder to daemon: one line for a person, of printable characters; `is_final` if no path will be found."""

    peer: str
    text: str
    is_final: bool = False

    @classmethod
    def of(cls, peer: str, text: str, is_final: bool) -> "PathNews":
        """News of any text."""
        return cls(peer, one_line(text, LONGEST_TEXT), is_final)


class StunReceived(NamedTuple):
    """Daemon to finder: a STUN message, with the header of its TURN channel if it has one."""

    number: int
    source: Address
    data: bytes


class PathSilent(NamedTuple):
    """Daemon to finder: nothing comes on this path, while its peer is heard on another one."""

    number: int


class SessionState(NamedTuple):
    """Daemon to finder: how the session with a peer is now (`ENGAGED`, `SILENT` or `GONE`)."""

    peer: str
    state: str


Message = PathFound | PathLost | PathNews | StunReceived | SessionState | PathSilent


def _is_address(value: object) -> bool:
    """Whether a value is a numeric address: a name would be resolved where it is used, which blocks."""
    if not isinstance(value, tuple) or len(value) != 2 or not isinstance(value[0], str):
        return False
    try:
        ip_address(value[0])
    except ValueError:
        return False
    return _CHECKS["port"](value[1])


_CHECKS: dict[str, Callable[[Any], bool]] = {
    "number": lambda value: isinstance(value, int) and 0 <= value < 1 << 32,
    "port": lambda value: isinstance(value, int) and 0 <= value < 1 << 16,
    "channel": lambda value: value is None or _CHECKS["port"](value),
    "text": lambda value: isinstance(value, str) and len(value) <= LONGEST_TEXT and value.isprintable(),
    "flag": lambda value: isinstance(value, bool),
    "data": lambda value: isinstance(value, bytes),
    "address": _is_address,
}
_FIELDS: tuple[tuple[type[Any], str], ...] = (
    (PathFound, "number number text address channel text text text"),
    (PathLost, "number"),
    (PathNews, "text text flag"),
    (StunReceived, "number address data"),
    (SessionState, "text text"),
    (PathSilent, "number"),
)
"""Each kind of message, by the number that stands for it, and what its fields may be."""
_KINDS = [kind for kind, _ in _FIELDS]


def send(end: socket.socket, message: Message, carried: socket.socket | None = None) -> bool:
    """Send a message, with a socket that it hands over; False if the other end is gone or its buffer full.

    Raises:
        ValueError: `receive` would refuse the message.
    """
    number = _KINDS.index(type(message))
    data = msgpack.packb([number, *message])
    if not _fits(_FIELDS[number][1], message) or len(data) > LONGEST_MESSAGE:
        raise ValueError(f"a {type(message).__name__} of {len(data)} bytes that does not fit")
    with suppress(OSError):
        socket.send_fds(end, [data], [] if carried is None else [carried.fileno()])
        return True
    return False


def receive(end: socket.socket) -> tuple[Message, socket.socket | None] | None:
    """Take the next message, and the socket with it; None when the other end is closed.

    Raises:
        BlockingIOError: there is none now.
        ValueError: what arrived is no message; it is gone.
    """
    data, descriptors, flags, _ = socket.recv_fds(end, LONGEST_MESSAGE, 1)
    with ExitStack() as refused:
        for descriptor in descriptors:
            refused.callback(os.close, descriptor)
        if not data:
            return None
        message = _read(data, is_whole=not flags & socket.MSG_TRUNC)
        if not isinstance(message, PathFound):
            return message, None
        carried = _udp_socket(descriptors)
        refused.pop_all()
        return message, carried


def _read(data: bytes, *, is_whole: bool) -> Message:
    found = msgpack.unpackb(data, use_list=False) if is_whole else None
    if not isinstance(found, tuple) or not found or not isinstance(found[0], int) or not 0 <= found[0] < len(_FIELDS):
        raise ValueError("a message of no known kind")
    kind, fields = _FIELDS[found[0]]
    if not _fits(fields, found[1:]):
        raise ValueError(f"no {kind.__name__}")
    message: Message = kind(*found[1:])
    return message


def _fits(fields: str, values: tuple[Any, ...]) -> bool:
    checks = [_CHECKS[name] for name in fields.split()]
    return len(values) == len(checks) and all(check(value) for check, value in zip(checks, values, strict=True))


def _udp_socket(descriptors: list[int]) -> socket.socket:
    """The socket that was handed over; a descriptor that is refused stays open."""
    if not descriptors:
        raise ValueError("a path without a socket")
    try:
        carried = socket.socket(fileno=descriptors[0])
    except OSError:
        raise ValueError("a descriptor of no socket") from None
    if carried.family not in (socket.AF_INET, socket.AF_INET6) or carried.type != socket.SOCK_DGRAM:
        carried.detach()
        raise ValueError("not a UDP socket")
    return carried
