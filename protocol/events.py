"""What an endpoint tells its owner. Plain values; knows nothing of how they come about."""

from collections.abc import Mapping
from typing import NamedTuple

from protocol.reasons import DropReason

Address = tuple[str, int]
"""Host and UDP port."""


class Connected(NamedTuple):
    """A new session has begun; whatever was held of an older one (codec states) is void."""

    address: Address
    agreement: Mapping[str, object]


class UpdateReceived(NamedTuple):
    """The newest update of a stream of the peer.

    Args:
        tick: sample tick on the peer's tick clock.
        selector: 0..15, not interpreted here.
        newest: int16 levels of the sample.
        gap: ticks between the two samples; 0 when there is no previous one.
        previous: int16 levels of the sample before, or ().
        age: time since the datagram left the peer, by the mapped clock [s].
        stream: which it belongs to, from 0.
    """

    tick: int
    selector: int
    newest: tuple[int, ...]
    gap: int
    previous: tuple[int, ...]
    age: float
    stream: int = 0


class PeerSilent(NamedTuple):
    """Nothing fresh was heard from the peer for longer than the silence limit."""

    is_heard: bool


class PeerReturned(NamedTuple):
    """The peer was heard again in the session that had fallen silent; codec states still hold."""


class TakenOver(NamedTuple):
    """The slave serves another master from now on, which asked for that; final for this one."""

    name: str


class UpdateLost(NamedTuple):
    """Our newest update of a stream has not arrived within the silence limit; the owner should send a new state."""

    stream: int


class SessionExpired(NamedTuple):
    """The session was silent for so long that it is over."""


class PeerClosed(NamedTuple):
    """The peer has left, and said why."""

    reason: str


class Refused(NamedTuple):
    """The two ends do not agree; `message` names each key and both values."""

    message: str


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
        why_not: None if it makes the change.
    """

    tick: int
    body: bytes
    why_not: str | None


class DatagramDropped(NamedTuple):
    """A received datagram was of no use."""

    reason: DropReason


Event = (
    Connected
    | UpdateReceived
    | PeerSilent
    | PeerReturned
    | SessionExpired
    | UpdateLost
    | TakenOver
    | PeerClosed
    | Refused
    | ChangeProposed
    | ChangeAnswered
    | DatagramDropped
)
