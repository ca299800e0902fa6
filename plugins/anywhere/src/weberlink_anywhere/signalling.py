"""What the two ends tell each other to find a path, before there is one: types and errors of the rendezvous."""

import re
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Final

from weberlink_anywhere.peers import Peer

MOST_CANDIDATES: Final = 16
"""Of one path: a host of eight networks has as many, with and without a NAT. Each is probed from all own addresses."""
_CANDIDATE: Final = re.compile(
    r"[\w+/]{1,32} 1 udp [0-9]{1,10} ([0-9a-f.:]{2,45}) ([0-9]{1,5}) typ (?:host|srflx|prflx|relay)"
    r"(?: raddr [0-9a-f.:]{2,45})?(?: rport [0-9]{1,5})?(?: generation [0-9]{1,5})?",
    re.ASCII | re.IGNORECASE,
)


@dataclass(frozen=True)
class Description:
    """How to reach one path's socket of a host (RFC 8839).

    Args:
        username, password: of ICE (ice-ufrag, ice-pwd).
        candidates: as in SDP, without `a=candidate:`.
    """

    username: str
    password: str
    candidates: tuple[str, ...]

    def has(self, *kinds: str) -> bool:
        """Whether there is a candidate of one of these types."""
        return any(f"typ {kind}" in line for line in self.candidates for kind in kinds)

    @property
    def reaches_server(self) -> bool:
        """Whether a server answered this end by UDP."""
        return self.has("srflx", "relay")


def usable(candidates: Iterable[object]) -> tuple[str, ...]:
    """Of what a peer sent, the candidates that name a host to probe; the first `MOST_CANDIDATES` of them."""
    return tuple(each for each in candidates if isinstance(each, str) and _names_host(each))[:MOST_CANDIDATES]


def _names_host(candidate: str) -> bool:
    """Whether it is a numeric address of one host, and not of this one, nor of a group."""
    found = _CANDIDATE.fullmatch(candidate)
    if found is None or not 0 < int(found[2]) < 1 << 16:
        return False
    try:
        address = ip_address(found[1])
    except ValueError:
        return False
    address = getattr(address, "ipv4_mapped", None) or address
    is_special = address.is_loopback or address.is_multicast or address.is_unspecified or address.is_reserved
    return not is_special


@dataclass(frozen=True)
class Offer:
    """A master calls, by a random `attempt`; with one description for each of several paths.

    With `take_over`, it replaces a master that the slave serves.
    """

    attempt: bytes
    paths: tuple[Description, ...]
    take_over: bool = False


@dataclass(frozen=True)
class Answer:
    """A slave takes the call; one description for each path."""

    paths: tuple[Description, ...]


@dataclass(frozen=True)
class Busy:
    """A slave serves another master, of this name."""

    serves: str


@dataclass(frozen=True)
class Presence:
    """Whether a peer waits to be called.

    Args:
        here: it answered.
        serves: name of the master that it serves now; None for nobody.
        note: why it is not known, in one line; "" if it is known.
    """

    here: bool
    serves: str | None = None
    note: str = ""


Handler = Callable[[Peer, Offer], Awaitable[Answer | Busy]]
Note = Callable[[str], None]
"""Takes one line for a person."""


class SignallingError(Exception):
    """A call came to nothing; the message is one line for a person."""


class PeerAbsent(SignallingError):  # noqa: N818 - the condition is the name
    """The mailbox server is reached, and the peer does not answer."""


class MailboxUnreachable(SignallingError):  # noqa: N818
    """The mailbox server is not reached, or refuses."""
