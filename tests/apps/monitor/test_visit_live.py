"""`weberlink try` as its visitors use it: one drives, another watches; abrupt ends, and the emergency stop."""

import asyncio
import signal
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import aiohttp
import numpy as np
import pytest

from tests.apps.monitor.monitors import Monitor
from tests.program import ENGAGED, Telemetry, document
from tests.wait import PATIENCE, until
from weberlink.apps.monitor.listener import PROOF_HEADER
from weberlink.cli.try_session import LEFT_S
from weberlink.telemetry.record import RELEASED
from weberlink.telemetry.ring import default_path

ABOVE, PRESSED = (0.03, 0.03, 0.02), (0.03, 0.03, -0.02)
STEPS = 12
SILENCE_MS = 100.0
"""A pointer that has sent nothing for longer has let go."""
RAMP_TICKS = 51
"""Ticks in which a released force fades: 50 ms, and the tick of the release."""
MOVED_M = 50e-6
"""A handle that has moved farther follows its target; it is at rest before."""
Message = dict[str, Any]


class Page:
    """A visitor's page without a browser."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self.newest: dict[str, Message] = {}
        self.answers: list[Message] = []
        self.rows = 0

    async def listen(self) -> None:
        async for message in self._socket:
            told = document(message.data)
            self.newest[told["type"]] = told
            self.rows += told["type"] == "samples"
            if told["type"] == "answer":
                self.answers.append(told)

    @property
    def hello(self) -> Message:
        return self.newest.get("hello", {})

    @property
    def handle(self) -> str | None:
        return self.newest.get("handle", {}).get("state")

    async def until(self, condition: Callable[[], object]) -> None:
        while not condition():
            await asyncio.sleep(0.01)

    async def ask(self, **request: Any) -> None:
        await self._socket.send_json(request | {"token": self.hello["token"]})

    async def answer(self, **request: Any) -> Message:
        self.answers.clear()
        await self.ask(**request)
        await self.until(lambda: self.answers)
        return self.answers[0]

    async def drive(self, target: tuple[float, float, float], seconds: float) -> float:
        """Hold the handle for a time, as a page does; returns when the first message was sent."""
        began = monotonic()
        while monotonic() < began + seconds:
            await self.ask(type="drive", target=target, held=True)
            await asyncio.sleep(1 / 60)
        return began

    def abort(self) -> float:
        """Break the connection without a word; returns when."""
        response: Any = self._socket._response
        response.connection.transport.abort()
        return monotonic()


@asynccontextmanager
async def opened(client: aiohttp.ClientSession, monitor: Monitor) -> AsyncIterator[Page]:
    socket = await client.ws_connect(f"{monitor.url}/ws?key={monitor.key}")
    page = Page(socket)
    listening = asyncio.get_running_loop().create_task(page.listen())
    try:
        await page.until(lambda: page.hello.get("present") == ["master", "slave"] and page.handle)
        yield page
    finally:
        listening.cancel()
        await socket.close()


@dataclass
class Visited:
    """What happened."""

    hello: Message
    handles: dict[str, list[str | None]] = field(default_factory=dict)
    latencies_ms: list[float] = field(default_factory=list)
    rows_per_s: float = 0.0
    pressed: dict[str, Any] = field(default_factory=dict)
    released_ms: float = 0.0
    fade_ticks: int = 0
    answers: dict[str, Message] = field(default_factory=dict)
    second: Message = field(default_factory=dict)
    emergency_ms: dict[str, float] = field(default_factory=dict)
    stopped: tuple[int, Message] = (0, {})
    status: int = -1
    said: str = ""


def since(telemetry: Telemetry, at: float) -> Any:
    records = telemetry.records
    return records[records["at"] > at]


def first(records: Any, condition: Any) -> float:
    """Time of the first record with a condition [s]; NaN if there is none."""
    return float(records["at"][int(np.argmax(condition))]) if condition.any() else float("nan")


def force(records: Any) -> Any:
    return np.linalg.norm(records["output"], axis=1)


async def latency(page: Page, master: Telemetry, side: float) -> float:
    """Time from a message with another target until the handle moves [ms]."""
    at_rest = master.last["position"][0]  # or still on its way to the other side
    sent = await page.drive((0.03 + side, 0.03, 0.02), 0.2)
    after = since(master, sent)
    return 1e3 * (first(after, np.sign(side) * (after["position"][:, 0] - at_rest) > MOVED_M) - sent)


async def visit(client: aiohttp.ClientSession, monitor: Monitor) -> Visited:
    async with opened(client, monitor) as driver, opened(client, monitor) as watcher:
        visited = Visited(driver.hello)
        name = driver.hello["session"]
        master, slave = (Telemetry(default_path(f"{name}-{side}")) for side in ("master", "slave"))
        await driver.until(lambda: master.last["state"] == ENGAGED)
        visited.handles["free"] = [driver.handle, watcher.handle]
        await driver.drive(ABOVE, 1.0)
        await watcher.drive(PRESSED, 0.1)
        visited.handles["driven"] = [driver.handle, watcher.handle]
        rows, began = watcher.rows, monotonic()
        for number in range(STEPS):
            assert slave.last["state"] == ENGAGED
            visited.latencies_ms.append(await latency(driver, master, 0.01 if number % 2 else -0.01))
        visited.rows_per_s = (watcher.rows - rows) / 2 / (monotonic() - began)
        await driver.drive(PRESSED, 1.5)
        visited.pressed = {
            "force": float(force(master.records[-500:]).max()),  # a stall of this test is a release, too
            "depth": float(master.last["position"][2]),
            "packets": int(slave.last["updates_sent"]),
            "apart": float(np.linalg.norm(slave.last["output"] - master.last["position"])),
        }
        for keys in ({"weber": 0.05}, {"delay_ms": 10.0, "loss": 0.01}):
            visited.answers[next(iter(keys))] = await driver.answer(type="change", **keys)
        await driver.drive(PRESSED, 0.5)
        before, aborted = visited.pressed["force"], driver.abort()
        await asyncio.sleep(0.5)
        after = since(master, aborted)
        visited.released_ms = 1e3 * (first(after, after["ramping"] == RELEASED) - aborted)
        pulled = force(after) > 0.01 * before
        visited.fade_ticks = int(np.count_nonzero(pulled & (after["ramping"] == RELEASED)))
        assert after["ramping"][-1] == RELEASED
        await watcher.until(lambda: watcher.handle != "taken")
        visited.handles["left"] = [watcher.handle]
        master.close(), slave.close()
        await scene(client, monitor, watcher, visited)
    monitor.send(signal.SIGINT)
    visited.status, visited.said = await asyncio.to_thread(monitor.finish)
    return visited


async def scene(client: aiohttp.ClientSession, monitor: Monitor, page: Page, visited: Visited) -> None:
    """Another scene, which has the settings of the first; then an emergency stop while the wall is pressed."""
    former = page.hello["session"]
    assert (await page.answer(type="session", do="start", scene="plane"))["accepted"]
    await page.until(lambda: page.hello["session"] != former and page.hello["present"] == ["master", "slave"])
    name = page.hello["session"]
    await page.until(lambda: page.newest["figures"].get("settings", {}).get("weber") == 0.05)
    await page.until(lambda: page.hello["link"]["delay_ms"] == 10.0)
    visited.second = page.hello
    master, slave = (Telemetry(default_path(f"{name}-{side}")) for side in ("master", "slave"))
    await page.until(lambda: master.last["state"] == ENGAGED)
    assert (await page.answer(type="change", delay_ms=0.0, loss=0.0))["accepted"]
    await page.drive(PRESSED, 1.0)
    assert force(master.records[-500:]).max() > 0.5
    asked = monotonic()
    headers = {PROOF_HEADER: page.hello["token"]}
    async with client.post(f"{monitor.url}/api/emergency", headers=headers) as response:
        visited.stopped = response.status, document(await response.text())
    visited.emergency_ms["answered"] = 1e3 * (monotonic() - asked)
    await page.until(lambda: page.newest["launcher"]["state"] != "running")
    after = since(master, asked)
    assert force(after[-1:])[0] == 0.0
    visited.emergency_ms["force"] = 1e3 * (float(after["at"][force(after) > 0.0].max(initial=asked)) - asked)
    master.close(), slave.close()


@pytest.fixture(scope="module")
def visited(tmp_path_factory: pytest.TempPathFactory) -> Visited:
    folder = tmp_path_factory.mktemp("visited")

    async def run(monitor: Monitor) -> Visited:
        async with asyncio.timeout(3 * PATIENCE), aiohttp.ClientSession() as client:
            return await visit(client, monitor)

    with Monitor(folder, command="try") as monitor:
        return asyncio.run(run(monitor))


@pytest.mark.realtime(alone=True)
def test_greeting_lets_a_visitor_drive(visited: Visited) -> None:
    hello = visited.hello
    assert hello["drivable"] and hello["token"] and hello["workspace_m"] == 0.06
    assert hello["names"]["device"] == "pointer" and hello["names"]["file"].endswith("try.yaml")
    assert hello["rooms"]["start"] and hello["rooms"]["scene"] == "dome"
    assert "cavity" in [scene["name"] for scene in hello["rooms"]["scenes"]]
    assert hello["link"] == {"delay_ms": 0.0, "jitter_ms": 0.0, "loss": 0.0}


@pytest.mark.realtime(alone=True)
def test_one_visitor_drives_and_others_watch(visited: Visited) -> None:
    assert visited.handles == {"free": ["free", "free"], "driven": ["yours", "taken"], "left": ["free"]}


@pytest.mark.realtime(alone=True)
def test_handle_follows_the_pointer(visited: Visited) -> None:
    latencies = np.array(visited.latencies_ms)
    assert np.isfinite(latencies).sum() > 0.8 * STEPS  # a step that a stall of the host hid has none
    assert np.nanmedian(latencies) < 50.0
    assert visited.rows_per_s > 25.0


@pytest.mark.realtime(alone=True)
def test_wall_stops_the_handle_and_packets_are_counted(visited: Visited) -> None:
    pressed = visited.pressed
    assert pressed["force"] > 1.0 and pressed["packets"] > 0
    assert pressed["depth"] > -0.01  # the pointer is 20 mm deep
    assert pressed["apart"] < 0.001


@pytest.mark.realtime(alone=True)
def test_closed_connection_fades_the_force(visited: Visited) -> None:
    assert visited.released_ms < SILENCE_MS  # by the close, and at the latest by the silence of the pointer
    assert 0 < visited.fade_ticks <= RAMP_TICKS


@pytest.mark.realtime(alone=True)
def test_settings_and_link_are_changed_and_kept(visited: Visited) -> None:
    assert visited.answers["weber"]["accepted"], visited.answers
    assert visited.answers["delay_ms"]["accepted"], visited.answers
    assert visited.answers["delay_ms"]["link"] == {"delay_ms": 10.0, "jitter_ms": 0.0, "loss": 0.01}
    assert visited.second["rooms"]["scene"] == "plane"
    assert visited.second["link"] == visited.answers["delay_ms"]["link"]


@pytest.mark.realtime(alone=True)
def test_emergency_stop_ends_both_sides_at_once(visited: Visited) -> None:
    status, answer = visited.stopped
    assert (status, answer["accepted"]) == (200, True)
    assert visited.emergency_ms["force"] < 100.0
    assert "emergency stop" in visited.said and visited.status == 1
    assert visited.said.count("weberlink try  ") == 1  # one report


@pytest.mark.realtime
@pytest.mark.hunt
def test_session_ends_with_its_killed_parent(tmp_path: Path) -> None:
    with Monitor(tmp_path, command="try") as monitor:
        session = int(monitor.until_said(r"session (\d+): master"))
        monitor.kill()
        until(lambda: not Path(f"/proc/{session}").exists(), "the session to end")


@pytest.mark.realtime
@pytest.mark.hunt
def test_visit_of_limited_length_ends_with_status_0(tmp_path: Path) -> None:
    with Monitor(tmp_path, "--duration", 1, "--scripted", "--set", "link.silence_ms=2000", command="try") as monitor:
        status, said = monitor.finish()
    assert status == 0 and "completed" in said, said


@pytest.mark.realtime
@pytest.mark.hunt
def test_page_that_is_closed_for_a_minute_ends_the_visit(tmp_path: Path) -> None:
    async def look(monitor: Monitor) -> float:
        async with asyncio.timeout(PATIENCE), aiohttp.ClientSession() as client:
            for _ in range(2):  # the second time within the minute
                async with opened(client, monitor):
                    await asyncio.sleep(1.0)
                await asyncio.sleep(1.0)
        return monotonic()

    with Monitor(tmp_path, command="try") as monitor:
        closed = asyncio.run(look(monitor))
        sleep(LEFT_S / 2)
        assert "has been closed" not in monitor.said
        sleep(LEFT_S / 2)
        status, said = monitor.finish()
    assert monotonic() - closed < LEFT_S + PATIENCE
    assert status == 0 and said.count("has been closed") == 1 and "interrupted" in said, said


def test_wrong_configuration_is_one_line(tmp_path: Path) -> None:
    with Monitor(tmp_path, "--set", "codec.force.weber=x", command="try") as monitor:
        status, said = monitor.finish()
    assert status == 2
    address, end, complaint = said.splitlines()
    assert "http://127.0.0.1:" in address and "Ctrl-C" in end
    assert max(map(len, (address, end))) <= 80
    assert complaint.startswith("weberlink: ") and "codec.force.weber" in complaint
