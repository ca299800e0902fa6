"""Both ends of our WebSocket, each against another implementation (aiohttp), and what may go wrong with it."""

import asyncio
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread
from time import monotonic

import pytest
from aiohttp import ClientSession, WSMsgType, web

from tests.hardware.scripted import wait_for
from weberlink.hardware.emulator import WireFaults
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.websocket_device import WebSocketDevice
from weberlink.hardware.websocket_port import WebSocketPort, text_frame

PATIENCE_S = 5.0


class EchoSession:
    """Says hello, then sends back what it hears, in upper case."""

    def __init__(self, service: "Echo") -> None:
        self._service = service
        self._waiting = [b"hello"]

    def receive(self, text: bytes, now: float) -> None:
        self._waiting.append(text.upper())

    def replies(self, now: float) -> list[bytes]:
        waiting, self._waiting = self._waiting, []
        return waiting

    def next_timer(self) -> float | None:
        return None

    def leave(self) -> None:
        self._service.left += 1


class Echo:
    def __init__(self) -> None:
        self.faults = WireFaults()
        self.left = 0
        self.drops = False

    def join(self, now: float) -> EchoSession:
        return EchoSession(self)

    def advance(self, now: float) -> None: ...

    def next_timer(self) -> float | None:
        return None

    def get(self, path: str) -> str | None:
        return '{"version": 1}' if path == "/version" else None

    def drops_connections(self) -> bool:
        drops, self.drops = self.drops, False
        return drops


def soon() -> float:
    return monotonic() + PATIENCE_S


def test_both_our_ends_talk_and_part() -> None:
    service = Echo()
    with WebSocketDevice(service) as wire:
        port = WebSocketPort(wire.address, PATIENCE_S)
        assert port.receive(soon()) == b"hello"
        port.send("one", rest=True)
        port.send("two", rest=False)
        assert [port.receive(soon()), port.receive(soon())] == [b"ONE", b"TWO"]
        assert port.receive(monotonic()) is None
        port.close()
        port.close()
        wait_for(lambda: service.left == 1)


def test_device_serves_a_client_of_aiohttp() -> None:
    async def talk(address: str) -> list[str]:
        async with ClientSession() as session, session.ws_connect(address) as line:
            await line.send_str("one")
            await line.ping()
            heard = [(await line.receive_str()), (await line.receive_str())]
            async with session.get(address.replace("ws:", "http:") + "/version") as answer:
                heard.append(await answer.text())
        return heard

    with WebSocketDevice(Echo()) as wire:
        assert asyncio.run(talk(wire.address)) == ["hello", "ONE", '{"version": 1}']


@contextmanager
def aiohttp_server() -> Iterator[str]:
    """A WebSocket of aiohttp, which compresses where the client offers it; gives its address."""

    async def echo(request: web.Request) -> web.WebSocketResponse:
        line = web.WebSocketResponse()
        await line.prepare(request)
        await line.ping()
        await line.send_str("hello")
        async for message in line:
            if message.type is WSMsgType.TEXT and message.data == "bye":
                break
            await line.send_str(message.data.upper())
        await line.close()
        return line

    loop = asyncio.new_event_loop()
    sock = socket.create_server(("127.0.0.1", 0))
    application = web.Application()
    application.router.add_get("/", echo)
    runner = web.AppRunner(application)

    def serve() -> None:
        loop.run_until_complete(runner.setup())
        loop.run_until_complete(web.SockSite(runner, sock).start())
        loop.run_forever()
        loop.run_until_complete(runner.cleanup())
        loop.close()

    thread = Thread(target=serve)
    thread.start()
    try:
        yield f"ws://127.0.0.1:{sock.getsockname()[1]}"
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()


def test_port_talks_to_a_server_of_aiohttp() -> None:
    with aiohttp_server() as address:
        port = WebSocketPort(address, PATIENCE_S)
        assert port.receive(soon()) == b"hello"
        long = "x" * 100_000
        port.send(long, rest=True)
        assert port.receive(soon()) == long.upper().encode()
        port.send("bye", rest=True)
        with pytest.raises(HardwareFault, match="closed the connection"):
            port.receive(soon())
        with pytest.raises(HardwareFault, match="closed the connection"):
            port.send("more", rest=True)
        port.close()


def test_frame_written_beside_the_port_is_understood() -> None:
    """As a guardian process writes it, on its own descriptor of the same connection."""
    with WebSocketDevice(Echo()) as wire:
        port = WebSocketPort(wire.address, PATIENCE_S)
        frame = text_frame("zero")
        port.send("one", rest=True)
        port._socket.send(frame)
        port.send("two", rest=True)
        assert [port.receive(soon()) for _ in range(4)] == [b"hello", b"ONE", b"ZERO", b"TWO"]
        port.close()


def test_closed_connections_are_faults_and_a_port_stays_the_same() -> None:
    service = Echo()
    with WebSocketDevice(service) as wire:
        address = wire.address
        for disconnect in (lambda: setattr(service, "drops", True), wire.unplug):
            port = WebSocketPort(address, PATIENCE_S)
            disconnect()
            with pytest.raises(HardwareFault, match=f"{address}: closed the connection"):
                while True:
                    assert port.receive(soon()) is not None
            port.close()
        with pytest.raises(HardwareFault, match="nothing listens there"):
            WebSocketPort(address, PATIENCE_S)
        wire.plug()
        assert wire.address == address
        WebSocketPort(address, PATIENCE_S).close()


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n", "answers, but not as a WebSocket"),
        (b"SSH-2.0-OpenSSH_9.2\r\n", "answers, but not as a WebSocket"),
        (b"", "accepts the connection, but does not answer"),
    ],
)
def test_what_is_no_websocket_is_named(answer: bytes, said: str) -> None:
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
        with pytest.raises(HardwareFault, match=said) as caught:
            WebSocketPort(address, 0.2)
        assert str(caught.value).startswith(address)
        thread.join()


def test_address_that_is_none_is_a_fault() -> None:
    with pytest.raises(HardwareFault, match="expected ws://HOST:PORT"):
        WebSocketPort("http://localhost:1", 0.1)
