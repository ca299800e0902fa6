"""The web server: the page and its files, WebSocket, list of sessions, metrics for Prometheus."""

import asyncio
import json
from collections import Counter
from collections.abc import Awaitable, Callable, Collection
from contextlib import suppress
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path

from aiohttp import WSCloseCode, WSMsgType, web

from weberlink.apps.monitor import access
from weberlink.apps.monitor.requests import UNPROVEN
from weberlink.apps.monitor.viewer import Viewer, to_json
from weberlink.apps.monitor.watch import SessionWatcher
from weberlink.system.bounded_json import parse
from weberlink.watching.control import refusal

LONGEST_MESSAGE = 4096
"""Longest message of a page [bytes]: it only asks for changes."""
REQUESTS_WAITING = 16
"""Most requests of a page that wait for an earlier one."""
PROOF_HEADER = "X-WeberLink-Token"
MOST_PAGES = 16
"""Pages with the token; nobody without it can take their places."""
MOST_GUESTS = 12
"""Pages without it, which only look."""
HEARTBEAT_S = 20.0
GOODBYE_S = 0.5
"""How long a page may take to close its WebSocket."""
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Site:
    """Routes of the web server and their limits.

    Args:
        watch: sessions to show.
        allowed: names in the Host header, see `access.names`.
        exposition: makes the text for Prometheus, and its content type.
    """

    def __init__(
        self, watch: SessionWatcher, allowed: Collection[str] | None, exposition: Callable[[], tuple[bytes, str]]
    ) -> None:
        self._watch = watch
        self._allowed = allowed
        self._exposition = exposition
        self._page = Path(str(files("weberlink.apps.monitor") / "page")).resolve()
        self._sockets: dict[web.WebSocketResponse, asyncio.Transport | None] = {}
        self._pages = Counter[bool]()
        """How many are open, with the token and without."""

    def application(self) -> web.Application:
        application = web.Application(middlewares=[self._guarded], client_max_size=LONGEST_MESSAGE)
        application.router.add_get("/", self._index)
        application.router.add_static("/assets", self._page)
        application.router.add_get("/api/sessions", self._sessions)
        application.router.add_get("/metrics", self._metrics)
        application.router.add_get("/ws", self._socket)
        application.router.add_post("/api/emergency", self._emergency)
        application.on_shutdown.append(self._close_sockets)
        return application

    @web.middleware
    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        host = request.headers.get("Host")
        if not access.host_allowed(host, self._allowed):
            return _refusal(HTTPStatus.FORBIDDEN, "unknown host name; use the address that weberlink monitor printed")
        if not access.origin_allowed(request.headers.get("Origin"), host):
            return _refusal(HTTPStatus.FORBIDDEN, "requests from other pages are not allowed")
        try:
            response = await handler(request)
        except web.HTTPException as error:
            return _refusal(error.status, error.reason)
        if not response.prepared:
            response.headers.update(access.HEADERS)
        return response

    async def _index(self, _request: web.Request) -> web.StreamResponse:
        return web.FileResponse(self._page / "index.html")

    async def _sessions(self, _request: web.Request) -> web.StreamResponse:
        return web.Response(
            text=json.dumps({"sessions": self._watch.overview()}, allow_nan=False), content_type="application/json"
        )

    async def _metrics(self, _request: web.Request) -> web.StreamResponse:
        body, kind = self._exposition()
        return web.Response(body=body, headers={"Content-Type": kind})

    async def _emergency(self, request: web.Request) -> web.StreamResponse:
        """Stop a session at once, all of this host if none of that name runs: also for a page whose socket is slow."""
        if not self._watch.requests.proves(request.headers.get(PROOF_HEADER)):
            return _refusal(HTTPStatus.FORBIDDEN, UNPROVEN)
        answer = await self._watch.emergency(request.query.get("session"))
        status = HTTPStatus.OK if answer["accepted"] else HTTPStatus.CONFLICT
        return web.Response(status=status, text=to_json(answer), content_type="application/json")

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        if request.transport is None:  # the client has disconnected
            raise web.HTTPServiceUnavailable
        may_change = self._watch.requests.proves(request.query.get("key"))
        if self._pages[may_change] >= (MOST_PAGES if may_change else MOST_GUESTS):
            raise web.HTTPServiceUnavailable
        self._pages[may_change] += 1
        try:
            return await self._show(request, may_change=may_change)
        finally:
            self._pages[may_change] -= 1

    async def _show(self, request: web.Request, *, may_change: bool) -> web.StreamResponse:
        """Serve a page until it leaves."""
        socket = web.WebSocketResponse(max_msg_size=LONGEST_MESSAGE, heartbeat=HEARTBEAT_S, compress=False)
        await socket.prepare(request)
        viewer = Viewer(request.query.get("session"), may_change=may_change)
        self._sockets[socket] = request.transport
        self._watch.join(viewer)
        waiting: asyncio.Queue[object] = asyncio.Queue(REQUESTS_WAITING)
        loop = asyncio.get_running_loop()
        tasks = [loop.create_task(_send(viewer, socket)), loop.create_task(self._answer_in_turn(viewer, waiting))]
        try:
            await self._listen(viewer, socket, waiting)
        finally:
            self._watch.leave(viewer)
            self._sockets.pop(socket, None)
            for task in tasks:
                task.cancel()
                with suppress(asyncio.CancelledError, ConnectionError):
                    await task
        return socket

    async def _listen(self, viewer: Viewer, socket: web.WebSocketResponse, waiting: "asyncio.Queue[object]") -> None:
        """Take the messages of a page until it leaves: answer those that are urgent, and queue the others."""
        async for message in socket:
            if message.type is not WSMsgType.TEXT:
                break
            try:
                document = parse(message.data.encode(), LONGEST_MESSAGE)
            except ValueError:
                document = None
            if self._watch.requests.is_urgent(document):
                await self._answer(viewer, document)
                continue
            try:
                waiting.put_nowait(document)
            except asyncio.QueueFull:
                viewer.answer(to_json(refusal("too many requests at once; this one is dropped")))

    async def _answer_in_turn(self, viewer: Viewer, waiting: "asyncio.Queue[object]") -> None:
        while True:
            await self._answer(viewer, await waiting.get())

    async def _answer(self, viewer: Viewer, document: object) -> None:
        answer = await self._watch.requests.answer(viewer, document)
        if answer is None:
            return
        if answer["type"] == "handle":
            viewer.put("handle", to_json(answer))
        else:
            viewer.answer(to_json(answer))

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


def _refusal(status: int, reason: str) -> web.Response:
    return web.Response(status=status, text=f"{reason}\n", headers=access.HEADERS)
