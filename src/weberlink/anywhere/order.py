"""What a daemon asks of the process that finds paths, and how it starts it."""

import json
import subprocess
from dataclasses import asdict, dataclass
from socket import socket
from typing import Any

from weberlink.child_process import python
from weberlink.protocol.aio import hand_over


@dataclass(frozen=True)
class FinderOrder:
    """What to find.

    Args:
        side: "master" calls, "slave" waits to be called.
        peers: labels of the known peers: the one to call, or those to wait for. Keys are read from the store.
        store: folder of the known peers.
        mailbox: URL of the mailbox server.
        stun: host:port; None for none.
        turn: host:port; None for none.
        turn_name: what people call the relay.
        turn_secret_file, turn_credentials_file: one of them with `turn`.
        paths: how many, over different interfaces.
        interfaces: those to use, in order; empty for all.
        dscp: class of service of every datagram.
        take_over: whether to replace a master that the slave serves.
    """

    side: str
    peers: tuple[str, ...]
    store: str
    mailbox: str
    stun: str | None = None
    turn: str | None = None
    turn_name: str = ""
    turn_secret_file: str | None = None
    turn_credentials_file: str | None = None
    paths: int = 1
    interfaces: tuple[str, ...] = ()
    dscp: int = 46
    take_over: bool = False

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "FinderOrder":
        values: dict[str, Any] = json.loads(text)
        return cls(**{**values, "peers": tuple(values["peers"]), "interfaces": tuple(values["interfaces"])})


def start_finder(order: FinderOrder) -> tuple[subprocess.Popen[bytes], socket]:
    """Start the process; it ends when the socket to it is closed.

    Returns:
        The process, and the daemon's end of the socket (`weberlink.protocol.aio.hand_over`), which does not block.
    """
    ours, theirs = hand_over.pair()
    with theirs:
        process = subprocess.Popen(  # noqa: S603
            python("-m", "weberlink.anywhere.finder", order.to_json(), str(theirs.fileno())),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            pass_fds=[theirs.fileno()],
            start_new_session=True,
        )
    ours.setblocking(False)
    return process, ours
