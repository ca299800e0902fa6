"""The paths that carry the datagrams of an endpoint: a port of this host, or those that another process finds.

A path is a bound socket, and once the peer is known a second one on the same port that is connected to it. The kernel
puts the peer's datagrams into the buffer of the second socket and all others into that of the first, so a flood from
elsewhere cannot push out the peer's datagrams, and gets only a small share of the processor. Everything is sent from
the first socket, whose own address may change meanwhile.
"""

import asyncio
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from weberlink.protocol.aio import hand_over
from weberlink.protocol.aio.hand_over import (
    PathFacts,
    PathFound,
    PathLost,
    PathNews,
    PathSilent,
    SessionState,
    StunReceived,
)
from weberlink.protocol.aio.queue import ReceiveQueue, WorkBudget
from weberlink.protocol.aio.sockets import (
    ECN_BITS,
    Ancillary,
    address_of,
    answering,
    ask_for_class,
    ask_for_destination,
    bind,
    connected_twin,
    mark,
    name_of,
    numeric,
    resolve,
)
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import Address, DropReason
from weberlink.protocol.states import Role, State

PEER_SHARE: Final = 0.3
"""Share of a processor for datagrams from the peer's address, or from anywhere while there is no peer."""
STRANGER_SHARE: Final = 0.05
"""Share of a processor for other datagrams while there is a peer: it may have moved or restarted."""
CLASS_LOOK_S: Final = 1.0
"""Time between two looks at the class of service with which datagrams arrive [s]."""
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
"""What a STUN message may cost the finder at most, and how much may come at once [s of a processor]. With the shares
above: 300/s of the peer, 50/s of strangers, 20 at once. More would push out what the daemon has to say."""
MOVED_PEERS: Final = 8
"""Addresses outside all paths whose way back is remembered."""
MESSAGES_AT_ONCE: Final = 16
"""Messages of the finder between two looks at anything else."""
FINDER_ENDED: Final = "the process that finds paths has ended"
_HEADER: Final = 4
"""Bytes in front of what a TURN channel carries (RFC 8656 section 12.4)."""
_WORDS = {State.ENGAGED: hand_over.ENGAGED, State.SILENT: hand_over.SILENT}
_THE_PORT = PathFound(0, 0, "", ("", 0))


class Path:
    """One path.

    Attributes:
        address: of the peer in the endpoint.
        remote: where the peer is, as the sources of its datagrams are named; None while unknown.
        changes: how often this place had another path or remote before.
        channel: of the relay, as on the wire.
        budgets: of STUN messages, from strangers and from the peer.
        missing_since: when the peer was heard on another path first after this one [s]; None if it was not.
    """

    def __init__(
        self, found: PathFound, bound: socket.socket, owner: "Paths", loop: asyncio.AbstractEventLoop, dscp: int
    ) -> None:
        self.found = found
        self.address = hand_over.address_of(found.peer)
        self.remote: Address | None = None
        self.changes = 0
        self.channel = b"" if found.channel is None else found.channel.to_bytes(2, "big")
        self.budgets = [WorkBudget(share, STUN_BURST_S, owner.now()) for share in (STRANGER_SHARE, PEER_SHARE)]
        self.is_replaced = False
        self.is_open = True
        self.missing_since: float | None = None
        self._owner = owner
        self._loop = loop
        self._dscp: int | None = None
        self._bound = bound
        bound.setblocking(False)
        mark(bound, dscp)
        ask_for_destination(bound)
        # Set only now, so that the port had to be free. Only sockets that set the option too can share it from here on.
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        self._open = self._queue(bound, self._on_called)
        self._peer: ReceiveQueue | None = None
        self._called: list[tuple[Address, str, Ancillary]] = []
        """Sender of the newest datagram, and which address of this host it called; then the same of the peer."""

    def guard(self, peer: Address) -> None:
        """Receive from this address in a socket of its own, and send to it. Without that socket there is less
        protection."""
        if self._peer is not None:
            self._peer.close()
            self._peer = None
        self.remote = peer
        called = [each for each in self._called[:1] if each[0] == peer]
        self._called = self._called[:1] + called
        # A socket on all addresses would take one of the system's choice, at which nothing of the peer arrives. A
        # link-local address needs its zone, which is not told.
        own_host = called[0][1] if called and "%" not in peer[0] else ""
        try:
            connected = connected_twin(self._bound, own_host, peer)
        except OSError:
            self._open.budget.share = PEER_SHARE
            return
        self.remote = address_of(connected.getpeername())
        ask_for_class(connected)
        self._peer = self._queue(connected, self._on_class, CLASS_LOOK_S)
        self._open.budget.share = STRANGER_SHARE

    def read(self) -> bool:
        """Take what the peer has sent; the loop wakes by itself for other datagrams."""
        return (self._peer or self._open).read()

    def send(self, data: bytes) -> None:
        """Send to the peer, through the relay if there is one."""
        if self.remote is not None:
            self.send_to(self.channel + len(data).to_bytes(2, "big") + data if self.channel else data, self.remote)

    def send_to(self, data: bytes, address: Address) -> None:
        """Send a datagram; one that the system refuses (peer not there, buffer full, no route) is lost."""
        name = name_of(address) if "%" in address[0] else address
        for source, _, ancillary in self._called:
            if source == address:  # a peer knows the address that it called alone
                with suppress(OSError):  # the host may have lost it since
                    self._bound.sendmsg((data,), ancillary, 0, name)
                    return
        with suppress(OSError):
            self._bound.sendto(data, name)

    def facts(self, note: str = "") -> PathFacts:
        """The path in words."""
        _, place, _, remote, _, route, via, interface = self.found
        return PathFacts(place, route, via, interface, numeric(self.remote or remote), self.changes, note, self._dscp)

    def close(self) -> None:
        """Release both sockets; may be repeated, also while a datagram is taken."""
        self.is_open = False
        if self._peer is not None:
            self._peer.close()
        self._open.close()

    def _queue(
        self, bound: socket.socket, on_ancillary: Callable[[Address, Ancillary], None], look_every: float = 0.0
    ) -> ReceiveQueue:
        owner = self._owner
        return ReceiveQueue(
            bound,
            loop=self._loop,
            now=owner.now,
            take=self._take,
            on_datagrams=owner.on_datagrams,
            share=PEER_SHARE,
            on_ancillary=on_ancillary,
            look_every=look_every,
        )

    def _take(self, data: bytes, source: Address, now: float) -> None:
        self._owner.take(data, source, now, self)

    def _on_called(self, source: Address, ancillary: Ancillary) -> None:
        self._called[:1] = [(source, *answering(ancillary))]

    def _on_class(self, _source: Address, ancillary: Ancillary) -> None:
        """Note with which class of service the peer's datagrams arrive."""
        ((_, _, value),) = ancillary  # IPv4 gives one octet, IPv6 an integer
        dscp = int.from_bytes(value, sys.byteorder) >> ECN_BITS
        if dscp != self._dscp:
            self._dscp = dscp
            self._owner.tell()


class Paths:
    """The only path of an endpoint with a port of this host, which leads to an address that is known or that calls.

    Attributes:
        facts: of the paths in use, in words; replaced when there is news.
        address: own address, once open.
    """

    def __init__(
        self, endpoint: Endpoint, dscp: int, now: Callable[[], float], on_datagrams: Callable[[], None]
    ) -> None:
        self.now = now
        self.on_datagrams = on_datagrams
        self.address: Address = ("", 0)
        self.facts: tuple[PathFacts, ...] = ()
        self._endpoint = endpoint
        self._dscp = dscp
        self._all: tuple[Path, ...] = ()
        self._numeric: Address | None = None
        """Address of the peer that the endpoint knows by a name."""
        self._guarded: Address | None = None
        self.tell()

    async def open(self, loop: asyncio.AbstractEventLoop, listen: Address) -> None:
        """Resolve names, claim the port and listen; raises as `UdpShell.open`."""
        peer = self._endpoint.peer
        family, local = await resolve(loop, listen, socket.AF_UNSPEC, passive=True)
        if peer is not None:
            family, self._numeric = await resolve(loop, peer, family if listen[0] else socket.AF_UNSPEC, passive=False)
            if not listen[0]:
                _, local = await resolve(loop, listen, family, passive=True)
        bound = bind(family, local)
        self.address = address_of(bound.getsockname())
        self._all = (Path(_THE_PORT, bound, self, loop, self._dscp),)

    def read(self) -> bool:
        """Hand what the peer has sent to the endpoint, within the budget; returns whether there was anything."""
        was_any = False
        for path in self._all:
            was_any = path.read() or was_any
        return was_any

    def take(self, data: bytes, source: Address, now: float, path: Path) -> None:  # noqa: ARG002 - of several paths
        """Take a datagram that came on a path."""
        peer = self._endpoint.peer if source == self._numeric else None
        self._endpoint.receive_datagram(data, source if peer is None else peer, now)

    def follow(self) -> None:
        """Take note of the endpoint's state and of its peer's address, one of which may have changed."""
        peer = self._endpoint.peer
        if peer is None or self._endpoint.state is not State.ENGAGED:
            return
        address = self._numeric or peer
        if address != self._guarded:
            for path in self._all:
                path.changes += self._guarded is not None
                path.guard(address)
            self._guarded = address
            self.tell()

    def send(self, data: bytes, address: Address) -> None:
        """Send a datagram."""
        for path in self._all:
            path.send_to(data, self._numeric or address)

    def tell(self) -> None:
        """Say anew which paths are in use."""
        peer = self._endpoint.peer
        known = [path for path in self._all if path.remote is not None]
        self.facts = tuple(path.facts() for path in known) or (PathFacts(remote="" if peer is None else numeric(peer)),)

    def close(self) -> None:
        """Release all sockets; may be repeated."""
        for path in self._all:
            path.close()
        self._all = ()


class FoundPaths(Paths):
    """The paths that another process finds, and hands over as sockets (`hand_over`).

    A peer has one address in the endpoint, whatever paths lead to it. What is sent there goes out on all of them, and
    the endpoint is given the first copy that arrives. A path that another one replaces carries copies for a short while
    longer, because the two ends change at different moments.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        dscp: int,
        now: Callable[[], float],
        on_datagrams: Callable[[], None],
        finder: socket.socket,
        on_no_path: Callable[[str], None],
    ) -> None:
        """Prepare. `finder` is the socket to the process, which stays open; `on_no_path` is told once at most, in one
        line, why there will be no session: the finder gave up before the first one, or has ended."""
        self._finder = finder
        self._on_no_path = on_no_path
        self._loop: asyncio.AbstractEventLoop | None = None
        self._finds = True
        self._ways: dict[Address, tuple[Path, ...]] = {}
        self._moved: dict[Address, Path] = {}
        self._arrived: dict[bytes, Path] = {}
        self._changes: dict[tuple[str, int], int] = {}
        """By peer and place, how often its path was another one."""
        self._told = ("", "")
        self._shown = "" if endpoint.peer is None else endpoint.peer[0]
        self._note = "finding a path" if endpoint.role is Role.INITIATOR else ""
        self._is_given_up = False
        self._had_session = False
        super().__init__(endpoint, dscp, now, on_datagrams)

    async def open(self, loop: asyncio.AbstractEventLoop, listen: Address) -> None:  # noqa: ARG002 - the finder listens
        self._loop = loop
        loop.add_reader(self._finder.fileno(), self._on_messages)

    def close(self) -> None:
        """Release the sockets of all paths; that to the finder stays open."""
        self._stop_listening()
        super().close()
        self._keep(())

    # --- the endpoint

    def take(self, data: bytes, source: Address, now: float, path: Path) -> None:
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

    def _take_once(self, data: bytes, now: float, path: Path) -> None:
        """Take a datagram of the peer, unless it came on another path before. On the same one it is a replay, which the
        endpoint counts."""
        ways, arrived = self._ways.get(path.address, ()), self._arrived
        if len(ways) > 1:
            self._watch(ways, path, now)
        first = arrived.setdefault(data, path)
        if len(arrived) > REMEMBERED:
            del arrived[next(iter(arrived))]
        if first is path:
            self._endpoint.receive_datagram(data, path.address, now)
        else:
            self._endpoint.statistics.copies += 1

    def _watch(self, ways: tuple[Path, ...], heard: Path, now: float) -> None:
        """Tell the finder of a path on which nothing comes any more; again, while it lasts."""
        for path in ways:
            if path is heard:
                path.missing_since = None
            elif path.missing_since is None:
                path.missing_since = now
            elif now - path.missing_since > SILENT_S:
                path.missing_since = now
                self._tell_finder(PathSilent(path.found.number))

    def take_from_elsewhere(self, data: bytes, source: Address, now: float, path: Path) -> None:
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
        """Tell the finder how the session is, and let a path lead to an address that the endpoint has validated."""
        endpoint = self._endpoint
        word = _WORDS.get(endpoint.state, "")
        name = endpoint.peer_name if word else ""
        if (name, word) != self._told:
            former = self._told[0]
            if former and former != name:
                self._tell_finder(SessionState(former, hand_over.GONE))
            if name:
                self._tell_finder(SessionState(name, word))
            self._told = name, word
            for each in self._all:
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
                statistics = self._endpoint.statistics
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
        self.on_datagrams()

    def _obey(self, message: hand_over.Message, carried: socket.socket | None) -> None:
        if isinstance(message, PathFound) and carried is not None:
            self._use(message, carried)
        elif isinstance(message, PathLost):
            for path in self._all:
                if path.found.number == message.number:
                    self._drop(path)
        elif isinstance(message, PathNews):
            self._note = message.text
            if message.is_final and self._endpoint.role is Role.INITIATOR and not self._had_session:
                self._give_up(message.text)

    def _use(self, found: PathFound, bound: socket.socket) -> None:
        """Send on a new path, and soon no more on the one that it replaces."""
        loop = self._loop
        if loop is None:
            bound.close()
            return
        path = Path(found, bound, self, loop, self._dscp)
        path.guard(found.remote)
        for former in self._ways.get(path.address, ()):
            if former.found.place == found.place and not former.is_replaced:
                former.is_replaced = True
                loop.call_later(REPLACED_S, self._drop, former)
        self._keep((*self._all, path))
        self._count(path)
        self._note = ""
        if not self._told[0]:
            self._shown = found.peer

    def _count(self, path: Path) -> None:
        key = path.found.peer, path.found.place
        path.changes = self._changes[key] = self._changes.get(key, -1) + 1

    def _drop(self, path: Path) -> None:
        path.close()
        self._keep(tuple(other for other in self._all if other is not path))
        self.tell()

    def _keep(self, paths: tuple[Path, ...]) -> None:
        self._all = paths
        self._ways = {
            address: tuple(path for path in paths if path.address == address)
            for address in {path.address for path in paths}
        }

    def _stop_listening(self) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.remove_reader(self._finder.fileno())
        self._loop = None

    def _give_up(self, why: str) -> None:
        if self._is_given_up or self._endpoint.state is State.CLOSED:
            return
        self._is_given_up = True
        self._on_no_path(why if why == self._note or not self._note else f"{why}: {self._note}")

    def tell(self) -> None:
        shown = sorted(
            (path for path in self._all if path.found.peer == self._shown and not path.is_replaced),
            key=lambda path: path.found.place,
        )
        self.facts = tuple(path.facts(self._note) for path in shown) or (
            PathFacts(route="", note=self._note if self._finds else FINDER_ENDED),
        )
