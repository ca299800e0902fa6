"""Addresses of sockets and those of endpoints, which are a host and a port.

The host of a link-local IPv6 address has its zone behind it, as a number: "fe80::1%2" (RFC 4007 section 11). The same
address may be there in every zone, one for each network interface, and the system takes it with its zone only.
"""

from typing import Any

from weberlink.protocol.events import Address


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
