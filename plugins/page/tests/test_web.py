"""The web server in this process: who may ask for what, files, limits, and a stalled page."""

import asyncio
import inspect
import json
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from functools import wraps
from pathlib import Path
from time import monotonic
from typing import Any

import aiohttp
import pytest
from aiohttp import web

from plugins.figures.tests.sources import HandSource
from tests.wait import in_loop, soon
from weberlink.session.emergency import NO_SESSION
from weberlink_page import access
from weberlink_page.front import MOST_SILENT, PROOF_HEADER, FrontOrder
from weberlink_page.listener import Listener
from weberlink_page.metrics import exposition
from weberlink_page.requests import LONGEST_MESSAGE
from weberlink_page.session import PageSession
from weberlink_page.viewer import Viewer
from weberlink_page.watch import SessionWatcher
from weberlink_page.web import BURST_S, MOST_GUESTS, MOST_PAGES, MOST_PER_S, MOST_UNPROVEN, REQUESTS_WAITING, Site

Client = aiohttp.ClientSession
EVIL = "http://evil.example"
CHANGE, STOP, EMERGENCY = {"type": "change", "weber": 0.1}, {"type": "session", "do": "stop"}, {"type": "emergency"}
DRIVE, START = {"type": "drive", "target": [0.0, 0.0, 0.0], "held": True}, {"type": "session", "do": "start"}


@asynccontextmanager
async def served(
    folder: Path = Path("/nonexistent"), said: list[str] | None = None
) -> AsyncIterator[tuple[str, SessionWatcher]]:
    """The address of a monitor in this thread, and its watcher of the sessions of a folder; what it says."""
    said = [] if said is None else said
    watch = SessionWatcher(folder, None, lambda _: None)
    allowed = access.names("127.0.0.1")
    site = Site(watch, allowed, exposition(watch.sessions.values))
    runner = web.AppRunner(site.application(), access_log=None, shutdown_timeout=0.1)
    await runner.setup()
    assert runner.server is not None
    # What is accepted inherits the buffer: a small one, so that what a page does not read waits where it is looked at.
    listening = socket.create_server(("127.0.0.1", 0))
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 16_384)
    order = FrontOrder(sorted(allowed or ()), watch.requests.token, watch.scope)
    listener = Listener(listening, runner.server, site.unproven, order, watch.stopped, said.append)
    try:
        yield f"127.0.0.1:{listening.getsockname()[1]}", watch
    finally:
        listener.close()
        await runner.cleanup()
        for session in watch.sessions.values():
            session.close()


def visit(test: Callable[..., Awaitable[None]]) -> Callable[..., None]:
    """Run a test with a client, the address of a server, and its watcher; other arguments are those of pytest."""

    @wraps(test)
    async def whole(**arguments: Any) -> None:
        async with served() as (where, watch), aiohttp.ClientSession() as client:
            await test(client, where, watch, **arguments)

    run = in_loop(whole)
    _, _, _, *further = inspect.signature(test).parameters.values()
    run.__signature__ = inspect.Signature(further)  # type: ignore[attr-defined]
    return run


async def status(client: Client, url: str, **headers: str) -> int:
    async with client.get(url, headers={name.capitalize(): value for name, value in headers.items()}) as response:
        assert access.HEADERS.items() <= response.headers.items()
        return response.status


async def heard(page: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
    return json.loads((await page.receive()).data)


async def answered(page: aiohttp.ClientWebSocketResponse, asked: dict[str, Any]) -> dict[str, Any]:
    await page.send_json(asked)
    while (answer := await heard(page))["type"] != "answer":
        pass
    return answer


def a_session(watch: SessionWatcher) -> HandSource:
    source = HandSource("slave", ring=Path("/nonexistent/weberlink-7-slave.ring"))
    watch.put(PageSession("7", source))
    return source


# --- hosts, origins and the token

LOCAL, PUBLIC, ONE = ("127.0.0.1",), ("0.0.0.0", "::"), ("192.0.2.7",)


@pytest.mark.parametrize(
    ("served_at", "host", "origin", "expected"),
    [
        *((LOCAL, host, None, True) for host in ("127.0.0.1:8724", "127.0.0.1", "localhost:8724", "LOCALHOST:9999")),
        (LOCAL, "[::1]:8724", None, True),
        *((LOCAL, host, None, False) for host in ("evil.example:8724", "127.0.0.1.evil.example", "192.0.2.1:8724")),
        *((LOCAL, host, None, False) for host in ("evil.example@127.0.0.1", "127.0.0.1:8724/x", "127.0.0.1:x")),
        *((LOCAL, host, None, False) for host in ("[::1", "[::1]x", "", None)),
        *((PUBLIC, host, None, True) for host in ("192.0.2.1:8724", "[2001:db8::1]", "localhost")),
        (PUBLIC, "evil.example:8724", None, False),
        (ONE, "192.0.2.7:8724", None, True),
        (ONE, "127.0.0.1:8724", None, False),
        (LOCAL, "127.0.0.1:8724", "http://127.0.0.1:8724", True),
        *((LOCAL, "127.0.0.1:8724", f"http://{other}", False) for other in ("127.0.0.1:9999", "localhost:8724")),
        *((LOCAL, "127.0.0.1:8724", other, False) for other in ("https://127.0.0.1:8724", EVIL, "null")),
    ],
)
def test_foreign_hosts_and_origins_are_refused(
    served_at: tuple[str, ...], host: str | None, origin: str | None, expected: bool
) -> None:
    for address in served_at:
        assert (access.refusal(host, origin, access.names(address)) is None) is expected


def test_the_token_outlives_a_restart_and_is_of_this_user_alone(tmp_path: Path) -> None:
    token = access.kept_token(tmp_path)
    (path,) = tmp_path.iterdir()
    assert (access.kept_token(tmp_path), path.stat().st_mode & 0o777) == (token, 0o600)
    path.write_text("")  # as a full disk leaves it
    other = access.kept_token(tmp_path)
    assert (len(other), other != token, access.kept_token(tmp_path)) == (len(token), True, other)


@visit
async def test_every_path_refuses_foreign_hosts_and_origins(client: Client, where: str, _: SessionWatcher) -> None:
    for path in ("", "ws", "metrics", "api/sessions"):
        for foreign in ({"host": "evil.example"}, {"origin": EVIL}):
            assert await status(client, f"http://{where}/{path}", **foreign) == 403
    async with client.ws_connect(f"http://{where}/ws", headers={"Origin": f"http://{where}"}):
        pass


@visit
async def test_session_and_its_daemons_need_the_token(client: Client, where: str, watch: SessionWatcher) -> None:
    a_session(watch)
    async with client.ws_connect(f"http://{where}/ws?key={watch.requests.token}") as page:
        token = (await heard(page))["token"]
        for asked, refused in ((CHANGE, "no daemon answers"), (STOP, "no daemon answers"), (EMERGENCY, NO_SESSION)):
            for proof, why in (({}, "token"), ({"token": "x"}, "token"), ({"token": token}, refused)):
                answer = await answered(page, asked | proof)
                assert (answer["accepted"], answer["to"], why in answer["why"]) == (False, asked["type"], True)


@pytest.mark.parametrize("query", ["", "?key=", "?key=x", "?token=TOKEN", "?key=TOKENx"])
@visit
async def test_page_without_the_key_changes_nothing(
    client: Client, where: str, watch: SessionWatcher, query: str
) -> None:
    """Also of the user who runs the monitor, and also with the token in its requests."""
    a_session(watch)
    token = watch.requests.token
    async with client.ws_connect(f"http://{where}/ws{query.replace('TOKEN', token)}") as page:
        hello = await heard(page)
        assert (hello["readonly"], hello["token"]) == (True, None)
        for asked in (CHANGE, DRIVE, START, STOP, EMERGENCY):
            answer = await answered(page, asked | {"token": token})
            assert (answer["accepted"], "read-only" in answer["why"]) == (False, True)
    assert await status(client, f"http://{where}/api/emergency?key={token}") == 404


@pytest.mark.parametrize(
    ("headers", "expected"),
    [
        ({}, 403),
        ({PROOF_HEADER: "x"}, 403),
        ({PROOF_HEADER: "TOKEN", "Origin": EVIL}, 403),
        ({PROOF_HEADER: "TOKEN", "Host": "evil.example"}, 403),
        ({PROOF_HEADER: "TOKEN"}, 409),  # permitted, but no session runs
    ],
)
@visit
async def test_emergency_by_post_needs_token_and_origin(
    client: Client, where: str, watch: SessionWatcher, headers: dict[str, str], expected: int
) -> None:
    sent = {name: value.replace("TOKEN", watch.requests.token) for name, value in headers.items()}
    async with client.post(f"http://{where}/api/emergency", headers=sent) as response:
        assert response.status == expected


@visit
async def test_emergency_overtakes_a_request_that_waits(client: Client, where: str, watch: SessionWatcher) -> None:
    begun, go_on = asyncio.Event(), asyncio.Event()

    async def slow(_viewer: Viewer, _request: dict[str, Any]) -> dict[str, Any]:
        begun.set()
        await go_on.wait()
        return {"accepted": True}

    watch.requests.handlers["change"] = slow
    async with client.ws_connect(f"http://{where}/ws?key={watch.requests.token}") as page:
        proof = {"token": (await heard(page))["token"]}
        await page.send_json({"type": "change"} | proof)
        await begun.wait()
        for _ in range(REQUESTS_WAITING):
            await page.send_json({"type": "change"} | proof)
        assert (await answered(page, EMERGENCY | proof))["to"] == "emergency"
        assert "too many" in (await answered(page, {"type": "change"} | proof))["why"]
        go_on.set()
        assert (await heard(page))["to"] == "change"


@visit
async def test_pings_without_pause_are_answered_at_the_pace_of_requests(
    client: Client, where: str, watch: SessionWatcher
) -> None:
    async with client.ws_connect(f"http://{where}/ws", autoping=False) as page:
        began, pongs, most = monotonic(), 0, 100
        for _ in range(most):
            await page.ping(b"x")
        while pongs < most:
            pongs += (await page.receive()).type is aiohttp.WSMsgType.PONG
            assert pongs <= 1 + (monotonic() - began + BURST_S) * MOST_PER_S


# --- files


@visit
async def test_only_files_of_the_page_are_served(client: Client, where: str, _: SessionWatcher) -> None:
    async with client.get(f"http://{where}") as response:
        assert (response.status, response.content_type) == (200, "text/html")
    assert await status(client, f"http://{where}/assets/index.html") == 200
    for path in ("assets", "assets/", "assets/vendor", "assets/index", "index.html", "assets/.hidden.js"):
        assert await status(client, f"http://{where}/{path}") in (403, 404), path
    async with client.post(f"http://{where}") as response:
        assert response.status == 405


@pytest.mark.parametrize(
    "path",
    [
        *("/assets/../web.py", "/assets/%2e%2e/web.py", "/assets/..%2fweb.py", "/assets//etc/passwd"),
        *("/assets/index.html%00.js", "/../../etc/passwd"),
    ],
)
@visit
async def test_no_path_leads_out_of_the_page(client: Client, where: str, _: SessionWatcher, path: str) -> None:
    """By hand: a client tidies such a path up before it asks."""
    reader, writer = await asyncio.open_connection(*where.split(":"))
    writer.write(f"GET {path} HTTP/1.1\r\nHost: {where}\r\nConnection: close\r\n\r\n".encode())
    assert (await reader.read()).split()[1] in (b"404", b"400")
    writer.close()


# --- pages and their limits


@visit
async def test_what_is_no_request_is_refused_and_what_is_too_long_ends_the_page(
    client: Client, where: str, watch: SessionWatcher
) -> None:
    a_session(watch)
    async with client.get(f"http://{where}/api/sessions") as response:
        (listed,) = (await response.json())["sessions"]
    assert (listed["session"], listed["sides"], listed["live"]) == ("7", ["slave"], True)
    async with client.ws_connect(f"http://{where}/ws?session=7") as page:
        for sent in ("{", '"x"', "[" * 2000, '{"type":"change","weber":7}'):
            await page.send_str(sent)
            while (answer := await heard(page))["type"] != "answer":
                pass
            assert answer["accepted"] is False
        await page.send_str("x" * (LONGEST_MESSAGE + 1))
        while not page.closed:
            await page.receive()
        assert page.close_code == aiohttp.WSCloseCode.MESSAGE_TOO_BIG


@pytest.mark.parametrize(("most", "has_key"), [(MOST_PAGES, True), (MOST_GUESTS, False)])
@visit
async def test_number_of_pages_is_limited(
    client: Client, where: str, watch: SessionWatcher, most: int, has_key: bool
) -> None:
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
    await soon(lambda: not watch.viewers, "the pages to leave")
    async with client.ws_connect(full):
        pass


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: localhost\r\n"])
@visit
async def test_connections_of_strangers_are_limited_and_cost_a_page_nothing(
    client: Client, where: str, watch: SessionWatcher, sent: bytes
) -> None:
    async with client.ws_connect(f"http://{where}/ws?key={watch.requests.token}") as page:
        strangers = []
        for _ in range(max(MOST_SILENT, MOST_UNPROVEN) + 3):
            strangers.append(await asyncio.open_connection(*where.split(":")))
            strangers[-1][1].write(sent)
        for reader, _ in strangers[:2]:
            with suppress(ConnectionError):
                assert await reader.read() == b"", "closed"
        assert await status(client, f"http://{where}/") == 200
        assert (await answered(page, CHANGE))["to"] == "change"
        for _, writer in strangers:
            writer.close()
