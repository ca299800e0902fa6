"""Whom a side meets: the known peers that its file asks for, their keys, and the process that finds paths to them."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from socket import socket
from typing import Any

from weberlink.config import MASTER, SLAVE, Configuration, ConfigurationError
from weberlink.protocol.aio.udp import MakePaths
from weberlink.protocol.keys import HeldKey
from weberlink.protocol.psk import Keyring, PresharedKey
from weberlink.protocol.security import Security
from weberlink_anywhere.options import AnywhereOptions
from weberlink_anywhere.order import FinderOrder
from weberlink_anywhere.peers import Peer, PeerError, PeerStore


class Anywhere:
    """The path finder `anywhere` (`weberlink.config.finders.PathFinder`).

    Attributes:
        peers: the one that a master calls, or those for which a slave waits.
    """

    Options = AnywhereOptions

    def __init__(self, options: AnywhereOptions, configuration: Configuration, side: str) -> None:
        """Raises ConfigurationError: no peer is known, or a master has several to choose from, or they know this side
        by different names."""
        self._options, self._side, self._dscp = options, side, configuration.system.link.dscp
        self._store = PeerStore(options.peer_store)
        self.peers = self._asked()
        names = {peer.own for peer in self.peers}
        labels = ", ".join(peer.label for peer in self.peers)
        if side == MASTER and len(self.peers) > 1:
            raise ConfigurationError(f"link.finder.peer: several robots are known, say which: {labels}")
        if len(names) > 1:
            raise ConfigurationError(
                f"link.finder.peer: {labels} know this host by different names: {', '.join(sorted(names))}; "
                "say which peer"
            )
        self.own = names.pop()
        self.expects = self.peers[0].name if side == MASTER else ""  # a slave may come to know others
        self.security: Security = (
            PresharedKey(self.peers[0].key) if side == MASTER else Keyring(peer.held_key for peer in self.peers)
        )

    def _asked(self) -> tuple[Peer, ...]:
        """The peers of the other side that the file asks for, one at least."""
        other, label = SLAVE if self._side == MASTER else MASTER, self._options.peer
        try:
            peers = tuple(peer for peer in self._store if self._is_asked(peer))
            if label is not None and not peers:
                found = self._store.find(label)
                raise ConfigurationError(f"link.finder.peer: {found.label} is a {found.role}, and so is this side")
        except PeerError as error:
            raise ConfigurationError(f"link.finder.peer: {error}") from None
        if not peers:
            raise ConfigurationError(f"link.finder: no {other} is known; pair with --invite and --join")
        return peers

    def stored_keys(self) -> tuple[Path, Callable[[], Sequence[HeldKey]]]:
        return self._store.folder, lambda: [peer.held_key for peer in self._store.usable() if self._is_asked(peer)]

    def _is_asked(self, peer: Peer) -> bool:
        return peer.role != self._side and self._options.peer in (None, peer.label)

    def order(self, *, take_over: bool, stream: str = "") -> FinderOrder:
        """What the process that finds paths is to do."""
        asked_for = self._options.peer
        asked = self._options.model_dump(mode="json", exclude={"peer", "peer_store", "path"})
        peers = () if self._side == SLAVE and asked_for is None else tuple(peer.label for peer in self.peers)
        asked |= {"mailbox": asked["mailbox"] or "", "interfaces": self._options.interfaces}
        asked |= {"store": str(self._store.folder), "own": self.own, "dscp": self._dscp, "take_over": take_over}
        return FinderOrder(self._side, peers, stream=stream, **asked)

    def process(self, *, take_over: bool, stream: str = "") -> Sequence[str]:
        return "weberlink_anywhere.finder", self.order(take_over=take_over, stream=stream).to_json()

    def paths(self, end: socket) -> MakePaths:
        from weberlink_anywhere.found_paths import FoundPaths  # noqa: PLC0415 - for daemons alone

        return partial(FoundPaths, finder=end)

    @staticmethod
    def finds_path(options: AnywhereOptions) -> bool:
        return options.path == "ice"

    @staticmethod
    def pair(
        configuration: Configuration, side: str, code: str, label: str | None, *, accept: bool, right: str = "drive"
    ) -> str:
        from weberlink_anywhere.pair import pair  # noqa: PLC0415 - for two options of the command line

        return pair(configuration, side, code, label, accept=accept, right=right)

    @staticmethod
    def examine(options: AnywhereOptions) -> tuple[Any, Sequence[Any]]:
        from weberlink_anywhere.doctor import examine  # noqa: PLC0415 - for one command

        return examine(options)
