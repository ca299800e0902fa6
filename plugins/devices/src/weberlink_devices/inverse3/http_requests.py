"""HTTP requests to the Haply Inverse Service: its version, and its devices."""

from collections.abc import Iterator
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit

from weberlink.bounded_json import parse
from weberlink_devices.inverse3.protocol import ids_in, version_in

PORT = 10001
FORMER_PORT = 10000
"""Port of HTTP in services before 3.5."""
PATIENCE_S = 0.5
LONGEST = 1 << 20
"""Of an answer [bytes]."""


def service_version(address: str) -> tuple[int, int] | None:
    """Version (major, minor) of the service at the address of its WebSocket; None if it does not say."""
    return next(filter(None, map(version_in, _answers(address, "/version"))), None)


def service_devices(address: str) -> tuple[str, ...]:
    """Ids of the devices that it lists; none if it does not answer."""
    return tuple(next(filter(None, map(ids_in, _answers(address, "/devices"))), ()))


def _answers(address: str, path: str) -> Iterator[Any]:
    """The JSON that its ports answer."""
    from http.client import HTTPConnection, HTTPException  # noqa: PLC0415 - only hosts with such a device need it

    parts = urlsplit(address)
    for port in (parts.port or 80, *([FORMER_PORT] if parts.port == PORT else [])):
        connection = HTTPConnection(parts.hostname or "localhost", port, timeout=PATIENCE_S)
        with suppress(OSError, HTTPException, ValueError):
            connection.request("GET", path)
            answer = connection.getresponse()
            yield parse(answer.read(LONGEST), LONGEST)
        connection.close()
