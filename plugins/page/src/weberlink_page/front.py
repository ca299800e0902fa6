"""The front of the page's server, a process that does nothing else: it accepts connections, and stops sessions.

It looks at the first bytes of a connection without taking them. It answers `POST /api/emergency` itself; every other
connection it passes on to the monitor, whose responses close their connections: so the next request begins a new one,
which comes here first. Whatever strangers open, and whatever keeps the monitor busy, costs a stop neither a descriptor
nor a turn.
"""

import json
import resource
import socket
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from hmac import compare_digest
from http import HTTPStatus
from http.client import HTTPException, parse_headers
from io import BytesIO
from ipaddress import IPv6Address, ip_address
from math import isfinite
from selectors import EVENT_READ, EVENT_WRITE, DefaultSelector
from time import monotonic
from typing import Any, Generic, TypeVar
from urllib.parse import parse_qs, urlsplit

from weberlink.session.emergency import EmergencyStop, Scope
from weberlink_page import access

EMERGENCY = "/api/emergency"
PROOF_HEADER = "X-WeberLink-Token"
UNPROVEN = "this is not the token of the monitor; open the address that it printed"
BEGIN = f"POST {EMERGENCY}".encode()
MOST_SILENT = 64  # connections that have sent nothing yet
MOST_PASSING = 64  # connections that wait for a busy monitor
MOST_ASKING = 16  # connections that ask for a stop
MOST_ARMED = 16  # stops that are not acknowledged yet; the newest ones concern what the others do
DESCRIPTORS = 1024
RECEIVE_BYTES = 8192
"""Of a connection that is passed on: half of what the monitor reads of a page in one turn of its loop."""
LONGEST_REQUEST = 8192
REQUEST_S = 2.0  # how long an emergency request may take to come
ANSWER_S = 0.5
"""How long daemons may take to acknowledge, before the page is told that they have not; they are asked on and on."""
LONGEST_AGE_MS = 60_000.0  # of the press of a button whose request is repeated
LOOK_S, LOOK_LATE_S = 0.002, 0.02  # time between two looks for an answer, at first and after `ANSWER_S`
CONNECTION, STOPPED = b"connection", b"stopped "
"""How messages to the monitor begin: one with a descriptor, and one with the moment of a stop."""
T = TypeVar("T")


@dataclass(frozen=True)
class FrontOrder:
    """What the front serves: host names, see `access.names`; the token; the sessions that it may stop."""

    allowed: list[str] | None
    token: str
    scope: Scope


class Crowd(Generic[T]):
    """Connections of anybody, with the addresses that they come from; only the newest are kept."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._from: dict[T, bytes] = {}

    def add(self, connection: T, host: str) -> T | None:
        """Returns the one that must go for it: the oldest of the network with the most, which is not an honest one."""
        ip = ip_address(host)
        ip = (ip.ipv4_mapped or ip) if isinstance(ip, IPv6Address) else ip
        self._from[connection] = ip.packed[:8]  # an IPv6 network has 64 bits
        if len(self._from) <= self._most:
            return None
        (worst, _), *_ = Counter(self._from.values()).most_common(1)
        oldest = next(each for each, network in self._from.items() if network == worst)
        del self._from[oldest]
        return oldest

    def __len__(self) -> int:
        return len(self._from)

    def __iter__(self) -> Iterator[T]:
        return iter(self._from)

    def remove(self, connection: T) -> bool:
        """Whether it was there."""
        return self._from.pop(connection, None) is not None

    def forget(self, is_over: Callable[[T], bool]) -> None:
        """Remove those that are over."""
        self._from = {each: network for each, network in self._from.items() if not is_over(each)}


@dataclass
class _Armed:
    """A stop until every side has acknowledged it, and who waits to hear."""

    stop: EmergencyStop
    answer: Callable[[dict[str, Any]], None] | None
    answer_by: float

    def finish(self) -> None:
        """Tell who waits how it stands."""
        if self.answer is not None:
            self.answer(self.stop.answer())
            self.answer = None


@dataclass
class _Asking:
    """A connection that asks for a stop: what has come of its request, and until when the rest must come."""

    connection: socket.socket
    by: float
    data: bytes = b""


class Front:
    """Serves until the monitor closes its end of the channel."""

    def __init__(self, listening: socket.socket, channel: socket.socket, order: FrontOrder) -> None:
        self._listening, self._channel, self._order = listening, channel, order
        self._selector = DefaultSelector()
        self._silent, self._passing = Crowd[socket.socket](MOST_SILENT), Crowd[socket.socket](MOST_PASSING)
        self._asking: dict[socket.socket, _Asking] = {}
        self._armed: list[_Armed] = []
        for each in (listening, channel):
            each.setblocking(False)
        self._selector.register(listening, EVENT_READ, self._accept)
        self._selector.register(channel, EVENT_READ, self._flush)

    def run(self) -> None:
        while True:
            late = all(armed.answer is None for armed in self._armed)
            wait = None if not self._asking else REQUEST_S
            for key, ready in self._selector.select((LOOK_LATE_S if late else LOOK_S) if self._armed else wait):
                if key.fileobj is self._channel and ready & EVENT_READ:  # it only ends
                    return
                with suppress(OSError):  # it has ended meanwhile
                    key.data(key.fileobj)
            self._advance(monotonic())

    def _advance(self, now: float) -> None:
        for armed in self._armed[:]:
            is_done = armed.stop.advance(now)
            if is_done or now > armed.answer_by:
                armed.finish()
            if is_done:
                self._armed.remove(armed)
        for asking in [each for each in self._asking.values() if now > each.by]:
            self._drop(asking.connection)

    # --- connections

    def _accept(self, _: socket.socket) -> None:
        connection, (host, *_) = self._listening.accept()
        connection.setblocking(False)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, len(BEGIN))  # readable with that many bytes
        self._selector.register(connection, EVENT_READ, self._on_begin)
        if (evicted := self._silent.add(connection, host)) is not None:
            self._drop(evicted)

    def _drop(self, connection: socket.socket) -> None:
        self._forget(connection)
        connection.close()

    def _forget(self, connection: socket.socket) -> None:
        self._selector.unregister(connection)
        self._silent.remove(connection)
        self._asking.pop(connection, None)

    def _on_begin(self, connection: socket.socket) -> None:
        if not self._silent.remove(connection):  # closed for a newer one in this turn
            return
        try:
            is_stop = connection.recv(len(BEGIN), socket.MSG_PEEK) == BEGIN
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, 1)
        except OSError:
            self._drop(connection)
            return
        if not is_stop:
            self._pass_on(connection)
            return
        if len(self._asking) >= MOST_ASKING:
            self._drop(next(iter(self._asking)))
        self._asking[connection] = _Asking(connection, monotonic() + REQUEST_S)
        self._selector.modify(connection, EVENT_READ, self._on_request)
        self._on_request(connection)  # a whole request waits for nobody

    def _pass_on(self, connection: socket.socket) -> None:
        self._forget(connection)
        try:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
            evicted = self._passing.add(connection, connection.getpeername()[0])
        except OSError:
            evicted = connection
        if evicted is not None:
            evicted.close()
        self._flush(self._channel)

    def _flush(self, channel: socket.socket) -> None:
        """Pass on what the monitor takes; the rest waits for it."""
        for connection in list(self._passing):
            try:
                socket.send_fds(channel, [CONNECTION], [connection.fileno()])
            except BlockingIOError:
                break
            self._passing.remove(connection)
            connection.close()
        self._selector.modify(channel, EVENT_READ | (EVENT_WRITE if self._passing else 0), self._flush)

    # --- a stop

    def _on_request(self, connection: socket.socket) -> None:
        asking = self._asking.get(connection)
        if asking is None:  # closed for a newer one in this turn
            return
        try:
            data = connection.recv(LONGEST_REQUEST)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        asking.data += data
        head, end, _ = asking.data.partition(b"\r\n\r\n")
        if end:
            self._forget(connection)
            self._on_head(connection, head + end)
        elif not data or len(asking.data) > LONGEST_REQUEST:
            self._drop(connection)

    def _on_head(self, connection: socket.socket, head: bytes) -> None:
        line, _, rest = head.partition(b"\r\n")
        target = urlsplit(line.split(b" ")[1].decode("latin-1"))
        query = {name: values[0] for name, values in parse_qs(target.query).items()}
        try:
            headers = parse_headers(BytesIO(rest))
            age_ms = float(query.get("age_ms", "0"))
        except (HTTPException, ValueError) as error:
            return _send(connection, HTTPStatus.BAD_REQUEST, f"{error}\n", "text/plain")
        why = access.refusal(headers["Host"], headers["Origin"], self._order.allowed)
        if why is None and not compare_digest((headers[PROOF_HEADER] or "").encode(), self._order.token.encode()):
            why = UNPROVEN
        if why is not None:
            return _send(connection, HTTPStatus.FORBIDDEN, f"{why}\n", "text/plain")
        if target.path != EMERGENCY:
            return _send(connection, HTTPStatus.NOT_FOUND, "Not Found\n", "text/plain")
        self._stop(connection, query.get("session"), age_ms)
        return None

    def _stop(self, connection: socket.socket, name: str | None, age_ms: float) -> None:
        now = monotonic()
        at = now - (1e-3 * min(max(age_ms, 0.0), LONGEST_AGE_MS) if isfinite(age_ms) else 0.0)

        def answer(told: dict[str, Any]) -> None:
            status = HTTPStatus.OK if told["accepted"] else HTTPStatus.CONFLICT
            _send(connection, status, json.dumps({"type": "answer"} | told), "application/json")

        if len(self._armed) >= MOST_ARMED:
            oldest = self._armed.pop(0)
            oldest.finish()
            oldest.stop.close()
        self._armed.append(_Armed(EmergencyStop(self._order.scope, name, at), answer, now + ANSWER_S))
        self._advance(now)  # before anything else
        with suppress(OSError):  # a monitor that stands still starts nothing
            self._channel.send(STOPPED + repr(at).encode())


def _send(connection: socket.socket, status: HTTPStatus, text: str, kind: str) -> None:
    """Answer, and close the connection."""
    body = text.encode()
    fields = access.HEADERS | {
        "Content-Type": f"{kind}; charset=utf-8",
        "Content-Length": str(len(body)),
        "Connection": "close",
    }
    head = f"HTTP/1.1 {status.value} {status.phrase}\r\n" + "".join(f"{name}: {fields[name]}\r\n" for name in fields)
    with connection, suppress(OSError):
        connection.send(f"{head}\r\n".encode() + body)


def main(listening: str, channel: str) -> None:
    """Serve what the first message on the channel orders; the arguments are descriptors."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, min(hard, DESCRIPTORS)), hard))
    link = socket.socket(fileno=int(channel))
    order = json.loads(link.recv(LONGEST_REQUEST))
    scope = Scope(**order.pop("scope"))
    Front(socket.socket(fileno=int(listening)), link, FrontOrder(**order, scope=scope)).run()


if __name__ == "__main__":
    main(*sys.argv[1:])
