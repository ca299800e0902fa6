"""Access control of the monitor: Host and Origin headers, local users, and fair limits on connections.

A web server on a loopback address can be reached by every page in the user's browser. The check of the Host header
prevents DNS rebinding (a foreign name that resolves to 127.0.0.1); that of the Origin header, requests of other pages.
"""

import os
import socket
import struct
from collections.abc import Collection, Hashable
from ipaddress import IPv4Address, IPv6Address, ip_address, ip_network
from pathlib import Path
from secrets import token_urlsafe
from typing import Generic, TypeVar

Guest = TypeVar("Guest", bound=Hashable)
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
    """Whether an address (or `localhost`) can be reached from this host only."""
    if address == "localhost":
        return True
    ip = _ip(address)
    return ip is not None and ip.is_loopback


def names(listen: str) -> frozenset[str] | None:
    """Host names that a request may use; None for any address, since all of them are served."""
    ip = _ip(listen)
    if ip is not None and ip.is_unspecified:
        return None
    return (LOCAL_NAMES if is_loopback(listen) else frozenset()) | {listen.lower()}


def host_allowed(header: str | None, allowed: Collection[str] | None) -> bool:
    """Whether a Host header names this server.

    The port is ignored: it differs behind a forwarder, and the name identifies an attacker's page.

    Args:
        header: host, with or without a port.
        allowed: see `names`.
    """
    host = _host(header)
    if host is None:
        return False
    if allowed is not None:
        return host in allowed
    return host in LOCAL_NAMES or host == socket.gethostname().lower() or _ip(host) is not None


def origin_allowed(origin: str | None, host: str | None) -> bool:
    """Whether a request comes from a page of this server, or from no page (browsers always send Origin)."""
    return origin is None or (host is not None and origin.lower() == f"http://{host.lower()}")


def user_of(peer: object, own: object, tables: Path = Path("/proc/net")) -> int | None:
    """User id of the peer's process; None if it is on another host.

    Every user of this host can reach a loopback address. The kernel's socket table names the owner of each socket.

    Args:
        peer, own: addresses of the two ends, as `getpeername` and `getsockname` give them.
        tables: folder of the kernel's tables.
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
    """Whether this is the user of this process, or root."""
    return user in (0, os.getuid())


def _entry(end: tuple[object, ...]) -> str:
    """An address as the kernel's table writes it: words in the host's byte order."""
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


def new_token() -> str:
    """A secret that only pages that may change something are told; 128 bits."""
    return token_urlsafe(16)


class Admission(Generic[Guest]):
    """Limits the number of guests. A newcomer always gets in and may expel a guest of the largest group.

    A plain limit would let whoever fills it lock out all others.

    Args:
        most: guests at a time.
        most_of_group: guests of one group, such as a host.
    """

    def __init__(self, most: int, most_of_group: int) -> None:
        self._most = most
        self._most_of_group = most_of_group
        self._groups: dict[Guest, Hashable] = {}

    def admit(self, guest: Guest, group: Hashable) -> Guest | None:
        """Let a guest in.

        Returns:
            The guest to expel: the oldest of its group if that is full, else the oldest of the largest group if all
            places are taken; None if there is room.
        """
        self._groups[guest] = group
        if self.count(group) > self._most_of_group:
            return self._expel(group)
        if len(self._groups) > self._most:
            return self._expel(max(self._groups.values(), key=self.count))
        return None

    def leave(self, guest: Guest) -> None:
        """Remove a guest, expelled or not."""
        self._groups.pop(guest, None)

    def count(self, group: Hashable) -> int:
        return sum(each == group for each in self._groups.values())

    def _expel(self, group: Hashable) -> Guest:
        oldest = next(guest for guest, its_group in self._groups.items() if its_group == group)
        del self._groups[oldest]
        return oldest


def origin(address: str) -> str:
    """Group of a client: its IPv4 address, or its IPv6 /64 network, all of which one host may own."""
    ip = ip_address(address.partition("%")[0])
    if isinstance(ip, IPv6Address):
        return str(ip.ipv4_mapped or ip_network((ip, 64), strict=False))
    return str(ip)
