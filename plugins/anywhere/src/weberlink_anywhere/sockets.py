"""UDP sockets of the process that finds paths, which can be handed over to another process.

aioice asks the event loop for its sockets. This loop makes them so that each goes out by one network interface, has the
class of service of the session, and can be handed over: then nothing reads it here, and what STUN messages arrive there
come back by `deliver`.
"""

import asyncio
import socket
import struct
from collections.abc import Callable
from contextlib import suppress
from contextvars import ContextVar
from typing import Any

from weberlink.protocol.events import Address
from weberlink_anywhere.hand_over import is_stun

HOLD_S = 0.1
"""How long the first datagram of a session waits in the kernel for the socket to be handed over."""
_LONGEST = 65536
_CHANNEL_HEADER = 4
_SHORTEST = _CHANNEL_HEADER + 8
"""Enough of a datagram to recognize a STUN message."""
RUBBISH = (ValueError, KeyError, struct.error)
"""What aioice raises over a datagram that is no STUN message, or lacks an attribute."""
_SLICE = 64
"""Datagrams to read before other sockets have their turn."""


class OwnSocket(asyncio.DatagramTransport):
    """A UDP socket that belongs to one protocol of aioice, until it is handed over.

    Args:
        bound: does not block.
        remote: the only address to talk to; None for all. The socket itself is not connected, so that whoever takes it
            over may still choose.
        interface: by which it goes out, "" if unknown.

    Attributes:
        held: called when a datagram of the session is there, before the socket is handed over.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        bound: socket.socket,
        protocol: asyncio.DatagramProtocol,
        remote: Address | None,
        interface: str,
    ) -> None:
        super().__init__({"socket": bound, "sockname": bound.getsockname(), "peername": remote})
        self.socket, self.protocol, self.remote, self.interface, self._loop = bound, protocol, remote, interface, loop
        self._is_closing = False
        self.held: Callable[[], None] = lambda: None
        self._may_hold = True
        self._holding: asyncio.TimerHandle | None = None
        loop.add_reader(bound, self._read)
        protocol.connection_made(self)

    def hand_over(self) -> socket.socket:
        """Stop reading; the socket may still be written here."""
        self._stop_reading()
        return self.socket

    def deliver(self, data: bytes, source: Address) -> None:
        """Take a datagram that arrived at the socket, here or where it was handed to."""
        if not self._is_closing and self.remote in (None, source):
            with suppress(*RUBBISH):
                self.protocol.datagram_received(data, source)

    def sendto(self, data: Any, addr: Any = None) -> None:
        if self._is_closing:
            return
        target: Any = addr or self.remote
        try:
            self.socket.sendto(data, target)
        except BlockingIOError:
            pass  # lost, as if on the way
        except OSError as problem:
            self.protocol.error_received(problem)

    def is_closing(self) -> bool:
        return self._is_closing

    def close(self) -> None:
        if not self._is_closing:
            self._is_closing = True
            self._stop_reading()
            self.socket.close()
            self._loop.call_soon(self.protocol.connection_lost, None)

    abort = close

    def _stop_reading(self) -> None:
        self._loop.remove_reader(self.socket)
        if self._holding is not None:
            self._holding.cancel()

    def _read(self) -> None:
        for _ in range(_SLICE):
            try:
                if self._may_hold and _is_of_session(self.socket.recv(_SHORTEST, socket.MSG_PEEK)):
                    self._hold()
                    return
                data, source = self.socket.recvfrom(_LONGEST)
            except BlockingIOError:
                return
            except OSError as problem:
                self.protocol.error_received(problem)
                return
            self.deliver(data, (source[0], source[1]))
            if self._is_closing:
                return

    def _hold(self) -> None:
        """Leave datagrams of the session to who takes the socket over: the peer has its end of the path already.

        Once, and not for long: the STUN message that completes this end may be behind them.
        """
        self._may_hold = False
        self._loop.remove_reader(self.socket)
        self._holding = self._loop.call_later(HOLD_S, self._resume)
        self.held()

    def _resume(self) -> None:
        self._holding = None
        self._loop.add_reader(self.socket, self._read)


def _is_of_session(data: bytes) -> bool:
    """Whether the beginning of a datagram is neither that of a STUN message, nor of one in a TURN channel."""
    return not (is_stun(data) or is_stun(data[_CHANNEL_HEADER:]))


class Binding:
    """Where the sockets of one path go out.

    Args:
        addresses: interface by own address; other own addresses are not used.
        bound: interfaces to which sockets are bound, so that the routing table cannot send them out by another one.
        dscp: class of service (RFC 2474), 0 to 63.
    """

    def __init__(self, addresses: dict[str, str], bound: frozenset[str], dscp: int) -> None:
        self.addresses, self.bound, self._dscp = addresses, bound, dscp
        self.sockets: list[OwnSocket] = []

    def open(self, family: int, local: Address | None, remote: Address | None) -> tuple[socket.socket, str]:
        """A bound socket, and the interface by which it goes out.

        Raises:
            OSError: there is no such address, or no way to `remote`.
        """
        made = socket.socket(family, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        try:
            is_ipv6 = family == socket.AF_INET6
            option = (socket.IPPROTO_IPV6, socket.IPV6_TCLASS) if is_ipv6 else (socket.IPPROTO_IP, socket.IP_TOS)
            made.setsockopt(*option, self._dscp << 2)
            if local is None:
                assert remote is not None
                local = self._way_to(family, remote), 0
            interface = self.addresses.get(local[0], "")
            if interface in self.bound:
                with suppress(PermissionError):  # before Linux 5.7 only for those who may make any datagram
                    made.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface.encode() + b"\0")
            made.bind(local)
        except OSError:
            made.close()
            raise
        return made, interface

    def _way_to(self, family: int, remote: Address) -> str:
        """Own address from which to reach a server: that of the routing table if it is one of ours, else our first."""
        own = [address for address in self.addresses if (":" in address) == (family == socket.AF_INET6)]
        with socket.socket(family, socket.SOCK_DGRAM) as asker, suppress(OSError):
            asker.connect(remote)
            routed = str(asker.getsockname()[0])
            if routed in own:
                return routed
        if not own:
            raise OSError(f"there is no way to {remote[0]}")
        return own[0]


BINDING: ContextVar[Binding] = ContextVar("BINDING")
"""Of the path for which a task, and those that it starts, open sockets."""


class SocketLoop(asyncio.SelectorEventLoop):
    """An event loop whose UDP sockets are `OwnSocket`, where `BINDING` is set."""

    async def create_datagram_endpoint(  # type: ignore[override]
        self,
        protocol_factory: Callable[[], asyncio.DatagramProtocol],
        local_addr: Address | None = None,
        remote_addr: Address | None = None,
        **options: Any,
    ) -> tuple[asyncio.DatagramTransport, asyncio.DatagramProtocol]:
        binding = BINDING.get(None)
        if binding is None or options:
            return await super().create_datagram_endpoint(
                protocol_factory, local_addr=local_addr, remote_addr=remote_addr, **options
            )
        named = remote_addr or local_addr
        assert named is not None
        family, *_, numeric = (await self.getaddrinfo(named[0], named[1], type=socket.SOCK_DGRAM))[0]
        remote = None if remote_addr is None else (str(numeric[0]), int(numeric[1]))
        made, interface = binding.open(family, local_addr, remote)
        transport = OwnSocket(self, made, protocol_factory(), remote, interface)
        binding.sockets.append(transport)
        return transport, transport.protocol
