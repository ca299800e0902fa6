"""The HTTP side: the page and its files, its WebSocket, the list of sessions, the figures for Prometheus.

Owns routes and their limits. What is shown is the business of `watch`, who may ask that of `guard`.
"""

import asyncio
import json
from collections.abc import Awaitable, Callable, Collection
from contextlib import suppress
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path

from aiohttp import WSCloseCode, WSMsgType, web

from weberlink.apps.monitor import guard
from weberlink.apps.monitor.admission import Admission, origin
from weberlink.apps.monitor.viewer import Kind, Viewer
from weberlink.apps.monitor.watch import Watch, to_json
from weberlink.system.bounded_json import parse

LONGEST_MESSAGE = 4096
"""Of a page, in bytes: it only ever asks for changes."""
MOST_PAGES = 16
"""Of the user of this process, on this host. Nobody else can take their places."""
MOST_OTHERS = 12
MOST_OF_CLIENT = 4
"""Pages of other users and hosts: of all, and of each."""
HEARTBEAT_S = 20.0
GOODBYE_S = 0.5
"""For a page to agree that it is over."""
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".ico": "image/vnd.microsoft.icon",
    ".woff2": "font/woff2",
    ".txt": "text/plain; charset=utf-8",
    ".md": "text/plain; charset=utf-8",
}
"""What is served at all, by the end of its name."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Site:
    """The application.

    Args:
        watch: what is shown.
        allowed: names in the Host header, as of `guard.names`.
        exposition: makes the figures for Prometheus: text and its type.
    """

    def __init__(
        self, watch: Watch, allowed: Collection[str] | None, exposition: Callable[[], tuple[bytes, str]]
    ) -> None:
        self._watch = watch
        self._allowed = allowed
        self._exposition = exposition
        self._page = Path(str(files("weberlink.apps.monitor") / "page")).resolve()
        self._sockets: dict[web.WebSocketResponse, asyncio.Transport | None] = {}
        self._own: set[asyncio.Transport] = set()
        self._others: Admission[asyncio.Transport] = Admission(MOST_OTHERS, MOST_OF_CLIENT)

    def application(self) -> web.Application:
        application = web.Application(middlewares=[self._guarded], client_max_size=LONGEST_MESSAGE)
        application.router.add_get("/", self._index)
        application.router.add_get("/assets/{path:.+}", self._asset)
        application.router.add_get("/api/sessions", self._sessions)
        application.router.add_get("/metrics", self._metrics)
        application.router.add_get("/ws", self._socket)
        application.on_shutdown.append(self._close_sockets)
        return application

    @web.middleware
    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        host = request.headers.get("Host")
        if not guard.host_allowed(host, self._allowed):
            return _refusal(
                HTTPStatus.FORBIDDEN, "this name is not served; use the address that weberlink monitor printed"
            )
        if not guard.origin_allowed(request.headers.get("Origin"), host):
            return _refusal(HTTPStatus.FORBIDDEN, "requests of other pages are not answered")
        try:
            response = await handler(request)
        except web.HTTPException as error:
            return _refusal(error.status, error.reason)
        if not response.prepared:
            response.headers.update(guard.HEADERS)
        return response

    async def _index(self, _request: web.Request) -> web.StreamResponse:
        return self._file("index.html")

    async def _asset(self, request: web.Request) -> web.StreamResponse:
        return self._file(request.match_info["path"])

    def _file(self, name: str) -> web.StreamResponse:
        """A file of the page; not what lies outside of it, not a folder, nothing hidden or of another kind."""
        parts = name.split("/")
        if "\\" in name or "\x00" in name or any(not part or part.startswith(".") for part in parts):
            raise web.HTTPNotFound
        path = self._page.joinpath(*parts)
        kind = TYPES.get(path.suffix)
        if kind is None or not path.is_file() or not path.resolve().is_relative_to(self._page):
            raise web.HTTPNotFound
        return web.Response(body=path.read_bytes(), headers={"Content-Type": kind})

    async def _sessions(self, _request: web.Request) -> web.StreamResponse:
        return web.Response(
            text=json.dumps({"sessions": self._watch.overview()}, allow_nan=False), content_type="application/json"
        )

    async def _metrics(self, _request: web.Request) -> web.StreamResponse:
        body, kind = self._exposition()
        return web.Response(body=body, headers={"Content-Type": kind})

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        transport = request.transport
        if transport is None:  # it has hung up
            raise web.HTTPServiceUnavailable
        user = guard.user_of(transport.get_extra_info("peername"), transport.get_extra_info("sockname"))
        if guard.is_own(user):
            if len(self._own) >= MOST_PAGES:
                raise web.HTTPServiceUnavailable
            self._own.add(transport)
        else:
            client = f"user {user}" if user is not None else origin(request.remote or "::")
            if self._others.count(client) >= MOST_OF_CLIENT:
                raise web.HTTPServiceUnavailable
            expelled = self._others.admit(transport, client)
            if expelled is not None:
                expelled.abort()
        try:
            return await self._show(request, may_change=guard.is_own(user))
        finally:
            self._own.discard(transport)
            self._others.leave(transport)

    async def _show(self, request: web.Request, *, may_change: bool) -> web.StreamResponse:
        """Serve a page until it leaves."""
        socket = web.WebSocketResponse(max_msg_size=LONGEST_MESSAGE, heartbeat=HEARTBEAT_S, compress=False)
        await socket.prepare(request)
        viewer = Viewer(request.query.get("session"), may_change=may_change)
        self._sockets[socket] = request.transport
        self._watch.join(viewer)
        sender = asyncio.get_running_loop().create_task(_send(viewer, socket))
        try:
            await self._listen(viewer, socket)
        finally:
            self._watch.leave(viewer)
            self._sockets.pop(socket, None)
            sender.cancel()
            with suppress(asyncio.CancelledError, ConnectionError):
                await sender
        return socket

    async def _listen(self, viewer: Viewer, socket: web.WebSocketResponse) -> None:
        """Answer what the page sends, one thing after the other, until it leaves."""
        async for message in socket:
            if message.type is not WSMsgType.TEXT:
                break
            try:
                document = parse(message.data.encode(), LONGEST_MESSAGE)
            except ValueError:
                document = None
            viewer.put(Kind.ANSWER, to_json(await self._watch.change(viewer, document)))

    async def _close_sockets(self, _application: web.Application) -> None:
        """Say that it is over; a page that does not read is not waited for."""
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
    return web.Response(status=status, text=f"{reason}\n", headers=guard.HEADERS)
