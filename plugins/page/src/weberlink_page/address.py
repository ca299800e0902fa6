"""Where the page is served: the listening socket, and the addresses by which it is opened.

It imports little, so that an address can be printed before the server is ready; who opens it at once waits.
"""

import socket
from errno import EADDRINUSE, EADDRNOTAVAIL
from ipaddress import ip_address

BACKLOG = socket.SOMAXCONN  # connections that wait to be accepted: who finds no place asks again after a second
ELSEWHERE = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}
"""Addresses for documentation (RFC 5737, RFC 3849): a route to them is one to other hosts."""


class MonitorError(RuntimeError):
    """The monitor cannot serve; the message says what to do."""


def bind(listen: str, port: int, *, or_any: bool = False) -> socket.socket:
    """Listen for pages at a port, 0 for any that is free; another one will do if it is in use and `or_any`. Raises
    MonitorError if the address or the port cannot be used.
    """
    try:
        family = socket.getaddrinfo(listen, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0][0]
        try:
            return socket.create_server((listen, port), family=family, backlog=BACKLOG)
        except OSError as error:
            if error.errno == EADDRINUSE and or_any:
                return socket.create_server((listen, 0), family=family, backlog=BACKLOG)
            raise
    except OSError as error:
        raise MonitorError(_complaint(error, listen, port)) from None


def url(listening: socket.socket, key: str) -> str:
    """What the user of this host opens. A browser sends the part behind # to nobody; the page reads the key."""
    host, port = listening.getsockname()[:2]
    is_any = ip_address(host.partition("%")[0]).is_unspecified  # which a browser cannot open
    return _url(("::1" if ":" in host else "127.0.0.1") if is_any else host, port, key)


def public_url(listening: socket.socket, key: str) -> str:
    """The same for users of other hosts."""
    host, port = listening.getsockname()[:2]
    if ip_address(host.partition("%")[0]).is_unspecified:
        host = _own_address(listening.family) or socket.gethostname()
    return _url(host, port, key)


def _own_address(family: int) -> str | None:
    """The address of this host on its way to others; None without a route."""
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((ELSEWHERE[socket.AddressFamily(family)], 9))  # sends nothing
        except OSError:
            return None
        return str(probe.getsockname()[0])


def _url(host: str, port: int, key: str) -> str:
    return f"http://{f'[{host}]' if ':' in host else host}:{port}/#key={key}"


def _complaint(error: OSError, listen: str, port: int) -> str:
    if error.errno == EADDRINUSE:
        return f"port {port} is in use, perhaps by another monitor; give another, such as --port {port + 1}"
    if error.errno == EADDRNOTAVAIL or isinstance(error, socket.gaierror):
        return f"--listen {listen}: not an address of this host; omit it to serve this host only"
    return f"--listen {listen}, --port {port}: cannot be served ({error.strerror or error})"
