"""What a daemon asks of the process that finds paths, and a command of the process that pairs two hosts."""

from collections.abc import Mapping
from dataclasses import dataclass

from weberlink.child_process import Order


@dataclass(frozen=True)
class FinderOrder(Order):
    """What to find.

    Args:
        side: "master" calls, "slave" waits to be called.
        peers: label of the known peer to call, or to wait for; a slave waits for all masters without any. Keys are read
            from the store.
        store: folder of the known peers.
        own: name of this host towards the peers, and towards the relay.
        mailbox, stun, turn, paths, interfaces: as in the file (`AnywhereOptions`).
        dscp: class of service of every datagram.
        take_over: whether to replace a master that the slave serves.
        stream: what the paths are for beside the session; those of each are called for in a mailbox of its own.
    """

    side: str
    peers: tuple[str, ...]
    store: str
    own: str
    mailbox: str
    stun: str | None = None
    turn: Mapping[str, str | None] | None = None
    paths: int = 1
    interfaces: tuple[str, ...] = ()
    dscp: int = 46
    take_over: bool = False
    stream: str = ""


@dataclass(frozen=True)
class PairingOrder(Order):
    """Whom to pair with.

    The process reads the order from its standard input, and ends when that is closed. It writes one JSON object per
    line: `code`, which it made, to be shown; `note`, for the user; `words`, which both hosts show; at last `paired`,
    the label of the new peer, or `refused`, why there is none. After `asks`, the name of the operator's host, the
    process of the robot's host waits for a line `yes` or `no`.

    Args:
        side: of this host, "master" or "slave".
        name: of this host.
        store: folder of the known peers.
        mailbox: URL of the mailbox server.
        code: that the other host shows; "" to make one.
        label: what to call the peer; "" for its own name.
        accept: whether the slave keeps the key without asking.
        right: what the slave lets the key be good for.
        lifetime_s: how long a code that is made here waits for the other host.
        consent_s: how long the person at the slave may take to compare the words.
        patience_s: how long the mailbox, or a host that is there, may take for an answer.
    """

    side: str
    name: str
    store: str
    mailbox: str
    code: str = ""
    label: str = ""
    accept: bool = False
    right: str = "drive"
    lifetime_s: float = 600.0
    consent_s: float = 120.0
    patience_s: float = 20.0
