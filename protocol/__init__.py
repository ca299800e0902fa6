"""Datagram session between the two ends of a teleoperation link: sans-I/O core, and a thin shell in `protocol.aio`.

Pure but for that shell: no socket, no clock, no randomness of its own. It carries integers and knows no codec. Security
suites are imported where they are chosen: `weberlink.protocol.psk` or `weberlink.protocol.checksum`.
"""

from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import (
    Address,
    ChangeAnswered,
    ChangeProposed,
    Connected,
    DatagramDropped,
    Event,
    PeerClosed,
    PeerReturned,
    PeerSilent,
    Refused,
    SessionExpired,
    TakenOver,
    UpdateLost,
    UpdateReceived,
)
from weberlink.protocol.reasons import DropReason
from weberlink.protocol.roles import Role
from weberlink.protocol.states import State, StateError
from weberlink.protocol.statistics import Statistics

__all__ = [
    "Address",
    "ChangeAnswered",
    "ChangeProposed",
    "Connected",
    "DatagramDropped",
    "DropReason",
    "Endpoint",
    "Event",
    "PeerClosed",
    "PeerReturned",
    "PeerSilent",
    "Refused",
    "Role",
    "SessionExpired",
    "State",
    "StateError",
    "Statistics",
    "TakenOver",
    "UpdateLost",
    "UpdateReceived",
]
