"""What the two ends tell each other to find a path, before there is one: types and errors of the rendezvous."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from weberlink_anywhere.peers import Peer


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
