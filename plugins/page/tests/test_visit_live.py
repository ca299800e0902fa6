"""`weberlink try` as its visitors use it: one drives, another watches; an abrupt end, and the emergency stop.

Only live processes have a pointer that falls silent, a connection that breaks, and two daemons to stop.
"""

import asyncio
import json
import signal
import subprocess
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest

from plugins.page.tests import declarations
from plugins.page.tests.monitors import Monitor
from plugins.page.tests.test_scripts import MODULES
from tests.program import ENGAGED, PATIENT, Telemetry, document
from tests.wait import PATIENCE, soon
from weberlink.session.tuning import LATE
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.ring import default_path
from weberlink_page.front import PROOF_HEADER

ABOVE, ASIDE, PRESSED = (0.03, 0.03, 0.02), (0.02, 0.03, 0.02), (0.03, 0.03, -0.02)
SURFACE_M = -0.015  # below the surface of the scenes at these places; the pointer goes deeper, the handle does not
RAMP_TICKS = 51  # ticks in which a released force fades: 50 ms, and the tick of the release
Message = dict[str, Any]
Target = tuple[float, float, float]
TOLD: dict[frozenset[Any], Message] = {}  # the newest message of each kind, by its keys


class Page:
    """A visitor's page without a browser."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self.newest: dict[str, Message] = {"hello": {}, "handle": {"state": None}}

    async def listen(self) -> None:
        async for message in self._socket:
            told = document(message.data)
            self.newest[told["type"]] = told
            TOLD[frozenset((told["type"], *told))] = told

    @property
    def hello(self) -> Message:
        return self.newest["hello"]

    @property
    def handle(self) -> str | None:
        return str(self.newest["handle"]["state"])

    async def send(self, **request: Any) -> None:
        await self._socket.send_json(request | {"token": self.hello["token"]})

    async def answer(self, **request: Any) -> Message:
        self.newest.pop("answer", None)
        await self.send(**request)
        await soon(lambda: "answer" in self.newest, "the answer")
        return self.newest["answer"]

    @asynccontextmanager
    async def holding(self, target: Target) -> AsyncIterator[None]:
        async def repeat() -> None:
            while True:
                await self.send(type="drive", target=target, held=True)
                await asyncio.sleep(1 / 60)

        repeating = asyncio.create_task(repeat())
        yield
        repeating.cancel()

    async def drive(self, target: Target, condition: Callable[[], object], what: str) -> None:
        async with self.holding(target):
            await soon(condition, what)

    def abort(self) -> None:
        """Break the connection without a word."""
        response: Any = self._socket._response
        response.connection.transport.abort()


@asynccontextmanager
async def opened(client: aiohttp.ClientSession, monitor: Monitor) -> AsyncIterator[Page]:
    async with client.ws_connect(f"{monitor.url}/ws?key={monitor.key}") as socket:
        page = Page(socket)
        listening = asyncio.create_task(page.listen())
        await soon(lambda: page.hello.get("present") == ["master", "slave"] and page.handle != "None", "the greeting")
        yield page
        assert not listening.done() or listening.exception() is None
        listening.cancel()


class Ends:
    def __init__(self, page: Page) -> None:
        session = page.hello["session"]
        self.master, self.slave = (Telemetry(default_path(f"{session}-{side}")) for side in ("master", "slave"))

    async def engage(self) -> None:
        await soon(lambda: self.master.last["state"] == self.slave.last["state"] == ENGAGED, "the session")

    @property
    def force_n(self) -> float:
        return float(np.linalg.norm(self.master.last["output"]))

    def is_at(self, target: Target) -> bool:
        both = (self.master.last["position"], self.slave.last["output"])
        return all(np.linalg.norm(of[:3] - target) < 2e-3 for of in both)

    def close(self) -> None:
        self.master.close()
        self.slave.close()


async def one_drives(driver: Page, watcher: Page) -> None:
    ends = Ends(driver)
    await ends.engage()
    for target in (ABOVE, ASIDE, ABOVE):
        await driver.drive(target, lambda target=target: ends.is_at(target), "the handle to follow the pointer")
    async with driver.holding(ABOVE):
        await watcher.drive(PRESSED, lambda: watcher.handle == "taken", "the handle to be taken")
        assert (driver.handle, ends.master.last["position"][2] > 0.0) == ("yours", True), "who watches does not drive"
    await driver.drive(PRESSED, lambda: ends.force_n > 1.0, "the wall")
    assert ends.master.last["position"][2] > SURFACE_M > PRESSED[2]
    while not (told := await driver.answer(type="change", weber=0.05))["accepted"]:
        assert LATE in told["why"], "a stall of this machine"
    linked = await driver.answer(type="change", delay_ms=10.0, loss=0.01)
    assert linked["link"] == {"delay_ms": 10.0, "jitter_ms": 0.0, "loss": 0.01}
    await driver.drive(PRESSED, lambda: ends.force_n > 1.0, "the wall again")
    pressed_n = ends.force_n
    driver.abort()
    await soon(lambda: ends.master.last["ramping"] == RELEASED and ends.force_n == 0.0, "the release")
    after = ends.master.records
    pulled = np.linalg.norm(after["output"], axis=1) > 0.01 * pressed_n
    led_last = int(np.flatnonzero(after["ramping"] != RELEASED)[-1])
    assert 0 < np.count_nonzero(pulled[led_last + 1 :]) <= RAMP_TICKS
    await soon(lambda: watcher.handle != "taken", "the handle to be free")
    ends.close()


async def another_scene_until_the_emergency(client: aiohttp.ClientSession, monitor: Monitor, page: Page) -> None:
    former = page.hello["session"]
    assert (await page.answer(type="session", do="start", scene="plane", stops=0))["accepted"]
    await soon(lambda: page.hello["session"] != former and page.hello["present"] == ["master", "slave"], "the scene")
    await soon(lambda: page.newest["figures"].get("settings", {}).get("weber") == 0.05, "the setting of before")
    await soon(lambda: page.hello["link"]["delay_ms"] == 10.0, "the link of before")
    ends = Ends(page)
    await ends.engage()
    assert (await page.answer(type="change", delay_ms=0.0, loss=0.0))["accepted"]
    await page.drive(PRESSED, lambda: ends.force_n > 0.5, "the wall")
    headers = {PROOF_HEADER: page.hello["token"]}
    async with client.post(f"{monitor.url}/api/emergency", headers=headers) as response:
        assert (response.status, document(await response.text())["accepted"]) == (200, True)
    await soon(lambda: page.newest["launcher"]["state"] != "running", "the end")
    assert ends.force_n == 0.0
    ends.close()


@pytest.mark.realtime
def test_a_visit(tmp_path: Path) -> None:
    async def visit(monitor: Monitor) -> None:
        async with (
            asyncio.timeout(5 * PATIENCE),
            aiohttp.ClientSession() as client,
            opened(client, monitor) as driver,
            opened(client, monitor) as watcher,
        ):
            assert (driver.hello["drivable"], driver.hello["rooms"]["start"]) == (True, True)
            assert (driver.handle, watcher.handle) == ("free", "free")
            await one_drives(driver, watcher)
            await another_scene_until_the_emergency(client, monitor, watcher)

    with Monitor(*PATIENT, "--set", "master.device.silence_ms=5000", command="try") as monitor:
        asyncio.run(visit(monitor))
        monitor.send(signal.SIGINT)
        status, said = monitor.finish()[0], monitor.said
    assert (status, "emergency stop" in said, said.count("weberlink try  ")) == (1, True, 1), "one report"
    assert_declared(list(TOLD.values()), tmp_path)


def assert_declared(told: list[Message], folder: Path) -> None:
    """Every message is of a type that the scripts of the page read; without npm that is not checked."""
    assert {"hello", "samples", "felt", "figures", "events", "handle", "launcher", "answer"} <= {
        m["type"] for m in told
    }
    compiler = MODULES / ".bin" / "tsc"
    if compiler.exists():
        declared = json.dumps(str(declarations.PATH).removesuffix(".d.ts"))
        source = f"import type {{ Message }} from {declared};\nexport const told: Message[] = {json.dumps(told)};\n"
        (folder / "told.ts").write_text(source, encoding="utf-8")
        options = ("--noEmit", "--strict", "--module", "es2022", "--moduleResolution", "bundler", "--target", "es2022")
        command = [compiler, *options, folder / "told.ts"]
        run = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
        assert run.returncode == 0, run.stdout[:2000]
