"""A server that tells the page what a test hands it, and remembers what it asks: the contract without a session."""

import asyncio
import json
import threading
from collections.abc import Callable
from concurrent.futures import Future
from importlib.resources import files
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from aiohttp import WSMsgType, web

T = TypeVar("T")
Message = dict[str, Any]

PAGE = Path(str(files("weberlink.apps.monitor") / "page"))
STRICT = {"Content-Security-Policy": "default-src 'self'"}
KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}


class ScriptedServer:
    """Serves the page on a loopback port while it is entered.

    `greeting` are the messages that a page gets when it connects; `answer` makes the reply to what it asks.
    """

    def __init__(self) -> None:
        self.greeting: list[Message] = []
        self.sessions: list[Message] = []
        self.answer: Callable[[Message], Message | None] = lambda _: None
        self.asked: list[Message] = []
        self.followed: list[str | None] = []
        self.port = 0
        self._sockets: set[web.WebSocketResponse] = set()
        self._runner: web.AppRunner | None = None
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.stop()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    @property
    def pages(self) -> int:
        """How many are connected."""
        return len(self._sockets)

    def start(self) -> None:
        """Serve, on the same port as before if there was one."""
        self._wait(self._start())

    def stop(self) -> None:
        """Leave as a process does that ends."""
        self._wait(self._stop())

    def say(self, *messages: Message) -> None:
        """To every page."""
        self._wait(self._say(messages))

    def _wait(self, work: Any) -> None:
        done: Future[None] = asyncio.run_coroutine_threadsafe(work, self._loop)
        done.result(30.0)

    async def _start(self) -> None:
        application = web.Application()
        application.router.add_get("/", self._file)
        application.router.add_get("/assets/{path:.+}", self._file)
        application.router.add_get("/api/sessions", self._list)
        application.router.add_get("/ws", self._socket)
        self._runner = web.AppRunner(application, access_log=None, handle_signals=False, shutdown_timeout=1.0)
        await self._runner.setup()
        await web.TCPSite(self._runner, "127.0.0.1", self.port, reuse_address=True).start()
        self.port = int(self._runner.addresses[0][1])

    async def _stop(self) -> None:
        for socket in list(self._sockets):
            await socket.close()
        if self._runner is not None:
            await self._runner.cleanup()
            self._runner = None

    async def _say(self, messages: tuple[Message, ...]) -> None:
        for message in messages:
            for socket in list(self._sockets):
                await socket.send_str(json.dumps(message, allow_nan=False))

    async def _file(self, request: web.Request) -> web.StreamResponse:
        path = PAGE / request.match_info.get("path", "index.html")
        if not path.is_file():
            raise web.HTTPNotFound
        return web.Response(body=path.read_bytes(), headers={"Content-Type": KINDS[path.suffix], **STRICT})

    async def _list(self, _request: web.Request) -> web.StreamResponse:
        return web.json_response({"sessions": self.sessions}, headers=STRICT)

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        socket = web.WebSocketResponse()
        await socket.prepare(request)
        self.followed.append(request.query.get("session"))
        for message in self.greeting:
            await socket.send_str(json.dumps(message, allow_nan=False))
        self._sockets.add(socket)
        try:
            async for frame in socket:
                if frame.type is WSMsgType.TEXT:
                    asked = json.loads(frame.data)
                    self.asked.append(asked)
                    reply = self.answer(asked)
                    if reply is not None:
                        await socket.send_str(json.dumps(reply, allow_nan=False))
        finally:
            self._sockets.discard(socket)
        return socket
