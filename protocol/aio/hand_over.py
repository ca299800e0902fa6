"""What the process that finds paths and the daemon that uses them tell each other, on a Unix socket of whole messages.

The finder runs ICE on sockets of its own. When a path is found, it hands the socket to the daemon and stops reading it.
From then on the daemon reads it, and returns STUN messages to the finder, which goes on answering and asking on the
same socket. So the datagrams of a session take no way through a second process.
"""

import socket
from contextlib import suppress
from typing import Any, NamedTuple

import msgpack

from weberlink.protocol.events import Address

LONGEST_MESSAGE = 4096
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
        place: which of `link.paths` it is, from 0; it replaces the former path of this place to the same peer.
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
    """Finder to daemon: one line for a person; `is_final` if no path will be found."""

    peer: str
    text: str
    is_final: bool = False


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
_KINDS: tuple[type[Any], ...] = (PathFound, PathLost, PathNews, StunReceived, SessionState, PathSilent)


class PathFacts(NamedTuple):
    """A path in use, in words, for people: the page, the report, the metrics.

    Args:
        place: which of `link.paths` it is.
        route: "direct", "punched", "relayed", or "" while there is none.
        via: name of the relay, or "".
        interface: network interface of this host, or "".
        remote: address of the peer or of the relay, host:port.
        changes: how often this path was replaced by another one.
        note: what is being done while there is no path, or why there will be none.
        dscp: class of service with which datagrams of the peer arrive (RFC 2474); None while unknown.
    """

    place: int = 0
    route: str = "direct"
    via: str = ""
    interface: str = ""
    remote: str = ""
    changes: int = 0
    note: str = ""
    dscp: int | None = None


def address_of(name: str) -> Address:
    """The address of a peer on whatever paths are found to it; names it in an endpoint."""
    return name, 0


def pair() -> tuple[socket.socket, socket.socket]:
    """Both ends of the Unix socket."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def send(end: socket.socket, message: Message, carried: socket.socket | None = None) -> bool:
    """Send a message, with a socket that it hands over; False if the other end is gone or its buffer full."""
    data = msgpack.packb([_KINDS.index(type(message)), *message])
    with suppress(OSError):
        socket.send_fds(end, [data], [] if carried is None else [carried.fileno()])
        return True
    return False


def receive(end: socket.socket) -> tuple[Message, socket.socket | None] | None:
    """Take the next message, and the socket with it; None when the other end is closed.

    Raises:
        BlockingIOError: there is none now.
    """
    data, descriptors, _, _ = socket.recv_fds(end, LONGEST_MESSAGE, 1)
    if not data:
        return None
    kind, *values = msgpack.unpackb(data, use_list=False)
    carried = socket.socket(fileno=descriptors[0]) if descriptors else None
    return _KINDS[kind](*values), carried
