"""Accepts the connections of the page in a thread of its own, so that an emergency stop never waits for the event loop.

The thread looks at the first bytes of a connection without taking them. It answers `POST /api/emergency` itself, in one
more thread; every other connection goes to the web server in the loop, whose responses close their connections: so the
next request begins a new one, which comes here first.
"""

import asyncio
from collections.abc import Callable, Collection
from contextlib import suppress
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from selectors import EVENT_READ, DefaultSelector
from socket import MSG_PEEK, SHUT_RDWR, SO_RCVLOWAT, SOL_SOCKET, socket
from threading import Thread
from time import sleep
from typing import Any
from urllib.parse import parse_qs, urlsplit

from weberlink.watching.control import Answer
from weberlink_page import access
from weberlink_page.requests import UNPROVEN, Requests
from weberlink_page.viewer import to_json

EMERGENCY = "/api/emergency"
PROOF_HEADER = "X-WeberLink-Token"
BEGIN = f"POST {EMERGENCY}".encode()
MOST_SILENT = 64
"""Connections that have sent nothing yet; of more, the oldest one is closed."""
ACCEPT_AGAIN_S = 0.05
REQUEST_S = 2.0
"""How long the rest of an emergency request may take to come."""


class Listener:
    """Takes connections until it is closed.

    Args:
        listening: where pages connect.
        serve: makes the protocol of a connection in the loop.
        allowed: names in the Host header, see `access.names`.
        requests: knows the token.
        emergency: stops the session of a name, see `SessionControl.emergency`.
    """

    def __init__(
        self,
        listening: socket,
        serve: Callable[[], asyncio.BaseProtocol],
        allowed: Collection[str] | None,
        requests: Requests,
        emergency: Callable[[str | None], Answer],
    ) -> None:
        self._listening = listening
        self._serve = serve
        self._handler = partial(_Emergency, allowed, requests, emergency)
        self._loop = asyncio.get_running_loop()
        self._tasks: set[asyncio.Task[Any]] = set()
        self._closing = False
        self._thread = Thread(target=self._run, name="listener", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing = True
        with suppress(OSError):
            self._listening.shutdown(SHUT_RDWR)  # wakes the thread
        self._thread.join()
        self._listening.close()

    def _run(self) -> None:
        self._listening.setblocking(False)
        silent: dict[int, socket] = {}
        with DefaultSelector() as selector:
            selector.register(self._listening, EVENT_READ)
            while not self._closing:
                for key, _ in selector.select():
                    if key.fileobj is self._listening:
                        try:
                            connection, _ = self._listening.accept()
                        except OSError:  # no more files, or the end
                            sleep(ACCEPT_AGAIN_S)
                            continue
                        connection.setsockopt(SOL_SOCKET, SO_RCVLOWAT, len(BEGIN))  # readable with that many bytes
                        silent[connection.fileno()] = connection
                        selector.register(connection, EVENT_READ)
                    elif (waiting := silent.pop(key.fd, None)) is not None:  # else closed for a newer one in this round
                        connection = waiting
                        selector.unregister(connection)
                        try:
                            self._assign(connection)
                        except OSError:  # it has ended meanwhile
                            connection.close()
                    if len(silent) > MOST_SILENT:
                        oldest = silent.pop(next(iter(silent)))
                        selector.unregister(oldest)
                        oldest.close()
        for connection in silent.values():
            connection.close()

    def _assign(self, connection: socket) -> None:
        if connection.recv(len(BEGIN), MSG_PEEK) == BEGIN:
            connection.settimeout(REQUEST_S)
            Thread(target=_answer, args=(self._handler, connection), daemon=True).start()
        else:
            connection.setsockopt(SOL_SOCKET, SO_RCVLOWAT, 1)
            self._loop.call_soon_threadsafe(self._hand_over, connection)

    def _hand_over(self, connection: socket) -> None:
        connection.setblocking(False)
        task = self._loop.create_task(self._loop.connect_accepted_socket(self._serve, connection))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def _answer(handler: Callable[..., object], connection: socket) -> None:
    with connection, suppress(OSError):
        handler(connection, connection.getpeername(), None)


class _Emergency(BaseHTTPRequestHandler):
    """One request for an emergency stop; the name of the session is `?session=`."""

    server_version, sys_version = "weberlink", ""

    def __init__(
        self,
        allowed: Collection[str] | None,
        requests: Requests,
        emergency: Callable[[str | None], Answer],
        *connection: Any,
    ) -> None:
        self._allowed, self._requests, self._emergency = allowed, requests, emergency
        super().__init__(*connection)

    def do_POST(self) -> None:
        why = access.refusal(self.headers.get("Host"), self.headers.get("Origin"), self._allowed)
        if why is None and not self._requests.proves(self.headers.get(PROOF_HEADER)):
            why = UNPROVEN
        target = urlsplit(self.path)
        if target.path != EMERGENCY:
            self._send(HTTPStatus.NOT_FOUND, "Not Found\n", "text/plain")
        elif why is not None:
            self._send(HTTPStatus.FORBIDDEN, f"{why}\n", "text/plain")
        else:
            answer = self._emergency(parse_qs(target.query).get("session", [None])[0])
            status = HTTPStatus.OK if answer["accepted"] else HTTPStatus.CONFLICT
            self._send(status, to_json(answer), "application/json")

    def _send(self, status: HTTPStatus, text: str, kind: str) -> None:
        body = text.encode()
        self.send_response(status)
        for name, value in access.HEADERS.items():
            self.send_header(name, value)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Nothing: who asked is told."""
