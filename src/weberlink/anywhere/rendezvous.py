"""Meeting a known peer at the mailbox server: a master calls, a slave waits to be called."""

from collections.abc import Sequence

from weberlink.anywhere.peers import Peer
from weberlink.anywhere.signalling import Answer, Busy, Description, Handler, Note, Presence


class Caller:
    """A master's way to one slave.

    Args:
        peer: the slave.
        mailbox: URL of the mailbox server.
    """

    def __init__(self, peer: Peer, mailbox: str) -> None:
        raise NotImplementedError

    async def call(self, paths: Sequence[Description], take_over: bool, timeout: float) -> Answer | Busy:  # noqa: ASYNC109
        """Offer paths, and wait for the answer; may be called again, also while the session lives.

        Raises:
            PeerAbsent: no answer within `timeout` s.
            MailboxUnreachable: the server was not reached within `timeout` s, or refuses.
        """
        raise NotImplementedError


class Waiter:
    """A slave that waits for the masters that it knows.

    Args:
        peers: the masters.
        mailbox: URL of the mailbox server.
        note: takes what happens to the mailbox server, one line each.
    """

    def __init__(self, peers: Sequence[Peer], mailbox: str, note: Note) -> None:
        self.serves: str | None = None
        """Name of the master that is served now, as told to those who ask; set by the owner."""

    async def serve(self, handler: Handler) -> None:
        """Answer every offer by `handler`, until cancelled; survives outages of the server.

        A newer offer of the same peer cancels the handler of the older one.
        """
        raise NotImplementedError

    def renew(self) -> None:
        """Connect to the server anew, since the addresses of this host changed."""
        raise NotImplementedError


async def presence(peer: Peer, timeout: float) -> Presence:  # noqa: ASYNC109
    """Ask a slave whether it waits, by the mailbox server of its pairing; never raises, says in `note` what failed."""
    raise NotImplementedError
