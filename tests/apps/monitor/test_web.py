"""The web server in this process: files, access, limits, and a stalled page."""

import asyncio
import json
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from aiohttp import web

from tests.wait import PATIENCE
from tests.watching.sources import HandSource, records
from weberlink.apps.monitor import access
from weberlink.apps.monitor.listener import MOST_SILENT, PROOF_HEADER, Listener
from weberlink.apps.monitor.metrics import exposition
from weberlink.apps.monitor.requests import LONGEST_MESSAGE
from weberlink.apps.monitor.viewer import MOST_WAITING, Viewer
from weberlink.apps.monitor.watch import SessionWatcher
from weberlink.apps.monitor.web import MOST_GUESTS, MOST_PAGES, REQUESTS_WAITING, Site
from weberlink.watching.session import WatchedSession

Visit = Callable[[aiohttp.ClientSession, str, SessionWatcher], Awaitable[None]]


@asynccontextmanager
async def served() -> AsyncIterator[tuple[str, SessionWatcher]]:
    watch = SessionWatcher(Path("/nonexistent"), None, lambda _: None)
    allowed = access.names("127.0.0.1")
    runner = web.AppRunner(
        Site(watch, allowed, exposition(watch.sessions.values)).application(), access_log=None, shutdown_timeout=0.1
    )
    await runner.setup()
    assert runner.server is not None
    # What is accepted inherits the buffer: a small one, so that what a page does not read waits where it is looked at.
    listening = socket.create_server(("127.0.0.1", 0))
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 16_384)
    where = f"127.0.0.1:{listening.getsockname()[1]}"
    listener = Listener(listening, runner.server, allowed, watch.requests, watch.emergency)
    try:
        yield where, watch
    finally:
        listener.close()
        await runner.cleanup()


def visit(visitor: Visit) -> None:
    async def run() -> None:
        async with asyncio.timeout(PATIENCE), served() as (where, watch), aiohttp.ClientSession() as client:
            await visitor(client, where, watch)

    asyncio.run(run())


async def status(client: aiohttp.ClientSession, url: str, **headers: str) -> int:
    async with client.get(url, headers={name.capitalize(): value for name, value in headers.items()}) as response:
        for name, value in access.HEADERS.items():
            assert response.headers[name] == value
        return response.status


def test_only_files_of_the_page_are_served() -> None:
    async def visitor(client: aiohttp.ClientSession, where: str, _watch: SessionWatcher) -> None:
        url = f"http://{where}"
        async with client.get(url) as response:
            assert response.status == 200 and response.content_type == "text/html"
        assert await status(client, f"{url}/assets/index.html") == 200
        for path in ("assets", "assets/", "assets/vendor", "assets/index", "index.html", "assets/.hidden.js"):
            assert await status(client, f"{url}/{path}") in (403, 404), path
        async with client.post(url) as response:
            assert response.status == 405

    visit(visitor)


@pytest.mark.parametrize(
    "path",
    [
        "/assets/../web.py",
        "/assets/%2e%2e/web.py",
        "/assets/..%2fweb.py",
        "/assets/js/../../web.py",
        "/assets//etc/passwd",
        "/assets/%2fetc%2fpasswd",
        "/assets/..%5cweb.py",
        "/assets/index.html%00.js",
        "/../../etc/passwd",
        "//etc/passwd",
    ],
)
def test_no_path_leads_out_of_the_page(path: str) -> None:
    """By hand: a client tidies such a path up before it asks."""

    async def visitor(_client: aiohttp.ClientSession, where: str, _watch: SessionWatcher) -> None:
        host, port = where.split(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        writer.write(f"GET {path} HTTP/1.1\r\nHost: {where}\r\nConnection: close\r\n\r\n".encode())
        answer = await reader.read()
        writer.close()
        await writer.wait_closed()
        assert answer.split()[1] in (b"404", b"400")

    visit(visitor)


def test_foreign_hosts_and_origins_are_refused() -> None:
    async def visitor(client: aiohttp.ClientSession, where: str, _watch: SessionWatcher) -> None:
        for path in ("", "ws", "metrics", "api/sessions"):
            url = f"http://{where}/{path}"
            assert await status(client, url, host="evil.example") == 403
            assert await status(client, url, origin="http://evil.example") == 403
        for headers in ({"Origin": "http://127.0.0.1:1"}, {"Origin": "null"}, {"Host": "evil.example"}):
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await client.ws_connect(f"http://{where}/ws", headers=headers)
            assert refused.value.status == 403
        socket = await client.ws_connect(f"http://{where}/ws", headers={"Origin": f"http://{where}"})
        await socket.close()

    visit(visitor)


async def heard(page: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
    return json.loads((await page.receive()).data)


def test_page_gets_greeting_rows_and_answers() -> None:
    async def visitor(client: aiohttp.ClientSession, where: str, watch: SessionWatcher) -> None:
        source = HandSource("slave")
        source.description = None
        watch.put(WatchedSession("7", source))
        async with client.get(f"http://{where}/api/sessions") as response:
            (listed,) = (await response.json())["sessions"]
        assert (listed["session"], listed["sides"], listed["live"]) == ("7", ["slave"], True)
        async with client.ws_connect(f"http://{where}/ws?session=7") as page:
            hello = await heard(page)
            assert (hello["type"], hello["session"], hello["rate_hz"]) == ("hello", "7", 1000.0)
            assert [(await heard(page))["type"] for _ in range(2)] == ["handle", "figures"]
            source.put(records(10))
            watch.look(0.0)
            samples = await heard(page)
            assert samples["t"] == [0.0, 0.004, 0.008]
            for sent in ("{", '"x"', "[" * 2000, '{"type":"change","weber":7}'):
                await page.send_str(sent)
                while (answer := await heard(page))["type"] != "answer":
                    pass
                assert answer["accepted"] is False
            await page.send_str("x" * (LONGEST_MESSAGE + 1))
            while not page.closed:
                await page.receive()
            assert page.close_code == aiohttp.WSCloseCode.MESSAGE_TOO_BIG

    visit(visitor)


def test_stalled_page_loses_rows_and_delays_nobody() -> None:
    async def run() -> None:
        async with asyncio.timeout(PATIENCE):
            async with served() as (where, watch):
                source = HandSource("slave")
                watch.put(WatchedSession("7", source))
                _, writer = await asyncio.open_connection("127.0.0.1", int(where.split(":")[1]), limit=1024)
                writer.write(upgrade(where))
                while not watch.viewers:
                    await asyncio.sleep(0.01)
                for look in range(100):
                    made = records(100, first=100 * look)
                    made["sent"] = 1
                    source.put(made)
                    watch.look(0.1 * look)
                    await asyncio.sleep(0)
                (viewer,) = watch.viewers
                assert viewer.lost_rows > 0
                assert len(viewer) <= MOST_WAITING["rows"] + 4
            writer.transport.abort()  # not before: the page is still there when the server ends
            assert watch.viewers == []

    asyncio.run(run())


@pytest.mark.parametrize(("most", "has_key"), [(MOST_PAGES, True), (MOST_GUESTS, False)])
def test_number_of_pages_is_limited(most: int, has_key: bool) -> None:
    async def visitor(client: aiohttp.ClientSession, where: str, watch: SessionWatcher) -> None:
        with_key, without = f"http://{where}/ws?key={watch.requests.token}", f"http://{where}/ws?key=x"
        full, other = (with_key, without) if has_key else (without, with_key)
        pages = [await client.ws_connect(full) for _ in range(most)]
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await client.ws_connect(full)
        assert refused.value.status == 503
        async with client.ws_connect(other):
            assert [viewer.may_change for viewer in watch.viewers] == [has_key] * most + [not has_key]
        for page in pages:
            await page.close()
        while watch.viewers:
            await asyncio.sleep(0.01)
        async with client.ws_connect(full):
            pass

    visit(visitor)


def test_session_and_its_daemons_need_the_token() -> None:
    async def visitor(client: aiohttp.ClientSession, where: str, watch: SessionWatcher) -> None:
        watch.put(WatchedSession("7", HandSource("slave", ring=Path("/nonexistent/weberlink-7-slave.ring"))))
        async with client.ws_connect(f"http://{where}/ws?key={watch.requests.token}") as page:
            token = (await heard(page))["token"]
            for proof, why in (({}, "token"), ({"token": "x"}, "token"), ({"token": token}, "no daemon answers")):
                for asked in (
                    {"type": "change", "weber": 0.1},
                    {"type": "session", "do": "stop"},
                    {"type": "emergency"},
                ):
                    answer = await answered(page, asked | proof)
                    assert answer["accepted"] is False and answer["to"] == asked["type"] and why in answer["why"]

    visit(visitor)


async def answered(page: aiohttp.ClientWebSocketResponse, asked: dict[str, Any]) -> dict[str, Any]:
    await page.send_json(asked)
    while (answer := await heard(page))["type"] != "answer":
        pass
    return answer


@pytest.mark.parametrize(
    ("headers", "status_"),
    [
        ({}, 403),
        ({PROOF_HEADER: "x"}, 403),
        ({PROOF_HEADER: "TOKEN", "Origin": "http://evil.example"}, 403),
        ({PROOF_HEADER: "TOKEN", "Host": "evil.example"}, 403),
        ({PROOF_HEADER: "TOKEN"}, 409),
    ],
)
def test_emergency_by_post_needs_token_and_origin(headers: dict[str, str], status_: int) -> None:
    """It is refused for want of a session once it is permitted."""

    async def visitor(client: aiohttp.ClientSession, where: str, watch: SessionWatcher) -> None:
        sent = {name: value.replace("TOKEN", watch.requests.token) for name, value in headers.items()}
        async with client.post(f"http://{where}/api/emergency", headers=sent) as response:
            assert response.status == status_
            if status_ == 409:
                assert "no running session" in (await response.json())["why"]

    visit(visitor)


def test_emergency_overtakes_a_request_that_waits() -> None:
    async def visitor(client: aiohttp.ClientSession, where: str, watch: SessionWatcher) -> None:
        go_on = asyncio.Event()

        async def slow(_viewer: Viewer, _request: dict[str, Any]) -> dict[str, Any]:
            await go_on.wait()
            return {"accepted": True}

        watch.requests.handlers["change"] = slow
        async with client.ws_connect(f"http://{where}/ws?key={watch.requests.token}") as page:
            proof = {"token": (await heard(page))["token"]}
            for _ in range(REQUESTS_WAITING + 1):  # the first is being answered
                await page.send_json({"type": "change"} | proof)
                await asyncio.sleep(0.01)
            answer = await answered(page, {"type": "emergency"} | proof)
            assert answer["to"] == "emergency"
            assert "too many" in (await answered(page, {"type": "change"} | proof))["why"]
            go_on.set()
            assert (await heard(page))["to"] == "change"

    visit(visitor)


@pytest.mark.parametrize("query", ["", "?key=", "?key=x", "?token=TOKEN", "?key=TOKENx"])
def test_page_without_the_key_changes_nothing(query: str) -> None:
    """Also of the user who runs the monitor, and also with the token in its requests."""

    async def visitor(client: aiohttp.ClientSession, where: str, watch: SessionWatcher) -> None:
        token = watch.requests.token
        watch.put(WatchedSession("7", HandSource("slave", ring=Path("/nonexistent/weberlink-7-slave.ring"))))
        async with client.ws_connect(f"http://{where}/ws{query.replace('TOKEN', token)}") as page:
            hello = await heard(page)
            assert hello["readonly"] is True and hello["token"] is None
            for asked in (
                {"type": "change", "weber": 0.1},
                {"type": "drive", "target": [0.0, 0.0, 0.0], "held": True},
                {"type": "session", "do": "start"},
                {"type": "session", "do": "stop"},
                {"type": "emergency"},
            ):
                answer = await answered(page, asked | {"token": token})
                assert answer["accepted"] is False and "read-only" in answer["why"]
        async with client.get(f"http://{where}/api/emergency?key={token}") as response:
            assert response.status == 404

    visit(visitor)


def test_connections_that_stay_silent_are_limited() -> None:
    async def visitor(client: aiohttp.ClientSession, where: str, _watch: SessionWatcher) -> None:
        host, port = where.split(":")
        silent = [await asyncio.open_connection(host, int(port)) for _ in range(MOST_SILENT + 3)]
        for reader, _ in silent[:3]:
            assert await reader.read() == b""  # closed
        assert await status(client, f"http://{where}/") == 200
        for _, writer in silent:
            writer.close()

    visit(visitor)


def upgrade(where: str, query: str = "") -> bytes:
    """What opens a WebSocket by hand (RFC 6455, 1.3)."""
    return (
        f"GET /ws{query} HTTP/1.1\r\nHost: {where}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    ).encode()
