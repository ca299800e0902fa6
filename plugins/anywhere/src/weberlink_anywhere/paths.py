"""The paths that a finder has handed to its daemon, and attempts to find others."""

import asyncio
import socket
import time
from collections.abc import Awaitable, Callable
from itertools import count
from pathlib import Path
from typing import NamedTuple

from weberlink.protocol.events import Address
from weberlink.text import one_line
from weberlink_anywhere import ice, networks
from weberlink_anywhere.credentials import credentials, read_credentials, read_secret
from weberlink_anywhere.hand_over import ENGAGED, LONGEST_TEXT, PathFound, PathLost, PathNews, StunReceived
from weberlink_anywhere.order import FinderOrder
from weberlink_anywhere.signalling import Description
from weberlink_anywhere.sockets import Binding

GRACE_S = 2.0
"""A replaced path lives on so long: the peer may still send there."""
CREDENTIALS_S = 24 * 3600.0
"""Lifetime of credentials for the relay; a session may be renewed by ICE for so long without new ones."""
STAGGER_S = 0.05
"""Between the places whose paths are replaced during a session: until both ends have taken a new path over, some
milliseconds, it loses datagrams, which then arrive by the other one."""
TCP_S = 1.0
"""For a TCP connection to a server that does not answer by UDP."""


class ServerNames:
    """The servers of the file: credentials, and addresses that may change.

    Args:
        order: of the daemon.
        own: name of this host towards the relay.

    Attributes:
        asked: the server that tells an address outside, host:port; "" if there is none.
        relay: what people call the relay; "" if there is none.

    Raises:
        KeyFileError: the secret or the credentials of the relay cannot be read.
    """

    def __init__(self, order: FinderOrder, own: str) -> None:
        turn = order.turn or {}
        self._own, self._turn = own, turn.get("server") or ""
        self.asked = order.stun or self._turn
        self.relay = turn.get("name") or self._turn.rpartition(":")[0]
        secret, fixed = turn.get("secret_file"), turn.get("credentials_file")
        self._secret = read_secret(Path(secret)) if secret else ""
        self._fixed = read_credentials(Path(fixed)) if fixed else None

    async def answers_tcp(self) -> bool:
        """Whether the asked server takes a TCP connection; a relay does so at the same port (RFC 8656 section 3.1)."""
        host, _, port = self.asked.rpartition(":")
        try:
            _, writer = await asyncio.wait_for(asyncio.open_connection(host.strip("[]"), int(port)), TCP_S)
        except OSError:  # TimeoutError is one
            return False
        writer.close()
        return True

    async def resolve(self) -> ice.Servers:
        """Their addresses now; a name that does not resolve is left out, as a server that does not answer."""
        stun, turn = await asyncio.gather(_resolve(self.asked), _resolve(self._turn))
        user, password = self._fixed or credentials(self._secret, self._own, time.time(), CREDENTIALS_S)
        return ice.Servers(stun, turn, user, password)


async def _resolve(server: str) -> Address | None:
    host, _, port = server.rpartition(":")
    if not host:
        return None
    try:
        found = await asyncio.get_running_loop().getaddrinfo(host.strip("[]"), int(port), type=socket.SOCK_DGRAM)
    except OSError:
        return None
    chosen = min(found, key=lambda entry: entry[0] != socket.AF_INET)  # aioice asks a STUN server by IPv4 only
    return str(chosen[4][0]), int(chosen[4][1])


class Paths:
    """All paths of a finder.

    Args:
        tell: sends a message to the daemon, with a socket.

    Attributes:
        sessions: state of the session by name of the peer, as the daemon tells it.
        lost: called when a path has ended.
    """

    def __init__(self, order: FinderOrder, servers: ServerNames, tell: Callable[..., None]) -> None:
        self._order, self.servers, self._tell = order, servers, tell
        self._numbers = count(1)
        self._open: dict[int, _Open] = {}
        self._places: dict[tuple[str, int], int] = {}
        self._closing: set[asyncio.Task[None]] = set()
        self.sessions: dict[str, str] = {}
        self.lost: Callable[[], None] = lambda: None

    def news(self, peer: str, text: str, *, is_final: bool = False) -> None:
        """Tell the daemon one line for a person."""
        self._tell(PathNews.of(peer, text, is_final))

    async def prepare(self, count: int, *, controlling: bool, patience: float = ice.GATHER_S) -> list[ice.PathAttempt]:
        """Begin to find so many paths: own addresses are known afterwards.

        Args:
            patience: for the servers [s].

        Raises:
            NoPath: this host is not connected.
        """
        servers = await self.servers.resolve()
        now = networks.look()
        attempts = [
            ice.PathAttempt(self._binding(now, place, count), servers, controlling=controlling)
            for place in range(count)
        ]
        try:
            await asyncio.gather(*(attempt.gather(patience) for attempt in attempts))
        except BaseException:
            await self.drop(attempts)
            raise
        return attempts

    def _binding(self, now: networks.Networks, place: int, count: int) -> Binding:
        """One path uses all interfaces, each of several its own; with fewer interfaces than paths, they share."""
        named = self._order.interfaces
        wanted = named or (now.outside if count > 1 else ())
        present = [name for name in wanted if name in now.addresses.values()]
        if not now.addresses or (named and not present):
            raise ice.NoPath(f"{', '.join(named) or 'this host'} is not connected to a network")
        chosen = (present[place % len(present)],) if present and count > 1 else tuple(present)
        # An interface with a way outside must not be left by that of another one; others are for near hosts.
        return Binding(now.of(chosen), frozenset((*now.outside, *named)), self._order.dscp)

    async def use(self, peer: str, place: int, attempt: ice.PathAttempt, remote: Description, timeout: float) -> None:
        """Find the path of a place, and hand it over.

        Raises:
            NoPath: the attempt is closed, and the former path of this place stays.
        """
        try:
            found = await attempt.connect(remote, timeout)
            if place and self.sessions.get(peer) == ENGAGED:
                await asyncio.sleep(STAGGER_S * place)
        except BaseException:
            await attempt.close()
            raise
        number = next(self._numbers)
        via = one_line(found.foreign_relay or self.servers.relay if found.route == "relayed" else "", LONGEST_TEXT)
        self._open[number] = _Open(peer, attempt, found, asyncio.create_task(self._follow(number, attempt)))
        former = self._places.get((peer, place))
        self._places[peer, place] = number
        message = PathFound(number, place, peer, found.remote, found.channel, found.route, via, found.socket.interface)
        self._tell(message, found.socket.hand_over())
        if former is not None:
            self._retire(former)

    def deliver(self, received: StunReceived) -> None:
        """Take a STUN message that arrived at a socket which was handed over."""
        if (path := self._open.get(received.number)) is not None:
            path.found.socket.deliver(received.data, (received.source[0], received.source[1]))

    def give_up(self, number: int) -> None:
        """End a path on which nothing comes any more; one that another has replaced ends by itself."""
        if number in self._places.values():
            self._open[number].following.cancel()
            self._end(number)

    def count(self, peer: str) -> int:
        """How many paths to a peer are in use."""
        return sum(name == peer for name, _ in self._places)

    async def drop(self, attempts: list[ice.PathAttempt]) -> None:
        """Give attempts up."""
        await asyncio.gather(*(attempt.close() for attempt in attempts), return_exceptions=True)

    def forget(self, peer: str) -> None:
        """End the paths to a peer that is not known any more, once the daemon has told it so."""

        async def end(number: int, path: _Open) -> None:
            await asyncio.sleep(GRACE_S)
            if self._open.pop(number, None) is not None:
                self._tell(PathLost(number))
                await path.attempt.close()

        for number, path in self._open.items():
            if path.peer == peer:
                path.following.cancel()
                self._later(end(number, path))
        for key in [key for key in self._places if key[0] == peer]:
            del self._places[key]

    async def close(self) -> None:
        """End all paths."""
        for path in self._open.values():
            path.following.cancel()
        await self.drop([path.attempt for path in self._open.values()])

    async def _follow(self, number: int, attempt: ice.PathAttempt) -> None:
        await attempt.ended()
        self._end(number)

    def _end(self, number: int) -> None:
        path = self._open.pop(number)
        # A session that lives on its only path is consent enough, and was challenged there if an address has changed
        # (weberlink.protocol.address); it keeps the path until ICE has found another one.
        if self.sessions.get(path.peer) != ENGAGED or self.count(path.peer) > 1:
            self._tell(PathLost(number))
        for key in [key for key, value in self._places.items() if value == number]:
            del self._places[key]
        self._later(path.attempt.close())
        self.lost()

    def _retire(self, number: int) -> None:
        if (path := self._open.get(number)) is None:
            return
        path.following.cancel()

        async def end() -> None:
            await asyncio.sleep(GRACE_S)
            self._open.pop(number, None)
            await path.attempt.close()

        self._later(end())

    def _later(self, work: Awaitable[None]) -> None:
        task = asyncio.ensure_future(work)
        self._closing.add(task)
        task.add_done_callback(self._closing.discard)


class _Open(NamedTuple):
    peer: str
    attempt: ice.PathAttempt
    found: ice.Found
    following: asyncio.Task[None]
