"""What a daemon asks of the process that finds paths."""

from dataclasses import dataclass

from weberlink.child_process import Order


@dataclass(frozen=True)
class FinderOrder(Order):
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
