"""An emulated device behind a service: several clients on a loopback WebSocket, and answers to HTTP GET on its port."""

import socket
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from select import select
from time import monotonic
from typing import Protocol

from websockets.frames import Frame, Opcode
from websockets.http11 import Request
from websockets.protocol import State
from websockets.server import ServerProtocol

from weberlink.hardware.emulator import WireFaults
from weberlink.testing.serving import LONGEST_PAUSE_S, ServedDevice

CHUNK = 65536
LOOPBACK = "127.0.0.1"


class ServiceSession(Protocol):
    """One client of an emulated service, without I/O; the methods are as of `weberlink.hardware.emulator.Emulator`."""

    def receive(self, text: bytes, now: float) -> None: ...

    def replies(self, now: float) -> list[bytes]: ...

    def next_timer(self) -> float | None: ...

    def leave(self) -> None:
        """The connection is closed."""
        ...


class Service(Protocol):
    """An emulated service, without I/O, likewise."""

    faults: WireFaults

    def join(self, now: float) -> ServiceSession: ...

    def advance(self, now: float) -> None: ...

    def next_timer(self) -> float | None: ...

    def get(self, path: str) -> str | None:
        """The body that answers an HTTP GET; None for a path that it does not have."""
        ...

    def drops_connections(self) -> bool:
        """Whether it has just closed all connections, as a service does that is started again."""
        ...


class _Client:
    """A connection: HTTP first, then a session."""

    def __init__(self, connection: socket.socket, service: Service) -> None:
        self.socket = connection
        self.protocol = ServerProtocol()
        self.session: ServiceSession | None = None
        self._service = service
        self._parts: list[bytes] = []
        self._leaving: deque[tuple[float, bytes]] = deque()

    def hear(self, now: float) -> bool:
        """Take what has come; False once the connection is over."""
        try:
            data = self.socket.recv(CHUNK)
        except BlockingIOError:
            return True
        except OSError:
            data = b""
        if not data:
            return False
        self.protocol.receive_data(data)
        for event in self.protocol.events_received():
            if isinstance(event, Request):
                self._admit(event, now)
            elif isinstance(event, Frame) and event.opcode in (Opcode.TEXT, Opcode.BINARY, Opcode.CONT):
                self._parts.append(bytes(event.data))
                if event.fin and self.session is not None:
                    text = b"".join(self._parts)
                    self._parts.clear()
                    self.session.receive(text, now)
        return self._flush() and not self.protocol.close_expected()

    def say(self, now: float) -> bool:
        """Send what is due, with the faults of the wire; False once the connection is over."""
        faults = self._service.faults
        for reply in self.session.replies(now) if self.session is not None else []:
            if not faults.silent:
                self._leaving.append((now + faults.late_s, _garbled(reply, faults)))
        while self._leaving and self._leaving[0][0] <= now:
            if self.protocol.state is not State.OPEN:
                return False
            self.protocol.send_text(self._leaving.popleft()[1])
        return self._flush()

    def next_timer(self) -> float | None:
        due = [] if self.session is None else [self.session.next_timer()]
        return min(filter(None, [*due, self._leaving[0][0] if self._leaving else None]), default=None)

    def close(self) -> None:
        if self.session is not None:
            self.session.leave()
        self.socket.close()

    def _admit(self, request: Request, now: float) -> None:
        body = self._service.get(request.path)
        response = self.protocol.accept(request) if body is None else self.protocol.reject(HTTPStatus.OK, body)
        self.protocol.send_response(response)
        if self.protocol.state is State.OPEN:
            self.session = self._service.join(now)

    def _flush(self) -> bool:
        try:
            for data in self.protocol.data_to_send():
                if data and self.socket.send(data) < len(data):
                    return False  # the client does not read
        except OSError:
            return False
        return True


def _garbled(reply: bytes, faults: WireFaults) -> bytes:
    """Half of the reply: TCP changes no byte, but a program may write nonsense."""
    if faults.garble <= 0:
        return reply
    faults.garble -= 1
    return reply[: len(reply) // 2]


class WebSocketDevice(ServedDevice):
    """A service at `address`.

    Args:
        emulator: the service; only the thread that serves it calls its methods.
        port: of TCP; 0 for a free one, which stays the same after every `unplug`.
        begin: see `ServedDevice`.
    """

    def __init__(self, emulator: Service, port: int = 0, *, begin: Callable[[], object] = lambda: None) -> None:
        super().__init__(begin)
        self.emulator = emulator
        self._port = port
        self._listener: socket.socket | None = None
        self._clients: list[_Client] = []

    @property
    def address(self) -> str:
        """ws://HOST:PORT, known once it was plugged."""
        return f"ws://{LOOPBACK}:{self._port}"

    def _connect(self) -> None:
        self._listener = socket.create_server((LOOPBACK, self._port))
        self._listener.setblocking(False)
        self._port = self._listener.getsockname()[1]

    def _disconnect(self) -> None:
        assert self._listener is not None
        self._listener.close()
        self._drop(self._clients)

    def _serve(self) -> None:
        while not self._stopping.is_set():
            now = monotonic()
            self.emulator.advance(now)
            if self.emulator.drops_connections():
                self._drop(self._clients)
            self._drop([client for client in self._clients if not client.say(now)])
            self._wait()

    def _wait(self) -> None:
        """Wait until something arrives, or the next timer is due."""
        due = [self.emulator.next_timer(), *(client.next_timer() for client in self._clients)]
        at = min((each for each in due if each is not None), default=None)
        pause = LONGEST_PAUSE_S if at is None else min(LONGEST_PAUSE_S, max(0.0, at - monotonic()))
        listener = self._listener
        assert listener is not None
        ready, _, _ = select((listener, *(client.socket for client in self._clients)), (), (), pause)
        if listener in ready:
            self._accept(listener)
        now = monotonic()
        self._drop([client for client in self._clients if client.socket in ready and not client.hear(now)])

    def _accept(self, listener: socket.socket) -> None:
        with suppress(OSError):
            connection, _ = listener.accept()
            connection.setblocking(False)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._clients.append(_Client(connection, self.emulator))

    def _drop(self, clients: list[_Client]) -> None:
        for client in list(clients):
            client.close()
            self._clients.remove(client)
