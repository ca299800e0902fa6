"""Events that an endpoint reports to its owner, the reasons for which it drops datagrams, and its counters."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from weberlink.update import Update

Address = tuple[str, int]  # host and UDP port


class DropReason(StrEnum):
    """Why a datagram was dropped, as counters, events and tests name it. None of them ends a session."""

    TRUNCATED = "truncated"  # shorter than any can be
    WRONG_LENGTH = "wrong_length"  # longer than any can be
    FOREIGN_ADDRESS = "foreign_address"  # not from the peer that the initiator calls
    UNEXPECTED = "unexpected"  # a handshake datagram that this role does not accept, or not in this state
    UNPROVEN = "unproven"  # a handshake datagram whose sender did not prove the key, or that was damaged on the way
    OVERLOADED = "overloaded"  # a call before the next key exchange is allowed; the caller repeats it
    REFUSED = "refused"  # a call of a master that gets no session, and was told why
    MALFORMED = "malformed"  # authentic, but the content does not fit its layout
    NO_SESSION = "no_session"  # a session datagram while there is no session
    WRONG_SESSION = "wrong_session"  # authentic under the keys of the previous session
    BAD_TAG = "bad_tag"  # forged, damaged, or of an unknown session
    # Received before, or too old to tell. A call: its stamp is not above the newest one that its sender has proven.
    REPLAYED = "replayed"
    IMPLAUSIBLE = "implausible"  # authentic, but its time stamp, clock report or tick cannot be true
    UNTIMED = "untimed"  # an update that arrived before the clocks were mapped, so that its age is unknown
    STALE = "stale"  # older on arrival than what counts (`Liveness`)
    SUPERSEDED = "superseded"  # an update older than one that was already delivered
    UNREADABLE = "unreadable"  # not of the peer: no message, on the socket to the process that finds paths


class Connected(NamedTuple):
    """A new session has begun; codec states of an older one are invalid. All events that follow are of this session."""

    address: Address
    agreement: Mapping[str, object]


class UpdateReceived(NamedTuple):
    """The newest update of a stream of the peer, whose tick is on the peer's tick clock; `age` is the time since the
    datagram left the peer, by the mapped clock [s]; streams count from 0."""

    update: Update
    age: float
    stream: int = 0


class UpdateLost(NamedTuple):
    """The peer does not hold our newest update of a stream: it asked for the full state, or the update has not arrived
    within the largest loop age. The owner should send a new state."""

    stream: int


class PeerSilent(NamedTuple):
    """One of the limits of `Liveness` was passed: the two ends do not hear each other.

    If `is_heard`, it is the peer that does not hear this end; a second event with false follows if the peer falls
    silent as well."""

    is_heard: bool


class PeerReturned(NamedTuple):
    """The two ends hear each other again in the same session; both should send a new state."""


class SessionExpired(NamedTuple):
    """The session has ended after seconds of silence; another one may follow."""


class PeerClosed(NamedTuple):
    """The peer has left, and said why."""

    reason: str


class TakenOver(NamedTuple):
    """Another master, of that name, has taken over the slave; final for this one."""

    name: str


class Refused(NamedTuple):
    """The two ends do not agree; `message` names each key and both values. Final for an initiator; a responder reports
    it only while it has no session, and goes on listening."""

    message: str


class StopAsked(NamedTuple):
    """The end of this name, whose key allows it, asks to stop. The owner stops, then closes the endpoint, which answers
    that it is done."""

    name: str


class Told(NamedTuple):
    """To an initiator that does not ask to drive: what the responder has answered, texts and numbers; final."""

    body: Mapping[str, object]


class PathProbe(NamedTuple):
    """The peer asks whether this end is at the address that received the datagram, or answers such a question; handled
    by the endpoint itself."""

    token: bytes
    is_answer: bool


class ChangeProposed(NamedTuple):
    """The peer proposes a change at a tick of its own; the owner must call `Endpoint.answer_change` with this event."""

    tick: int
    body: bytes


class ChangeAnswered(NamedTuple):
    """The peer has answered our proposal; `refusal` is None if it makes the change, else why it does not."""

    tick: int
    body: bytes
    refusal: str | None


class DatagramDropped(NamedTuple):
    """A received datagram was dropped."""

    reason: DropReason


Event = (
    Connected | UpdateReceived | UpdateLost | PeerSilent | PeerReturned | SessionExpired | PeerClosed | TakenOver
    | Refused | StopAsked | Told | ChangeProposed | ChangeAnswered | DatagramDropped
)  # fmt: skip


@dataclass(slots=True)
class Statistics:
    """Cumulative counters over all sessions of an endpoint, and the current measurements of the link.

    `sent` and `bytes_sent` count every datagram (UDP payload); `received` counts authentic ones. An update that was
    sent again counts under `repeats`, not under `updates_sent`."""

    sent: int = 0
    bytes_sent: int = 0
    received: int = 0
    updates_sent: list[int] = field(default_factory=lambda: [0, 0])  # by stream
    updates_received: list[int] = field(default_factory=lambda: [0, 0])  # by stream
    repeats: int = 0
    heartbeats: int = 0
    lost: int = 0  # datagrams of the peer that never came, from gaps in its sequence numbers
    copies: int = 0  # of the peer's, come by another of several paths already; neither received nor dropped
    overflowed: int = 0  # datagrams of ours that the owner did not fetch in time
    dropped: Counter[DropReason] = field(default_factory=Counter)  # datagrams received and dropped, by reason
    drops: int = 0  # their sum
    rtt: float | None = None  # round trip of the newest datagrams of the two directions [s]
    one_way: float | None = None  # delay of the newest datagram of the peer [s]
    incoming_loss: float = 0.0  # recent loss of the peer's datagrams, 0..1
    outgoing_loss: float = 0.0  # recent loss of our datagrams, as the peer measured it, 0..1
    incoming_burst: float = 0.0  # mean length of its recent runs of lost ones; 0 while fewer than three are known
    outgoing_burst: float = 0.0  # the same of our datagrams, as the peer measured it
