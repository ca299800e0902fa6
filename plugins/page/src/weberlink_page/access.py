"""Access control of the monitor: Host and Origin headers, and the token of who may change something.

A web server on a loopback address can be reached by every page in the user's browser. The check of the Host header
prevents DNS rebinding (a foreign name that resolves to 127.0.0.1); that of the Origin header, requests of other pages.
Every user of this host can reach such a server, so only who has the token may change anything.
"""

import socket
from collections.abc import Collection
from contextlib import suppress
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path
from secrets import token_urlsafe
from tempfile import NamedTemporaryFile

from weberlink.text import is_loopback

_TOKEN_BYTES = 16
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


def names(listen: str) -> frozenset[str] | None:
    """Host names that a request may use; None for any address, since all of them are served."""
    ip = _ip(listen)
    if ip is not None and ip.is_unspecified:
        return None
    return (LOCAL_NAMES if is_loopback(listen) else frozenset()) | {listen.lower()}


def refusal(host: str | None, origin: str | None, allowed: Collection[str] | None) -> str | None:
    """Why a request is refused; None if it names this server and comes from no other page.

    The port of the Host header is ignored: it differs behind a forwarder, and the name shows an attacker's page. The
    Origin header is what browsers always send to a WebSocket and with a POST. `allowed`: see `names`.
    """
    name = _host(host)
    if name is None or not (
        name in allowed
        if allowed is not None
        else name in LOCAL_NAMES or name == socket.gethostname().lower() or _ip(name) is not None
    ):
        return "unknown host name; use the address that weberlink monitor printed"
    if origin is not None and origin.lower() != f"http://{str(host).lower()}":
        return "requests from other pages are not allowed"
    return None


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
    """A secret of 128 bits: who has it may drive, change and stop."""
    return token_urlsafe(_TOKEN_BYTES)


def kept_token(folder: Path) -> str:
    """The token of this user's monitors, made if there is none: a page stops a session after a restart of its monitor.
    The folder is of this user alone, in memory; the token changes with the next start of the host.
    """
    path = folder / "monitor-token"
    with suppress(OSError, UnicodeError):
        if len(token := path.read_text(encoding="ascii")) == len(new_token()):
            return token
    with NamedTemporaryFile("w", encoding="ascii", dir=folder, delete=False) as file:  # mode 0600, complete when named
        file.write(token := new_token())
    Path(file.name).replace(path)
    return token
