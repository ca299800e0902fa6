"""Datagram session between the two ends of a teleoperation link, sans I/O; `weberlink.protocol.aio` is the shell.

The core is pure: sockets, clocks and randomness are passed in. The suite with a key,
`weberlink.protocol.psk`, is imported where it is chosen.
"""

from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import (
    Address,
    ChangeAnswered,
    ChangeProposed,
    Connected,
    DatagramDropped,
    DropReason,
    Event,
    PeerClosed,
    PeerReturned,
    PeerSilent,
    Refused,
    SessionExpired,
    Statistics,
    StopAsked,
    TakenOver,
    Told,
    UpdateLost,
    UpdateReceived,
)
from weberlink.protocol.keys import Right
from weberlink.protocol.local_end import LocalEnd
from weberlink.protocol.states import Role, State, StateError

__all__ = [
    "Address", "ChangeAnswered", "ChangeProposed", "Connected", "DatagramDropped", "DropReason", "Endpoint", "Event",
    "LocalEnd", "PeerClosed", "PeerReturned", "PeerSilent", "Refused", "Right", "Role", "SessionExpired", "State",
    "StateError", "Statistics", "StopAsked", "TakenOver", "Told", "UpdateLost", "UpdateReceived",
]  # fmt: skip
