"""Both ends of our WebSocket, and what may go wrong with it."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread
from time import monotonic
from typing import Any

import pytest
from websockets.sync.server import ServerConnection, serve

from tests.hardware.test_ports import Noting
from tests.wait import PATIENCE, until
from weberlink.hardware.emulator import Emulator
from weberlink.hardware.fault import HardwareFault
from weberlink_devices.inverse3.websocket_device import WebSocketDevice
from weberlink_devices.inverse3.websocket_port import WebSocketPort, text_frame


class Echo(Emulator):
    """A service and its only session: says hello, then sends back what it hears, in upper case."""

    def __init__(self) -> None:
        super().__init__()
        self.left = 0

    def join(self, now: float) -> "Echo":
        self.leaving = [b"hello"]
        return self

    def receive(self, text: bytes, now: float) -> None:
        self.leaving.append(text.upper())

    def leave(self) -> None:
        self.left += 1

    def get(self, path: str) -> str | None:
        return None

    def drops_connections(self) -> bool:
        return False


@contextmanager
def port_to(address: str) -> Iterator[WebSocketPort]:
    port = WebSocketPort(address, PATIENCE)
    yield port
    port.close()
    port.close()


def heard(port: WebSocketPort, count: int) -> list[bytes | None]:
    return [port.receive(monotonic() + PATIENCE) for _ in range(count)]


def test_both_our_ends_talk_and_part_and_a_guardian_is_told_of_each_force_and_of_each_rest() -> None:
    """It writes on the same connection."""
    service, done, zero = Echo(), list[Any](), text_frame("zero")
    with WebSocketDevice(service) as wire:
        with port_to(wire.address) as port:
            port.guard(Noting(done, zero))
            port.send("rest", rest=True)
            port._socket.send(zero)
            port.send("force", rest=False)
            assert heard(port, 4) == [b"hello", b"REST", b"ZERO", b"FORCE"]
            assert port.receive(monotonic()) is None
        until(lambda: service.left == 1, "the session to end")
    size = len(text_frame("force"))
    told = [each if isinstance(each, str) else (each[0], len(each[1])) for each in done]
    assert told == ["watches", ("after", len(zero)), ("before", size), ("after", size), "stopped"]


def test_a_server_that_compresses_pings_and_closes() -> None:
    long = "x" * 100_000

    def echo(line: ServerConnection) -> None:
        line.ping()
        line.send("hello")
        while (text := str(line.recv())) != "bye":
            line.send(text.upper())

    with serve(echo, "127.0.0.1", 0) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        with port_to(f"ws://127.0.0.1:{server.socket.getsockname()[1]}") as port:
            port.send(long, rest=True)
            assert heard(port, 2) == [b"hello", long.upper().encode()]
            port.send("bye", rest=True)
            for use in (lambda: port.receive(monotonic() + PATIENCE), lambda: port.send("more", rest=True)):
                with pytest.raises(HardwareFault, match="closed the connection"):
                    use()
        server.shutdown()
        thread.join()


NO_WEBSOCKET = "answers, but not as a WebSocket"


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n", NO_WEBSOCKET),
        (b"SSH-2.0-OpenSSH_9.2\r\n", NO_WEBSOCKET),
        (b"", "accepts the connection, but does not answer"),
    ],
)
def test_what_is_no_websocket_is_named(answer: bytes, says: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"ws://127.0.0.1:{server.getsockname()[1]}"

        def serve() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(1000)
                connection.sendall(answer)
                connection.recv(1000)

        thread = Thread(target=serve)
        thread.start()
        with pytest.raises(HardwareFault, match=f"^{address}: {says}"):
            WebSocketPort(address, PATIENCE if answer else 0.2)
        thread.join()
    with pytest.raises(HardwareFault, match="expected ws://HOST:PORT"):
        WebSocketPort("http://localhost:1", 0.1)
