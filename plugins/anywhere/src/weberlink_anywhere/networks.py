"""Network interfaces of this host: their addresses, which of them lead outside, and when this changes."""

import asyncio
import fcntl
import socket
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import ifaddr

SETTLING_S = 0.25
"""An interface that comes up changes several times within this time: link, address, route."""
_SIOCGIFFLAGS = 0x8913
_UP_AND_RUNNING = 0x1 | 0x40
_LOOPBACK = 0x8
_GROUPS = 0x1 | 0x10 | 0x40 | 0x100 | 0x400
"""RTMGRP_LINK, _IPV4_IFADDR, _IPV4_ROUTE, _IPV6_IFADDR, _IPV6_ROUTE (rtnetlink(7))."""
_ROUTE_UP = 0x1


class Networks(NamedTuple):
    """What this host is connected to now.

    Args:
        addresses: interface by address; of all interfaces but loopback that are up and connected.
        outside: interfaces with a default route, that of the least metric first.
    """

    addresses: dict[str, str]
    outside: tuple[str, ...]

    def of(self, interfaces: Sequence[str]) -> dict[str, str]:
        """The addresses of some interfaces; of all if empty."""
        return {address: name for address, name in self.addresses.items() if not interfaces or name in interfaces}


def look() -> Networks:
    """The networks of this host now; addresses of one link only (IPv6 fe80::) are left out."""
    addresses = {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asker:
        for adapter in ifaddr.get_adapters():
            if not _is_connected(asker, adapter.name):
                continue
            for ip in adapter.ips:
                if isinstance(ip.ip, str):
                    addresses[ip.ip] = adapter.name
                elif ip.ip[2] == 0:
                    addresses[ip.ip[0]] = adapter.name
    connected = set(addresses.values())
    return Networks(addresses, tuple(name for name in _default_routes() if name in connected))


def _is_connected(asker: socket.socket, interface: str) -> bool:
    try:
        answer = fcntl.ioctl(asker, _SIOCGIFFLAGS, struct.pack("16sH14x", interface.encode()[:15], 0))
    except OSError:
        return False
    (flags,) = struct.unpack_from("H", answer, 16)
    return flags & _UP_AND_RUNNING == _UP_AND_RUNNING and not flags & _LOOPBACK


def _default_routes() -> tuple[str, ...]:
    """Interfaces by metric; /proc/net/route and /proc/net/ipv6_route are described in proc(5)."""
    found: list[tuple[int, str]] = []
    with suppress(OSError):
        for line in Path("/proc/self/net/route").read_text("ascii").splitlines()[1:]:
            name, target, _, flags, _, _, metric, mask, *_ = line.split()
            found += [(int(metric), name)] if _is_default(target, mask, flags) else []
    with suppress(OSError):
        for line in Path("/proc/self/net/ipv6_route").read_text("ascii").splitlines():
            target, length, _, _, _, metric, _, _, flags, name = line.split()
            found += [(int(metric, 16), name)] if _is_default(target, length, flags) else []
    return tuple(dict.fromkeys(name for _, name in sorted(found)))


def _is_default(target: str, length: str, flags: str) -> bool:
    return int(target, 16) == int(length, 16) == 0 and bool(int(flags, 16) & _ROUTE_UP)


class Watch:
    """Calls back when the networks of this host have changed, if there is one; `interfaces` count, all if empty."""

    def __init__(self, changed: Callable[[], None], interfaces: Sequence[str] = ()) -> None:
        self._changed = changed
        self._interfaces = interfaces
        self._networks = self._look()
        self._settling: asyncio.TimerHandle | None = None
        self._loop = asyncio.get_running_loop()
        self._socket = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW | socket.SOCK_NONBLOCK, socket.NETLINK_ROUTE)
        self._socket.bind((0, _GROUPS))
        self._loop.add_reader(self._socket, self._heard)

    def close(self) -> None:
        self._loop.remove_reader(self._socket)
        self._socket.close()
        if self._settling is not None:
            self._settling.cancel()

    def _heard(self) -> None:
        """The kernel reports a change; what it is comes out when it is looked at."""
        with suppress(OSError):  # ENOBUFS: reports were lost, and there was a change
            while self._socket.recv(65536):
                pass
        if self._settling is None:
            self._settling = self._loop.call_later(SETTLING_S, self._settled)

    def _settled(self) -> None:
        self._settling = None
        before, self._networks = self._networks, self._look()
        if before != self._networks and self._networks.addresses:
            self._changed()

    def _look(self) -> Networks:
        now = look()
        return Networks(now.of(self._interfaces), now.outside)
