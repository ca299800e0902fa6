"""Whom a side knows, from the file and the store of peers: names and keys, and the order to find a path to them."""

from typing import NamedTuple

from weberlink.anywhere.order import FinderOrder
from weberlink.anywhere.peers import Peer, PeerError, PeerStore
from weberlink.protocol.keyring import Keyring
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Security
from weberlink.realtime.process import forbid_core_dumps
from weberlink.system.configuration import MASTER, SLAVE, Configuration, ConfigurationError
from weberlink.system.configuration.extras import need
from weberlink.system.configuration.model import split_address

FINDER_PACKAGES = ("aioice", "websockets")


class Acquaintance(NamedTuple):
    """The peers of a side.

    Args:
        security: the suite with their keys.
        own: name of this side towards them.
        peers: the one that a master calls, or those for which a slave waits.
    """

    security: Security
    own: str
    peers: tuple[Peer, ...]

    @property
    def expects(self) -> str:
        """Name of the only peer; "" for several."""
        return self.peers[0].name if len(self.peers) == 1 else ""


def acquaintance(configuration: Configuration, side: str) -> Acquaintance:
    """The peers that the file asks for. As there are keys, no core is dumped any more.

    Raises:
        ConfigurationError: there is none, or a master has several to choose from, or they know this side by different
            names.
    """
    forbid_core_dumps()
    link = configuration.system.link
    store = PeerStore(link.peer_store)
    other = SLAVE if side == MASTER else MASTER
    try:
        peers = tuple(peer for peer in store if peer.role == other and link.peer in (None, peer.label))
        if link.peer is not None and not peers:
            found = store.find(link.peer)
            raise ConfigurationError(f"link.peer: {found.label} is a {found.role}, and so is this side")
    except PeerError as error:
        raise ConfigurationError(f"link.peer: {error}") from None
    if not peers:
        raise ConfigurationError(f"link.security: peers: no {other} is known; pair with --invite and --join")
    labels = ", ".join(peer.label for peer in peers)
    if side == MASTER and len(peers) > 1:
        raise ConfigurationError(f"link.peer: several robots are known, say which: {labels}")
    names = {peer.own for peer in peers}
    if len(names) > 1:
        raise ConfigurationError(
            f"link.peer: {labels} know this host by different names: {', '.join(sorted(names))}; say which peer"
        )
    security: Security = (
        PresharedKey(peers[0].key) if side == MASTER else Keyring({peer.name: peer.key for peer in peers})
    )
    return Acquaintance(security, names.pop(), peers)


def finder_order(configuration: Configuration, side: str, peers: tuple[Peer, ...], *, take_over: bool) -> FinderOrder:
    """What the process that finds paths is to do for a side.

    Raises:
        ConfigurationError: a package that it needs is not installed.
    """
    for package in FINDER_PACKAGES:
        need(package, "anywhere", "link.path: ice")
    link = configuration.system.link
    turn = link.turn
    return FinderOrder(
        side=side,
        peers=tuple(peer.label for peer in peers),
        store=str(PeerStore(link.peer_store).folder),
        mailbox=link.mailbox or "",
        stun=link.stun,
        turn=None if turn is None else turn.server,
        turn_name="" if turn is None else turn.name or split_address(turn.server)[0],
        turn_secret_file=None if turn is None or turn.secret_file is None else str(turn.secret_file),
        turn_credentials_file=None if turn is None or turn.credentials_file is None else str(turn.credentials_file),
        paths=link.paths,
        interfaces=link.interfaces,
        dscp=link.dscp,
        take_over=take_over,
    )
