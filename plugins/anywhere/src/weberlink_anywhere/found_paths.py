"""The paths that a process finds (`weberlink_anywhere.finder`), and hands over as sockets, under an endpoint."""

import asyncio
import socket
from typing import Final

from weberlink.protocol.aio.sockets import WorkBudget
from weberlink.protocol.aio.udp import PEER_SHARE, STRANGER_SHARE, Path, Paths, UdpShell, peer_address
from weberlink.protocol.events import Address, DropReason
from weberlink.protocol.paths import LinkPath
from weberlink.protocol.states import Role, State
from weberlink_anywhere import hand_over
from weberlink_anywhere.hand_over import PathFound, PathLost, PathNews, PathSilent, SessionState, StunReceived

REPLACED_S: Final = 1.0
"""How long a path goes on carrying copies after it was replaced [s]."""
SILENT_S: Final = 2.0
"""A path on which nothing came for so long, while the peer was heard on another one, is to be found again [s]."""
REMEMBERED: Final = 512
"""Datagrams that are recognized when they come again by another path: those of 0.5 s at 1000/s. A copy that is later
still is dropped by the replay protection of the session."""
LONGEST_STUN: Final = 1500
"""Longest STUN message that is passed on [bytes]; it fits one packet (RFC 8489 section 6.1)."""
STUN_S, STUN_BURST_S = 1e-3, 2e-2
"""What a STUN message may cost the finder at most, and how much may come at once [s of a processor]: with the shares of
a path 300/s of the peer, 50/s of strangers, 20 at once. More would push out what the daemon has to say."""
MOVED_PEERS: Final = 8
"""Addresses outside all paths whose way back is remembered."""
MESSAGES_AT_ONCE: Final = 16
"""Messages of the finder between two looks at anything else."""
FINDER_ENDED: Final = "the process that finds paths has ended"
_HEADER: Final = 4
"""Bytes in front of what a TURN channel carries (RFC 8656 section 12.4)."""
_WORDS = {State.ENGAGED: hand_over.ENGAGED, State.SILENT: hand_over.SILENT}


class FoundPath(Path):
    """A path that the finder told of.

    Attributes:
        address: of the peer in the endpoint.
        channel: of the relay, as on the wire.
        budgets: of STUN messages, from strangers and from the peer.
        missing_since: when the peer was heard on another path first after this one [s]; None if it was not.
    """

    def __init__(
        self, found: PathFound, bound: socket.socket, owner: "FoundPaths", loop: asyncio.AbstractEventLoop
    ) -> None:
        super().__init__(LinkPath(found.place, found.route, found.via, found.interface), bound, owner, loop)
        self.found = found
        self.address = peer_address(found.peer)
        self.channel = b"" if found.channel is None else found.channel.to_bytes(2, "big")
        self.budgets = [WorkBudget(share, STUN_BURST_S, owner.shell.now()) for share in (STRANGER_SHARE, PEER_SHARE)]
        self.is_replaced = False
        self.missing_since: float | None = None
        self.guard(found.remote)

    def send(self, data: bytes) -> None:
        """Send to the peer, through the relay if there is one."""
        if self.remote is not None:
            self.send_to(self.channel + len(data).to_bytes(2, "big") + data if self.channel else data, self.remote)


class FoundPaths(Paths):
    """The paths that another process finds, and hands over as sockets (`hand_over`).

    A peer has one address in the endpoint, whatever paths lead to it. What is sent there goes out on all of them, and
    the endpoint is given the first copy that arrives. A path that another one replaces carries copies for a short while
    longer, because the two ends change at different moments.
    """

    def __init__(self, shell: UdpShell, *, finder: socket.socket) -> None:
        """Prepare. `finder` is the socket to the process, which stays open; `shell.on_no_path` is told once at most, in
        one line, why there will be no session: the finder gave up before the first one, or has ended."""
        endpoint = shell.endpoint
        self._finder = finder
        self._loop: asyncio.AbstractEventLoop | None = None
        self._finds = True
        self._found: tuple[FoundPath, ...] = ()
        self._ways: dict[Address, tuple[FoundPath, ...]] = {}
        self._moved: dict[Address, FoundPath] = {}
        self._arrived: dict[bytes, FoundPath] = {}
        self._changes: dict[tuple[str, int], int] = {}
        """By peer and place, how often its path was another one."""
        self._told = ("", "")
        self._shown = "" if endpoint.peer is None else endpoint.peer[0]
        self._note = "finding a path" if endpoint.role is Role.INITIATOR else ""
        self._is_given_up = False
        self._had_session = False
        super().__init__(shell)

    async def open(self, loop: asyncio.AbstractEventLoop, listen: Address) -> None:  # noqa: ARG002 - the finder listens
        self._loop = loop
        loop.add_reader(self._finder.fileno(), self._on_messages)

    def close(self) -> None:
        """Release the sockets of all paths; that to the finder stays open."""
        self._stop_listening()
        super().close()
        self._keep(())

    # --- the endpoint

    def on_datagram(self, data: bytes, source: Address, now: float, path: Path) -> None:
        """Take what came on a path: a datagram of the session, or a STUN message, which is for the finder."""
        assert isinstance(path, FoundPath)
        is_peer, channel = source == path.remote, path.channel
        if hand_over.is_stun(data) or (channel and hand_over.is_stun(data[_HEADER:])):
            budget = path.budgets[is_peer]
            if len(data) <= LONGEST_STUN and budget.left(now) >= 0.0:
                budget.spend(STUN_S, now)
                self._tell_finder(StunReceived(path.found.number, source, data))
        elif not channel:
            if is_peer:
                self._take_once(data, now, path)
            else:
                self.take_from_elsewhere(data, source, now, path)
        elif is_peer and data[:2] == channel:
            length = int.from_bytes(data[2:_HEADER], "big")
            self._take_once(data[_HEADER : _HEADER + length], now, path)

    def _take_once(self, data: bytes, now: float, path: FoundPath) -> None:
        """Take a datagram of the peer, unless it came on another path before. On the same one it is a replay, which the
        endpoint counts."""
        ways, arrived = self._ways.get(path.address, ()), self._arrived
        if len(ways) > 1:
            self._watch(ways, path, now)
        first = arrived.setdefault(data, path)
        if len(arrived) > REMEMBERED:
            del arrived[next(iter(arrived))]
        if first is path:
            self.endpoint.receive_datagram(data, path.address, now)
        else:
            self.endpoint.statistics.copies += 1

    def _watch(self, ways: tuple[FoundPath, ...], heard: FoundPath, now: float) -> None:
        """Tell the finder of a path on which nothing comes any more; again, while it lasts."""
        for path in ways:
            if path is heard:
                path.missing_since = None
            elif path.missing_since is None:
                path.missing_since = now
            elif now - path.missing_since > SILENT_S:
                path.missing_since = now
                self._tell_finder(PathSilent(path.found.number))

    def take_from_elsewhere(self, data: bytes, source: Address, now: float, path: FoundPath) -> None:
        """Take a datagram that came to the socket of a path from outside it, such as through a new mapping of a NAT.

        The endpoint answers only what is authentic; the answer leaves through the same socket.
        """
        endpoint = self.endpoint
        before = endpoint.statistics.sent
        endpoint.receive_datagram(data, source, now)
        if endpoint.statistics.sent == before:
            return
        self._moved.pop(source, None)
        self._moved[source] = path
        if len(self._moved) > MOVED_PEERS:
            del self._moved[next(iter(self._moved))]

    def send(self, data: bytes, address: Address) -> None:
        """Send on all paths to a peer, or to an address that was heard outside them."""
        ways = self._ways.get(address)
        if ways is not None:
            for path in ways:
                path.send(data)
        elif (moved := self._moved.get(address)) is not None and moved.is_open:
            moved.send_to(data, address)

    def follow(self) -> None:
        """Tell the finder how the session is, and let a path lead to an address that the endpoint has validated."""
        endpoint = self.endpoint
        word = _WORDS.get(endpoint.state, "")
        name = endpoint.peer_name if word else ""
        if (name, word) != self._told:
            former = self._told[0]
            if former and former != name:
                self._tell_finder(SessionState(former, hand_over.GONE))
            if name:
                self._tell_finder(SessionState(name, word))
            self._told = name, word
            for each in self._found:
                each.missing_since = None
        if word:
            self._had_session = True
            self._shown = name
            peer = endpoint.peer
            path = None if peer is None or peer in self._ways else self._moved.get(peer)
            if peer is not None and path is not None and path.is_open and path.remote != peer:
                path.guard(peer)  # what comes from there is of the path again
                self._count(path)
        elif not self._finds:
            self._give_up(FINDER_ENDED)
        self.tell()

    # --- the finder

    def _tell_finder(self, message: StunReceived | SessionState | PathSilent) -> None:
        """Send a message; one for which there is no room is lost, as a datagram would be."""
        if self._finds:
            hand_over.send(self._finder, message)

    def _on_messages(self) -> None:
        for _ in range(MESSAGES_AT_ONCE):
            try:
                received = hand_over.receive(self._finder)
            except BlockingIOError:
                break
            except ConnectionError:
                received = None
            except ValueError:
                statistics = self.endpoint.statistics
                statistics.dropped[DropReason.UNREADABLE] += 1
                statistics.drops += 1
                continue
            if received is None:  # the present paths stay in use, but no session begins any more
                self._stop_listening()
                self._finds = False
                if not self._told[0]:
                    self._give_up(FINDER_ENDED)
                break
            self._obey(*received)
        self.tell()
        self.shell.on_datagrams()

    def _obey(self, message: hand_over.Message, carried: socket.socket | None) -> None:
        if isinstance(message, PathFound) and carried is not None:
            self._use(message, carried)
        elif isinstance(message, PathLost):
            for path in self._found:
                if path.found.number == message.number:
                    self._drop(path)
        elif isinstance(message, PathNews):
            self._note = message.text
            if message.is_final and self.endpoint.role is Role.INITIATOR and not self._had_session:
                self._give_up(message.text)

    def _use(self, found: PathFound, bound: socket.socket) -> None:
        """Send on a new path, and soon no more on the one that it replaces."""
        loop = self._loop
        if loop is None:
            bound.close()
            return
        path = FoundPath(found, bound, self, loop)
        for former in self._ways.get(path.address, ()):
            if former.found.place == found.place and not former.is_replaced:
                former.is_replaced = True
                loop.call_later(REPLACED_S, self._drop, former)
        self._keep((*self._found, path))
        self._count(path)
        self._note = ""
        if not self._told[0]:
            self._shown = found.peer

    def _count(self, path: FoundPath) -> None:
        key = path.found.peer, path.found.place
        path.changes = self._changes[key] = self._changes.get(key, -1) + 1

    def _drop(self, path: FoundPath) -> None:
        path.close()
        self._keep(tuple(other for other in self._found if other is not path))
        self.tell()

    def _keep(self, paths: tuple[FoundPath, ...]) -> None:
        self.all = self._found = paths
        self._ways = {
            address: tuple(path for path in paths if path.address == address)
            for address in {path.address for path in paths}
        }

    def _stop_listening(self) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.remove_reader(self._finder.fileno())
        self._loop = None

    def _give_up(self, why: str) -> None:
        if self._is_given_up or self.endpoint.state is State.CLOSED:
            return
        self._is_given_up = True
        self.shell.on_no_path(why if why == self._note or not self._note else f"{why}: {self._note}")

    def tell(self) -> None:
        shown = sorted(
            (path for path in self._found if path.found.peer == self._shown and not path.is_replaced),
            key=lambda path: path.found.place,
        )
        self.facts = tuple(path.facts(self._note) for path in shown) or (
            LinkPath(route="", note=self._note if self._finds else FINDER_ENDED),
        )
