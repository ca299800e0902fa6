"""What an endpoint tells its owner. Plain values; knows nothing of how they come about."""

from collections.abc import Mapping
from typing import NamedTuple

from weberlink.protocol.reasons import DropReason
from weberlink.update import Update

Address = tuple[str, int]
"""Host and UDP port."""


class Connected(NamedTuple):
    """A new session has begun; whatever was held of an older one (codec states) is void."""

    address: Address
    agreement: Mapping[str, object]


class UpdateReceived(NamedTuple):
    """The newest update of a stream of the peer.

    Args:
        update: its tick is on the peer's tick clock.
        age: time since the datagram left the peer, by the mapped clock [s].
        stream: which it belongs to, from 0.
    """

    update: Update
    age: float
    stream: int = 0


class UpdateLost(NamedTuple):
    """The peer does not hold our newest update of a stream; the owner should send a new state.

    It has forgotten it, or the update has not arrived within the silence limit.
    """

    stream: int


class PeerSilent(NamedTuple):
    """The loop age has passed the silence limit: the two ends do not hear each other.

    Args:
        is_heard: whether the peer is still heard, so that it is this end that the peer does not hear.
    """

    is_heard: bool


class PeerReturned(NamedTuple):
    """The two ends hear each other again in the session that had fallen silent; both should send a new state."""


class SessionExpired(NamedTuple):
    """The session is over after seconds of silence; another one may follow."""


class PeerClosed(NamedTuple):
    """The peer has left, and said why."""

    reason: str


class TakenOver(NamedTuple):
    """The slave serves another master from now on, which asked for that; final for this one."""

    name: str


class Refused(NamedTuple):
    """The two ends do not agree; `message` names each key and both values.

    Final for an initiator. A responder is told only while it has no session; the call changes nothing there.
    """

    message: str


class PathAsked(NamedTuple):
    """The peer asks whether this end is where the datagram came; for the endpoint itself."""

    token: bytes


class PathAnswered(NamedTuple):
    """The peer is where this came from; for the endpoint itself."""

    token: bytes


class ChangeProposed(NamedTuple):
    """The peer proposes a change; the owner must answer (`Endpoint.answer_change`).

    Args:
        tick: of the peer, at which both are to make it.
        body: what is to change, not interpreted here.
    """

    tick: int
    body: bytes


class ChangeAnswered(NamedTuple):
    """The peer has answered our proposal.

    Args:
        tick: of ours, as proposed.
        body: as proposed.
        refusal: None if it makes the change.
    """

    tick: int
    body: bytes
    refusal: str | None


class DatagramDropped(NamedTuple):
    """A received datagram was of no use."""

    reason: DropReason


Event = (
    Connected
    | UpdateReceived
    | UpdateLost
    | PeerSilent
    | PeerReturned
    | SessionExpired
    | PeerClosed
    | TakenOver
    | Refused
    | ChangeProposed
    | ChangeAnswered
    | DatagramDropped
)
