"""The monitor's web server with sessions that a test scripts: what pages are told, and what they ask."""

import asyncio
import json
from collections.abc import Callable, Coroutine
from types import SimpleNamespace
from typing import Any, Self

from aiohttp import web

from tests.wait import loop_in_a_thread
from weberlink_page import access
from weberlink_page.viewer import Viewer
from weberlink_page.web import Handler, Site

Message = dict[str, Any]


class ScriptedServer:
    """Serves the page on a loopback port in a thread; stands in for `SessionWatcher`.

    `greeting` are the messages to a page that connects; `answer` replies to its requests.
    """

    def __init__(self) -> None:
        self.greeting: list[Message] = []
        self.sessions: list[Message] = []
        self.answer: Callable[[Message], Message | None] = lambda _: None
        self.asked: list[Message] = []
        self.posted: list[tuple[str, str | None]] = []  # paths of requests by POST with their queries, and tokens
        self.followed: list[str | None] = []
        self.viewers: list[Viewer] = []
        self.pictures: list[bytes] = []  # messages to a page that asks for pictures
        self.port = 0
        self._runner: web.AppRunner | None = None
        self._thread = loop_in_a_thread()

    def __enter__(self) -> Self:
        self._loop = self._thread.__enter__()
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._thread.__exit__(None, None, None)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def start(self) -> None:
        async def start() -> None:
            site = Site(self, access.names("127.0.0.1"), lambda: (b"", "text/plain"))  # type: ignore[arg-type]
            application = site.application()
            application.middlewares.append(self._answered)
            self._runner = web.AppRunner(application, access_log=None, handle_signals=False, shutdown_timeout=1.0)
            await self._runner.setup()
            await web.TCPSite(self._runner, "127.0.0.1", self.port, reuse_address=True).start()
            self.port = int(self._runner.addresses[0][1])

        self._wait(start())

    def stop(self) -> None:
        if self._runner is not None:
            self._wait(self._runner.cleanup())
            self._runner = None

    def say(self, *messages: Message) -> None:
        async def say() -> None:
            for viewer in self.viewers:
                self._put(viewer, messages)

        self._wait(say())

    def join(self, viewer: Viewer) -> None:
        self.followed.append(viewer.pinned)
        self._put(viewer, self.greeting)
        self.viewers.append(viewer)

    def leave(self, viewer: Viewer) -> None:
        self.viewers.remove(viewer)

    def overview(self) -> list[Message]:
        return self.sessions

    @property
    def requests(self) -> SimpleNamespace:
        return SimpleNamespace(
            read=lambda _, text: json.loads(text), answer=self._take, proves=lambda _: False, token=""
        )

    async def _take(self, viewer: Viewer, document: Any) -> Message:
        self.asked.append(document)
        return self.answer(document) or {"type": "nothing"}

    def _put(self, viewer: Viewer, messages: Any) -> None:
        for message in messages:
            viewer.put("rows", message)

    def _wait(self, work: Coroutine[Any, Any, None]) -> None:
        asyncio.run_coroutine_threadsafe(work, self._loop).result(30.0)

    @web.middleware
    async def _answered(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if request.method == "POST":
            self.posted.append((request.path_qs, request.headers.get("X-WeberLink-Token")))
            answer = self.answer({"type": request.path})
            return web.json_response(answer, status=200 if answer and answer["accepted"] else 403)
        if request.path == "/view":
            view = web.WebSocketResponse()
            await view.prepare(request)
            for picture in self.pictures:
                await view.send_bytes(picture)
            async for _ in view:
                pass
            return view
        return await handler(request)
