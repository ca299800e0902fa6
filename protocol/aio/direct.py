"""The datagrams of an endpoint on a UDP port of this host, to an address that is known or that calls."""

import asyncio
import socket
from errno import EADDRINUSE

from weberlink.compiled import mypyc_attr
from weberlink.protocol.aio.address import address_of, name_of, numeric
from weberlink.protocol.aio.hand_over import PathFacts
from weberlink.protocol.aio.sockets import Carrier, GuardedSocket, Wake
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.events import Address
from weberlink.protocol.states import State


@mypyc_attr(native_class=False)
class AddressInUseError(OSError):
    """Another program holds the UDP port."""


class DirectPort(Carrier):
    """One port; its path is the way that the network takes."""

    def __init__(self, endpoint: Endpoint, dscp: int, listen: Address) -> None:
        """Prepare; `open` claims the port.

        Args:
            listen: own host and port; "" for all interfaces, 0 for any port.
        """
        super().__init__(endpoint, dscp)
        self._listen = listen
        self._port: GuardedSocket | None = None
        self._peer_address: Address | None = None
        self._changes = 0
        self._names: dict[Address, Address] = {}
        self._numeric: dict[Address, Address] = {}
        self.paths = (PathFacts(remote="" if endpoint.peer is None else numeric(endpoint.peer)),)

    async def open(self, wake: Wake) -> None:
        """Resolve names, claim the port and listen.

        Raises:
            AddressInUseError: if another program has the port.
            OSError: if a name does not resolve or is not an address of this host.
        """
        family, local = await _resolve(wake.loop, self._listen, socket.AF_UNSPEC, passive=True)
        if self._endpoint.peer is not None:
            wanted = family if self._listen[0] else socket.AF_UNSPEC
            family, peer = await _resolve(wake.loop, self._endpoint.peer, wanted, passive=False)
            if not self._listen[0]:
                _, local = await _resolve(wake.loop, self._listen, family, passive=True)
            self._names[peer] = self._endpoint.peer
            self._numeric[self._endpoint.peer] = peer
        bound = _bind(family, local)
        self.address = address_of(bound.getsockname())
        self._port = GuardedSocket(bound, self._take, wake, self._dscp, self._tell)

    def read(self) -> bool:
        return self._port is not None and self._port.read()

    def _take(self, data: bytes, source: Address, now: float) -> None:
        self._endpoint.receive_datagram(data, self._names.get(source, source), now)

    def follow(self) -> None:
        """Keep a socket connected to the present address of the peer."""
        peer = self._endpoint.peer
        if peer is None or self._endpoint.state is not State.ENGAGED or self._port is None:
            return
        address = self._numeric.get(peer, peer)
        if address == self._peer_address:
            return
        self._changes += self._peer_address is not None
        self._peer_address = address
        self._port.guard(address)
        self._tell()

    def _tell(self) -> None:
        address, port = self._peer_address, self._port
        if address is not None and port is not None:
            self.paths = (PathFacts(remote=numeric(address), changes=self._changes, dscp=port.dscp),)

    def send(self, data: bytes, address: Address) -> None:
        if self._port is not None:
            self._port.send(data, self._numeric.get(address, address))

    def close(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None


async def _resolve(
    loop: asyncio.AbstractEventLoop, address: Address, family: int, *, passive: bool
) -> tuple[socket.AddressFamily, Address]:
    host, port = address
    flags = socket.AI_PASSIVE if passive else 0
    try:
        if "%" in host:  # an address with its zone, which uvloop would drop; there is nothing to look up
            flags |= socket.AI_NUMERICHOST
            found = socket.getaddrinfo(host, port, family, socket.SOCK_DGRAM, flags=flags)
        else:
            found = await loop.getaddrinfo(host or None, port, family=family, type=socket.SOCK_DGRAM, flags=flags)
    except socket.gaierror as problem:
        raise OSError(f"{host}:{port} cannot be resolved: {problem.strerror}") from None
    # IPv4 first: a wildcard must take callers of the kind that most configurations name.
    chosen = min(found, key=lambda entry: entry[0] != socket.AF_INET)
    return chosen[0], address_of(chosen[4])


def _bind(family: socket.AddressFamily, local: Address) -> socket.socket:
    bound = socket.socket(family, socket.SOCK_DGRAM)
    try:
        bound.setblocking(False)
        bound.bind(name_of(local))
    except OSError as problem:
        bound.close()
        host, port = local
        if problem.errno != EADDRINUSE:
            raise OSError(problem.errno, f"UDP {host}:{port} cannot be listened on: {problem.strerror}") from None
        raise AddressInUseError(
            EADDRINUSE,
            f"UDP {host}:{port} is in use: stop the program that holds it (ss -lunp shows which), "
            "or choose another port to listen on",
        ) from None
    return bound
