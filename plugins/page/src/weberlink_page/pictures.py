"""The pictures of a session (`weberlink_figures.pictures`) for pages, over a WebSocket. A slow page skips pictures.

A message is a picture as it came, with its age when it is sent [s] in the place of its moment.
"""

import asyncio
from contextlib import suppress
from pathlib import Path
from time import monotonic

from aiohttp import WSCloseCode, web

from weberlink.config.cameras import path_beside
from weberlink.order import SIDES
from weberlink_figures.pictures import Picture, pack, split
from weberlink_figures.watching.session import WatchedSession
from weberlink_page.watch import SessionWatcher

MOST_VIEWS = 16
HEARTBEAT_S = 20.0
AGAIN_S = 0.5  # between two tries to reach who serves the pictures
READ_BYTES = 1 << 18


class PictureService:
    """Serves the pictures of sessions to pages."""

    def __init__(self, watch: SessionWatcher) -> None:
        self._watch = watch
        self._pages: set[web.WebSocketResponse] = set()

    async def serve(self, request: web.Request) -> web.StreamResponse:
        """Send pictures to a page until it leaves."""
        if len(self._pages) >= MOST_VIEWS:
            raise web.HTTPServiceUnavailable
        session = self._watch.sessions.get(request.query.get("session", ""))
        if session is None:
            raise web.HTTPNotFound
        page = web.WebSocketResponse(max_msg_size=1024, heartbeat=HEARTBEAT_S, compress=False)
        await page.prepare(request)
        self._pages.add(page)
        sender = asyncio.get_running_loop().create_task(_show(session, page))
        try:
            async for _ in page:
                pass  # a page has nothing to say here
        finally:
            self._pages.discard(page)
            sender.cancel()
            with suppress(asyncio.CancelledError, ConnectionError):
                await sender
        return page

    async def close(self) -> None:
        """End all views."""
        for page in list(self._pages):
            with suppress(TimeoutError, ConnectionError):
                async with asyncio.timeout(0.5):
                    await page.close(code=WSCloseCode.GOING_AWAY, message=b"the monitor ends")


async def _show(session: WatchedSession, page: web.WebSocketResponse) -> None:
    """Send the pictures of a session, from the side of the operator where it has any."""
    while not session.ended:
        for side in (side for side in SIDES if side in session.sources):
            with suppress(OSError, ValueError):
                await _pass_on(path_beside(session.sources[side].ring), page)
        await asyncio.sleep(AGAIN_S)


async def _pass_on(path: Path, page: web.WebSocketResponse) -> None:
    """Send the newest picture of each camera again and again, until there are no more."""
    reader, writer = await asyncio.open_unix_connection(str(path), limit=READ_BYTES)
    newest: dict[str, Picture] = {}
    came = asyncio.Event()

    async def read() -> None:
        rest = b""
        while data := await reader.read(READ_BYTES):
            pictures, rest = split(rest + data)
            newest.update((picture.camera, picture) for picture in pictures)
            came.set()

    reading = asyncio.create_task(read())
    reading.add_done_callback(lambda _: came.set())
    try:
        while not reading.done():
            await came.wait()
            came.clear()
            while newest:
                picture = newest.pop(next(iter(newest)))
                await page.send_bytes(pack(picture._replace(at=monotonic() - picture.at)))
        reading.result()
    finally:
        reading.cancel()
        writer.close()
