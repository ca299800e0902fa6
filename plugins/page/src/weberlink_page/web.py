"""The web server: the page and its files, WebSocket, list of sessions, metrics for Prometheus."""

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable, Collection
from contextlib import suppress
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from time import monotonic
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from weberlink_figures.watching.control import refusal
from weberlink_page import access
from weberlink_page.front import Crowd
from weberlink_page.requests import LONGEST_MESSAGE, URGENT
from weberlink_page.viewer import Viewer, to_json
from weberlink_page.watch import SessionWatcher

MOST_PER_S = 250.0  # most messages of a page that are taken [1/s], pings among them; one that drives sends 125
BURST_S = 0.1  # how long a page may have sent nothing to catch up afterwards [s]
REQUESTS_WAITING = 16  # most requests of a page that wait for an earlier one
MOST_PAGES = 16  # pages with the token; nobody without it can take their places
MOST_GUESTS = 12  # pages without it, which only look
MOST_UNPROVEN = 64  # connections without it, those of guests among them
HEARTBEAT_S = 20.0
GOODBYE_S = 0.5  # how long a page may take to close its WebSocket
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Site:
    """Routes of the web server and their limits. The emergency stop is a request to `weberlink_page.front`.

    Args:
        watch: sessions to show.
        allowed: names in the Host header, see `access.names`.
        exposition: makes the text for Prometheus, and its content type.

    Attributes:
        unproven: connections that have not shown the key.
    """

    def __init__(
        self, watch: SessionWatcher, allowed: Collection[str] | None, exposition: Callable[[], tuple[bytes, str]]
    ) -> None:
        self.unproven = Crowd[asyncio.Transport](MOST_UNPROVEN)
        self._watch = watch
        self._allowed = allowed
        self._exposition = exposition
        self._page = Path(str(files("weberlink_page") / "page")).resolve()
        self._sockets: dict[web.WebSocketResponse, asyncio.Transport | None] = {}
        self._pages = Counter[bool]()  # how many are open, with the token and without

    def application(self) -> web.Application:
        application = web.Application(middlewares=[self._guarded], client_max_size=LONGEST_MESSAGE)
        application.router.add_get("/", self._index)
        application.router.add_static("/assets", self._page)
        application.router.add_get("/api/sessions", self._sessions)
        application.router.add_get("/metrics", self._metrics)
        application.router.add_get("/ws", self._socket)
        application.on_shutdown.append(self._close_sockets)
        return application

    @web.middleware
    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        why = access.refusal(request.headers.get("Host"), request.headers.get("Origin"), self._allowed)
        try:
            response = await handler(request) if why is None else _error(HTTPStatus.FORBIDDEN, why)
        except web.HTTPException as error:
            response = _error(error.status, error.reason)
        if not response.prepared:
            response.headers.update(access.HEADERS)
            response.force_close()  # the next request may be the emergency stop, see the front
        return response

    async def _index(self, _request: web.Request) -> web.StreamResponse:
        # Read as a whole: a file response that is cancelled before it begins leaves its file open.
        return web.Response(text=(self._page / "index.html").read_text("utf-8"), content_type="text/html")

    async def _sessions(self, _request: web.Request) -> web.StreamResponse:
        return web.Response(text=to_json({"sessions": self._watch.overview()}), content_type="application/json")

    async def _metrics(self, _request: web.Request) -> web.StreamResponse:
        body, kind = self._exposition()
        return web.Response(body=body, headers={"Content-Type": kind})

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        """Serve a page until it leaves."""
        may_change = self._watch.requests.proves(request.query.get("key"))
        if request.transport is None or self._pages[may_change] >= (MOST_PAGES if may_change else MOST_GUESTS):
            raise web.HTTPServiceUnavailable
        self._pages[may_change] += 1
        if may_change:
            self.unproven.remove(request.transport)
        socket = web.WebSocketResponse(
            max_msg_size=LONGEST_MESSAGE, heartbeat=HEARTBEAT_S, compress=False, autoping=False
        )
        tasks: list[asyncio.Task[None]] = []
        viewer = Viewer(request.query.get("session"), may_change=may_change)
        try:
            await socket.prepare(request)
            self._sockets[socket] = request.transport
            self._watch.join(viewer)
            waiting: asyncio.Queue[dict[str, Any]] = asyncio.Queue(REQUESTS_WAITING)
            loop = asyncio.get_running_loop()
            tasks = [loop.create_task(_send(viewer, socket)), loop.create_task(self._answer_in_turn(viewer, waiting))]
            await self._listen(viewer, socket, waiting)
        finally:
            self._pages[may_change] -= 1
            self._watch.leave(viewer)
            self._sockets.pop(socket, None)
            for task in tasks:
                task.cancel()
                with suppress(asyncio.CancelledError, ConnectionError):
                    await task
        return socket

    async def _listen(
        self, viewer: Viewer, socket: web.WebSocketResponse, waiting: "asyncio.Queue[dict[str, Any]]"
    ) -> None:
        """Take the messages of a page until it leaves: answer those that are urgent, and queue the others."""
        due = 0.0
        async for message in socket:
            if message.type is WSMsgType.PING:
                await socket.pong(message.data)
            elif message.type is WSMsgType.TEXT:
                await self._on_request(viewer, self._watch.requests.read(viewer, message.data), waiting)
            elif message.type is not WSMsgType.PONG:
                break
            # One message a turn of the loop. What comes faster than may be waits in the page; what a busy loop has let
            # wait is taken in the next turns.
            due = max(due, monotonic() - BURST_S) + 1.0 / MOST_PER_S
            await asyncio.sleep(max(0.0, due - monotonic()))

    async def _on_request(
        self, viewer: Viewer, request: dict[str, Any], waiting: "asyncio.Queue[dict[str, Any]]"
    ) -> None:
        if request["type"] == "answer":
            viewer.answer(request)
        elif request["type"] in URGENT:
            await self._answer(viewer, request)
        elif waiting.full():
            viewer.answer(refusal("too many requests at once; this one is dropped"))
        else:
            waiting.put_nowait(request)

    async def _answer_in_turn(self, viewer: Viewer, waiting: "asyncio.Queue[dict[str, Any]]") -> None:
        while True:
            await self._answer(viewer, await waiting.get())

    async def _answer(self, viewer: Viewer, request: dict[str, Any]) -> None:
        answer = await self._watch.requests.answer(viewer, request)
        if answer is not None:
            viewer.answer(answer)

    async def _close_sockets(self, _application: web.Application) -> None:
        """Close all WebSockets; a page that does not read is not waited for."""
        await asyncio.gather(*(_hang_up(socket, transport) for socket, transport in self._sockets.items()))


async def _hang_up(socket: web.WebSocketResponse, transport: asyncio.Transport | None) -> None:
    with suppress(TimeoutError, ConnectionError):
        async with asyncio.timeout(GOODBYE_S):
            await socket.close(code=WSCloseCode.GOING_AWAY, message=b"the monitor ends")
            return
    if transport is not None:
        transport.abort()


async def _send(viewer: Viewer, socket: web.WebSocketResponse) -> None:
    async for text in viewer.messages():
        await socket.send_str(text)


def _error(status: int, reason: str) -> web.Response:
    return web.Response(status=status, text=f"{reason}\n")
