"""UDP sockets: their addresses and options, as the system takes them.

An address of an endpoint is a host and a port. The host of a link-local IPv6 address has its zone behind it, as a
number: "fe80::1%2" (RFC 4007 section 11). The same address may be there in every zone, one for each network interface,
and the system takes it with its zone only.
"""

import asyncio
import socket
from contextlib import suppress
from errno import EADDRINUSE
from typing import Any, Final

from weberlink.compiled import mypyc_attr
from weberlink.protocol.events import Address

Ancillary = list[tuple[int, int, bytes]]
"""Level, kind and data of what the system gives or takes beside a datagram."""
ANCILLARY_BYTES: Final = socket.CMSG_SPACE(20)
"""Enough for a class of service or a called address."""
ECN_BITS: Final = 2
"""Lowest bits of the type-of-service octet (RFC 3168); the class of service is above them (RFC 2474)."""
_PKTINFO: Final = 8
"""IP_PKTINFO of <netinet/in.h>, which Python 3.11 does not name."""


@mypyc_attr(native_class=False)
class AddressInUseError(OSError):
    """Another program holds the UDP port."""


def address_of(name: Any) -> Address:
    """The address of a socket's name, as the system gives it: (host, port), or (host, port, flow, zone) for IPv6."""
    if len(name) == 4 and name[3]:
        return f"{name[0].partition('%')[0]}%{name[3]}", name[1]
    return name[0], name[1]


def name_of(address: Address) -> Any:
    """The name of a socket at an address, as the system takes it."""
    host, percent, zone = address[0].partition("%")
    return (host, address[1], 0, int(zone)) if percent else address


def numeric(address: Address) -> str:
    """An address for people: host:port."""
    host, port = address
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


async def resolve(
    loop: asyncio.AbstractEventLoop, address: Address, family: int, *, passive: bool
) -> tuple[socket.AddressFamily, Address]:
    """The family and the numeric address of a name; `passive` to listen there.

    Raises:
        OSError: if it does not resolve.
    """
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


def bind(family: socket.AddressFamily, local: Address) -> socket.socket:
    """A socket at this address of this host.

    Raises:
        AddressInUseError: if another program has the port.
        OSError: if it is no address of this host.
    """
    bound = socket.socket(family, socket.SOCK_DGRAM)
    try:
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


def connected_twin(bound: socket.socket, own_host: str, peer: Address) -> socket.socket:
    """A second socket on the port and the network interface of a bound one, connected to a peer.

    `own_host` is the address of this host that the peer knows, or "" for the one at which the first socket is bound.

    Raises:
        OSError: if the system refuses it.
    """
    twin = socket.socket(bound.family, socket.SOCK_DGRAM)
    try:
        twin.setblocking(False)
        twin.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        interface = bound.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
        if interface.strip(b"\0"):
            twin.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface)
        own = bound.getsockname()
        twin.bind((own_host, *own[1:]) if own_host else own)
        twin.connect(name_of(peer))
    except OSError:
        twin.close()
        raise
    return twin


def set_option(of: socket.socket, ipv4: int, ipv6: int, value: int) -> None:
    """Set an option of IP; a system that refuses it carries the datagrams all the same."""
    level, option = (socket.IPPROTO_IPV6, ipv6) if of.family == socket.AF_INET6 else (socket.IPPROTO_IP, ipv4)
    with suppress(OSError):
        of.setsockopt(level, option, value)


def mark(bound: socket.socket, dscp: int) -> None:
    """Ask for a class of service."""
    set_option(bound, socket.IP_TOS, socket.IPV6_TCLASS, dscp << ECN_BITS)


def ask_for_class(connected: socket.socket) -> None:
    """Have the class of service delivered with each datagram."""
    set_option(connected, socket.IP_RECVTOS, socket.IPV6_RECVTCLASS, 1)


def ask_for_destination(bound: socket.socket) -> None:
    """Have the called address delivered with each datagram, if the socket is bound to all addresses."""
    if bound.getsockname()[0] in ("0.0.0.0", "::"):  # noqa: S104 - asks
        set_option(bound, _PKTINFO, socket.IPV6_RECVPKTINFO, 1)


def answering(ancillary: Ancillary) -> tuple[str, Ancillary]:
    """The address of this host that was called, and what is sent beside an answer so that it leaves from there."""
    ((level, kind, value),) = ancillary
    # The interface is left to the system: 4 bytes before the address, behind it in IPv6.
    if level == socket.IPPROTO_IPV6:
        return socket.inet_ntop(socket.AF_INET6, value[:16]), [(level, kind, value[:16] + bytes(4))]
    return socket.inet_ntop(socket.AF_INET, value[8:12]), [(level, kind, bytes(4) + value[4:])]
