"""Pictures on the page, what `weberlink try` shows of a robot, and a browser that never reads, which nobody notices."""

import asyncio
import json
import signal
import socket
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

import psutil
import pytest
from aiohttp import ClientSession, ClientTimeout

pytest.importorskip("weberlink_page")
from plugins.page.tests.browser import browser
from plugins.page.tests.monitors import Monitor
from plugins.page.tests.scripted_server import ScriptedServer
from plugins.page.tests.test_page import greeting
from plugins.video.tests.test_jpeg import jpeg
from tests.program import ROOT, document, faults_of
from weberlink_figures.pictures import Picture, pack
from weberlink_page.commands import cameras_to_try, try_order
from weberlink_page.launcher import TryOrder

VIDEO = ROOT / "plugins/video/configs/video.yaml"
MOST_GROWTH = 2**25  # [B] 17 MB were seen; where nothing limits what is kept for a browser, 12 MB for each picture


@pytest.mark.parametrize(
    ("order", "kind"),
    [
        (try_order(None, None, [], None, scripted=False), "pattern"),
        (TryOrder(str(VIDEO)), None),
        (TryOrder(str(VIDEO), ("slave.cameras=null",)), "pattern"),
        (TryOrder(str(VIDEO), ("slave.cameras=null", "slave.robot={driver: mujoco}")), "scene"),
        (TryOrder("/nowhere.yaml"), None),
    ],
)
def test_who_tries_sees_the_robot_where_the_file_names_no_cameras(order: TryOrder, kind: str | None) -> None:
    added = [json.loads(each.removeprefix("slave.cameras=")) for each in cameras_to_try(order)]
    assert [source["kind"] for of in added for source in of["sources"]] == ([] if kind is None else [kind])


def test_page_draws_pictures_and_says_why_there_are_none(tmp_path: Path) -> None:
    with ScriptedServer() as server, browser(tmp_path / "profile", webgl=False) as page:
        server.greeting = [greeting()[0] | {"view": "video"}]
        server.pictures = [pack(Picture(0.02, "wrist", jpeg(64, 48))), pack(Picture(0.0, "table", b"rubbish", "gone"))]
        page.open(server.address)
        page.wait(lambda: "gone" in page.text("frames"), "why there is no picture")
        page.wait(lambda: page.pixels("#frames canvas") > 1, "a picture")
        assert page.run("return [...document.querySelectorAll('#frames canvas')].map(e => e.width)") == [64, 300]
        assert not page.console()


@pytest.mark.realtime
def test_browser_that_never_reads_is_noticed_by_nobody(tmp_path: Path) -> None:
    (tmp_path / "pictures").write_bytes(20 * jpeg(1024, 1024, quality=95))
    cameras = (
        f"slave.cameras={{driver: video, sources: [{{name: test, device: {tmp_path / 'pictures'}, rate_hz: 60}}]}}"
    )
    patient = ("--set", "link.silence_ms=2000", "--set", cameras)
    with Monitor("--json", tmp_path / "report", *patient, command="try --scripted") as monitor:
        session, (host, port) = monitor.until_said(r"session (\d+): slave"), urlsplit(monitor.url).netloc.split(":")
        view = f"/view?session={session}"

        async def pictures(count: int) -> None:
            async with (
                ClientSession(timeout=ClientTimeout(60.0)) as client,
                client.ws_connect(f"{monitor.url}{view}", max_msg_size=0) as page,
            ):
                while count:  # between two passes of the file it is said that there are no more
                    count -= len(await page.receive_bytes()) > 1_000_000

        asyncio.run(pictures(3))
        with ExitStack() as stack:
            for _ in range(4):
                browser = stack.enter_context(socket.create_connection((host, int(port))))
                upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
                browser.sendall(f"GET {view} HTTP/1.1\r\nHost: {host}:{port}\r\n{upgrade}{key}\r\n".encode())
                assert b"101" in browser.recv(20)
            asyncio.run(pictures(20))  # what is kept for each of them is there
            processes = [psutil.Process(monitor.pid), *psutil.Process(monitor.pid).children(recursive=True)]
            before = {process: process.memory_info().rss for process in processes}
            asyncio.run(pictures(20))
            grown = {process.pid: process.memory_info().rss - rss for process, rss in before.items()}
        assert max(grown.values()) < MOST_GROWTH, grown
        monitor.send(signal.SIGINT)
        status, said = monitor.finish()[0], monitor.said
    assert status == 0, said
    assert faults_of(document((tmp_path / "report").read_text())) == {"master": {}, "slave": {}}
