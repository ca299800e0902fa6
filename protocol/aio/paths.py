"""The datagrams of an endpoint on paths that another process finds, and hands over as sockets (`hand_over`).

A peer has one address in the endpoint, whatever paths lead to it. What is sent there goes out on all of them, and the
endpoint is given the first copy that arrives. A path that another one replaces carries copies for a short while longer,
because the two ends change at different moments.
"""

import socket
from collections.abc import Callable
from typing import Final

from weberlink.protocol.aio import hand_over
from weberlink.protocol.aio.address import numeric
from weberlink.protocol.aio.hand_over import (
    PathFacts,
    PathFound,
    PathLost,
    PathNews,
    PathSilent,
    SessionState,
    StunReceived,
)
from weberlink.protocol.aio.queue import WorkBudget
from weberlink.protocol.aio.sockets import PEER_SHARE, STRANGER_SHARE, Carrier, GuardedSocket, Wake
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import Address, DropReason
from weberlink.protocol.states import Role, State

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
"""What a STUN message may cost the finder at most, and how much may come at once [s of a processor]. With the shares of
`weberlink.protocol.aio.sockets`: 300/s of the peer, 50/s of strangers, 20 at once. More would push out what the daemon
has to say."""
MOVED_PEERS: Final = 8
"""Addresses outside all paths whose way back is remembered."""
MESSAGES_AT_ONCE: Final = 16
"""Messages of the finder between two looks at anything else."""
FINDER_ENDED: Final = "the process that finds paths has ended"
_HEADER: Final = 4
"""Bytes in front of what a TURN channel carries (RFC 8656 section 12.4)."""
_WORDS = {State.ENGAGED: hand_over.ENGAGED, State.SILENT: hand_over.SILENT}


def ignore(_text: str) -> None:
    """Take no notice."""


class FoundPath:
    """One path, with its socket.

    Attributes:
        found: as the finder told it.
        address: of the peer in the endpoint.
        remote: where to send to.
        is_replaced: whether another path has taken its place.
        is_open: until `close`.
        missing_since: when the peer was heard on another path first after this one [s]; None if it was not.
    """

    def __init__(self, found: PathFound, bound: socket.socket, owner: "FoundPaths", wake: Wake, dscp: int) -> None:
        self.found = found
        self.address = hand_over.address_of(found.peer)
        self.is_replaced = False
        self.is_open = True
        self.missing_since: float | None = None
        self._owner = owner
        self._channel = b"" if found.channel is None else found.channel.to_bytes(2, "big")
        self._budgets = [WorkBudget(share, STUN_BURST_S, wake.now()) for share in (STRANGER_SHARE, PEER_SHARE)]
        bound.setblocking(False)
        self._socket = GuardedSocket(bound, self._take, wake, dscp, owner.tell)
        self.remote = self._socket.guard(found.remote) or found.remote

    def move(self, remote: Address) -> None:
        """Send to another address from now on."""
        self.remote = self._socket.guard(remote) or remote

    def read(self) -> bool:
        return self._socket.read()

    def send(self, data: bytes) -> None:
        """Send to the peer, through the relay if there is one."""
        if self._channel:
            data = self._channel + len(data).to_bytes(2, "big") + data
        self._socket.send(data, self.remote)

    def send_to(self, data: bytes, address: Address) -> None:
        """Send to an address outside the path."""
        self._socket.send(data, address)

    def facts(self, changes: int, note: str) -> PathFacts:
        found = self.found
        remote = numeric(self.remote)
        return PathFacts(found.place, found.route, found.via, found.interface, remote, changes, note, self._socket.dscp)

    def close(self) -> None:
        self.is_open = False
        self._socket.close()

    def _take(self, data: bytes, source: Address, now: float) -> None:
        is_relayed = len(self._channel) > 0
        if hand_over.is_stun(data) or (is_relayed and hand_over.is_stun(data[_HEADER:])):
            self._pass_on(data, source, now)
        elif not is_relayed:
            if source == self.remote:
                self._owner.take(data, now, self)
            else:
                self._owner.take_from_elsewhere(data, source, now, self)
        elif source == self.remote and data[:2] == self._channel:
            length = int.from_bytes(data[2:_HEADER], "big")
            self._owner.take(data[_HEADER : _HEADER + length], now, self)

    def _pass_on(self, data: bytes, source: Address, now: float) -> None:
        """Return a STUN message to the finder, or drop it if there were too many."""
        budget = self._budgets[source == self.remote]
        if len(data) > LONGEST_STUN or budget.left(now) < 0.0:
            return
        budget.spend(STUN_S, now)
        self._owner.tell_finder(StunReceived(self.found.number, source, data))


class FoundPaths(Carrier):
    """All paths of an endpoint."""

    def __init__(self, endpoint: Endpoint, dscp: int, finder: socket.socket, on_no_path: Callable[[str], None]) -> None:
        """Prepare; `open` begins to listen to the finder.

        Args:
            finder: the socket to it, which does not block; stays open.
            on_no_path: told in one line why there will be no session, once at most: the finder gave up before the
                first one, or has ended.
        """
        super().__init__(endpoint, dscp)
        self._finder = finder
        self._on_no_path = on_no_path
        self._wake: Wake | None = None
        self._finds = True
        self._all: tuple[FoundPath, ...] = ()
        self._ways: dict[Address, tuple[FoundPath, ...]] = {}
        self._moved: dict[Address, FoundPath] = {}
        self._arrived: dict[bytes, FoundPath] = {}
        self._counts: dict[tuple[str, int], int] = {}
        self._told = ("", "")
        self._shown = "" if endpoint.peer is None else endpoint.peer[0]
        self._note = "finding a path" if endpoint.role is Role.INITIATOR else ""
        self._is_given_up = False
        self._had_session = False
        self.tell()

    async def open(self, wake: Wake) -> None:
        self._wake = wake
        wake.loop.add_reader(self._finder.fileno(), self._on_messages)

    def close(self) -> None:
        """Release the sockets of all paths; that to the finder stays open."""
        self._stop_listening()
        for path in self._all:
            path.close()
        self._keep(())

    # --- the endpoint

    def read(self) -> bool:
        was_any = False
        for path in self._all:
            was_any = path.read() or was_any
        return was_any

    def take(self, data: bytes, now: float, path: FoundPath) -> None:
        """Take a datagram that came on a path, unless it came on another one before."""
        ways = self._ways.get(path.address, ())
        if len(ways) > 1:
            self._watch(ways, path, now)
        if self._is_copy(data, path):
            self._endpoint.statistics.copies += 1
        else:
            self._endpoint.receive_datagram(data, path.address, now)

    def _is_copy(self, data: bytes, path: FoundPath) -> bool:
        """Whether the same bytes came by another path; by the same one, they are a replay that the endpoint counts."""
        arrived = self._arrived
        first = arrived.setdefault(data, path)
        if len(arrived) > REMEMBERED:
            del arrived[next(iter(arrived))]
        return first is not path

    def _watch(self, ways: tuple[FoundPath, ...], heard: FoundPath, now: float) -> None:
        """Tell the finder of a path on which nothing comes any more; again, while it lasts."""
        for path in ways:
            if path is heard:
                path.missing_since = None
            elif path.missing_since is None:
                path.missing_since = now
            elif now - path.missing_since > SILENT_S:
                path.missing_since = now
                self.tell_finder(PathSilent(path.found.number))

    def take_from_elsewhere(self, data: bytes, source: Address, now: float, path: FoundPath) -> None:
        """Take a datagram that came to the socket of a path from outside it, such as through a new mapping of a NAT.

        The endpoint answers only what is authentic; the answer leaves through the same socket.
        """
        endpoint = self._endpoint
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
        """Tell the finder how the session is, and use an address that the endpoint has validated."""
        endpoint = self._endpoint
        word = _WORDS.get(endpoint.state, "")
        name = endpoint.peer_name if word else ""
        if (name, word) != self._told:
            former = self._told[0]
            if former and former != name:
                self.tell_finder(SessionState(former, hand_over.GONE))
            if name:
                self.tell_finder(SessionState(name, word))
            self._told = name, word
            for path in self._all:
                path.missing_since = None
        if word:
            self._had_session = True
            self._shown = name
            self._move(endpoint.peer)
        elif not self._finds:
            self._give_up(FINDER_ENDED)
        self.tell()

    def _move(self, peer: Address | None) -> None:
        """Let a path lead to where the peer has moved, if it has: its datagrams are then those of the path again."""
        if peer is None or peer in self._ways:
            return
        path = self._moved.get(peer)
        if path is not None and path.is_open and path.remote != peer:
            path.move(peer)
            self._count(path.found)

    # --- the finder

    def tell_finder(self, message: StunReceived | SessionState | PathSilent) -> None:
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
                statistics = self._endpoint.statistics
                statistics.dropped[DropReason.UNREADABLE] += 1
                statistics.drops += 1
                continue
            if received is None:
                self._lose_finder()
                break
            message, carried = received
            self._obey(message, carried)
        self.tell()
        if self._wake is not None:
            self._wake.on_datagrams()

    def _obey(self, message: hand_over.Message, carried: socket.socket | None) -> None:
        if isinstance(message, PathFound) and carried is not None:
            self._use(message, carried)
        elif isinstance(message, PathLost):
            for path in self._all:
                if path.found.number == message.number:
                    self._drop(path)
        elif isinstance(message, PathNews):
            self._note = message.text
            is_master = self._endpoint.role is Role.INITIATOR
            if message.is_final and is_master and not self._had_session:
                self._give_up(message.text)

    def _use(self, found: PathFound, bound: socket.socket) -> None:
        """Send on a new path, and soon no more on the one that it replaces."""
        wake = self._wake
        assert wake is not None
        path = FoundPath(found, bound, self, wake, self._dscp)
        for former in self._ways.get(path.address, ()):
            if former.found.place == found.place and not former.is_replaced:
                former.is_replaced = True
                wake.loop.call_later(REPLACED_S, self._drop, former)
        self._keep((*self._all, path))
        self._count(found)
        self._note = ""
        if not self._told[0]:
            self._shown = found.peer

    def _drop(self, path: FoundPath) -> None:
        path.close()
        self._keep(tuple(other for other in self._all if other is not path))
        self.tell()

    def _keep(self, paths: tuple[FoundPath, ...]) -> None:
        self._all = paths
        self._ways = {
            address: tuple(path for path in paths if path.address == address)
            for address in {path.address for path in paths}
        }

    def _lose_finder(self) -> None:
        """Without the finder the present paths stay in use, but no session begins any more."""
        self._stop_listening()
        self._finds = False
        if not self._told[0]:
            self._give_up(FINDER_ENDED)

    def _stop_listening(self) -> None:
        if self._wake is not None and not self._wake.loop.is_closed():
            self._wake.loop.remove_reader(self._finder.fileno())
        self._wake = None

    def _give_up(self, why: str) -> None:
        if self._is_given_up or self._endpoint.state is State.CLOSED:
            return
        self._is_given_up = True
        self._on_no_path(why if why == self._note or not self._note else f"{why}: {self._note}")

    # --- what people are told

    def _count(self, found: PathFound) -> None:
        key = found.peer, found.place
        self._counts[key] = self._counts.get(key, -1) + 1

    def tell(self) -> None:
        """Say anew which paths are in use."""
        shown = sorted(
            (path for path in self._all if path.found.peer == self._shown and not path.is_replaced),
            key=lambda path: path.found.place,
        )
        self.paths = tuple(
            path.facts(self._counts[path.found.peer, path.found.place], self._note) for path in shown
        ) or (PathFacts(route="", note=self._note if self._finds else FINDER_ENDED),)
