"""Who may ask what of the monitor: host names, origins, users, and the headers that keep a page to itself.

A web server on a loopback address is open to every page in the user's browser. Against a page that has its own name
resolve to 127.0.0.1 (DNS rebinding) stands the check of the Host header: an address, or a name of this host. Against
one that connects from its own origin stands the check of the Origin header.
"""

import os
import socket
import struct
from collections.abc import Collection
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path

LOCAL_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-cache",
}


def is_loopback(address: str) -> bool:
    """Whether an address, or `localhost`, is reached from this host only."""
    if address == "localhost":
        return True
    ip = _ip(address)
    return ip is not None and ip.is_loopback


def names(listen: str) -> frozenset[str] | None:
    """The host names that a request may use; None where any address will do, since all of them are served."""
    ip = _ip(listen)
    if ip is not None and ip.is_unspecified:
        return None
    return (LOCAL_NAMES if is_loopback(listen) else frozenset()) | {listen.lower()}


def host_allowed(header: str | None, allowed: Collection[str] | None) -> bool:
    """Whether a Host header names this server.

    The port is not looked at: a forwarded one differs, and an attacker's page is told by its name.

    Args:
        header: as sent, host with or without a port.
        allowed: as of `names`.
    """
    host = _host(header)
    if host is None:
        return False
    if allowed is not None:
        return host in allowed
    return host in LOCAL_NAMES or host == socket.gethostname().lower() or _ip(host) is not None


def origin_allowed(origin: str | None, host: str | None) -> bool:
    """Whether a request comes from a page of this server, or from no page at all; browsers always say."""
    return origin is None or (host is not None and origin.lower() == f"http://{host.lower()}")


def user_of(peer: object, own: object, tables: Path = Path("/proc/net")) -> int | None:
    """The user whose process has the other end of a TCP connection; None where that is not a process of this host.

    A loopback address is open to every user of the host, and only one of them runs the daemons. The kernel's table of
    sockets says who owns which.

    Args:
        peer, own: addresses of the two ends, as `getpeername` and `getsockname` give them.
        tables: where the kernel's tables are.
    """
    if not (isinstance(peer, tuple) and isinstance(own, tuple)):
        return None
    address = _ip(str(peer[0]).partition("%")[0])
    if address is None or not (address.is_loopback or peer[0] == own[0]):
        return None
    table = tables / ("tcp" if address.version == 4 else "tcp6")
    wanted = (_entry(peer), _entry(own))
    try:
        lines = table.read_text(encoding="ascii").splitlines()[1:]
    except OSError:
        return None
    for line in lines:
        columns = line.split()
        if (columns[1], columns[2]) == wanted:
            return int(columns[7])
    return None


def is_own(user: int | None) -> bool:
    """Whether a user, as of `user_of`, is the one of this process, or root."""
    return user in (0, os.getuid())


def _entry(end: tuple[object, ...]) -> str:
    """An end of a connection as the kernel's table writes it: words of the address in the host's byte order."""
    packed = ip_address(str(end[0]).partition("%")[0]).packed
    words = struct.unpack(f"!{len(packed) // 4}I", packed)
    port = end[1]
    assert isinstance(port, int)
    return "".join(f"{socket.ntohl(word):08X}" for word in words) + f":{port:04X}"


def _host(header: str | None) -> str | None:
    """The host of a Host header, in lower case and without brackets."""
    if not header or "@" in header or "/" in header:
        return None
    if header.startswith("["):
        inner, bracket, rest = header[1:].partition("]")
        return inner.lower() if bracket and (not rest or (rest[0] == ":" and rest[1:].isdigit())) else None
    host, colon, port = header.partition(":")
    return host.lower() if not colon or port.isdigit() else None


def _ip(text: str) -> IPv4Address | IPv6Address | None:
    try:
        return ip_address(text)
    except ValueError:
        return None
