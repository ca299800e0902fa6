"""A live session watched by monitors: page and metrics show the figures of the report.

One session, watched by two pages, serves all of these tests.
"""

import asyncio
import os
import signal
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import aiohttp
import pytest
from prometheus_client.parser import text_string_to_metric_families
from pydantic import ConfigDict, Field, TypeAdapter

from tests.apps.monitor.monitors import Monitor
from tests.program import PATIENT, Program, document
from tests.wait import PATIENCE
from weberlink.apps.monitor.messages import Message
from weberlink.apps.monitor.metrics import COUNTERS

LENGTH_S = 3
Figures = dict[str, Any]


@dataclass
class Watched:
    """What everybody saw of the session."""

    session: str
    report: Figures
    page: list[Figures]
    late: list[Figures]
    """Of a page that opened in the middle."""
    metrics: dict[tuple[Any, ...], float]
    niceness: int


def final(messages: list[Figures]) -> Figures:
    (last,) = (message for message in messages if message.get("ended"))
    return last


def rows(messages: list[Figures], side: str) -> list[float]:
    return [t for message in messages if message.get("side") == side for t in message["t"]]


def assert_same(told: Any, expected: Any, path: str = "figures") -> None:
    """Number for number; a sum that was made in other pieces differs in its last digits."""
    if isinstance(expected, dict):
        assert told.keys() == expected.keys(), path
        for key, value in expected.items():
            assert_same(told[key], value, f"{path}.{key}")
    elif isinstance(expected, float):
        assert told == pytest.approx(expected, rel=1e-9, abs=1e-12), path
    else:
        assert told == expected, path


async def collected(client: aiohttp.ClientSession, url: str, session: str) -> list[Figures]:
    """All that a page is sent, to the end of the session."""
    await there(client, url, session)
    messages: list[Figures] = []
    async with client.ws_connect(f"{url}/ws?session={session}") as page:
        async for message in page:
            messages.append(document(message.data))
            if messages[-1].get("ended"):
                break
    return messages


async def there(client: aiohttp.ClientSession, url: str, session: str) -> None:
    """Wait until a monitor has found a session."""
    while True:
        async with client.get(f"{url}/api/sessions") as response:
            if session in [of["session"] for of in (await response.json())["sessions"]]:
                return
        await asyncio.sleep(0.02)


async def metrics(client: aiohttp.ClientSession, url: str, session: str) -> dict[tuple[Any, ...], float]:
    async with client.get(f"{url}/metrics") as response:
        assert response.content_type == "text/plain"
        text = await response.text()
    return {
        (sample.name, *sorted((key, value) for key, value in sample.labels.items() if key != "session")): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
        if sample.labels.get("session") == session
    }


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Watched:
    folder = tmp_path_factory.mktemp("watched")
    out, go = folder / "report.json", folder / "go"
    # Its number is known before it begins, so that everybody is there by then and looks at nothing else.
    held_back = ("sh", "-c", f'while [ ! -e "{go}" ]; do sleep 0.05; done; exec "$@"', "sh")
    with (
        Program("loopback", "--duration", LENGTH_S, "--json", out, *PATIENT, prefix=held_back) as program,
        Monitor(folder, "--session", program.pid) as monitor,
    ):
        assert monitor.url
        go.touch()
        session = str(program.pid)

        async def watch() -> tuple[list[Figures], ...]:
            async with asyncio.timeout(PATIENCE), aiohttp.ClientSession() as client:
                return await asyncio.gather(
                    collected(client, monitor.url, session),
                    late(client, monitor.url, session),
                )

        page, opened_late = asyncio.run(watch())
        status, _, errors = program.finish()
        assert status == 0, errors
        niceness = os.getpriority(os.PRIO_PROCESS, monitor.pid)
        exposed = asyncio.run(asked(monitor.url, session))
    return Watched(session, document(out.read_text()), page, opened_late, exposed, niceness)


async def late(client: aiohttp.ClientSession, url: str, session: str) -> list[Figures]:
    await there(client, url, session)
    await asyncio.sleep(LENGTH_S / 2)
    return await collected(client, url, session)


async def asked(url: str, session: str) -> dict[tuple[Any, ...], float]:
    async with aiohttp.ClientSession() as client:
        return await metrics(client, url, session)


@pytest.mark.realtime
def test_final_figures_on_the_page_equal_the_report(watched: Watched) -> None:
    last = final(watched.page)
    assert last["seen_from_start"]
    expected = {key: watched.report[key] for key in last["figures"]}
    assert set(watched.report) - set(expected) == {
        "addresses",
        "drops",
        "dscp",
        "environment",
        "host",
        "lookahead_ms",
        "outcome",
        "peers",
        "playout_ms",
        "realtime",
        "verdict",
    }
    assert_same(last["figures"], expected)
    assert last["faults"] == watched.report["faults"]


@pytest.mark.realtime
def test_every_message_is_of_a_declared_type(watched: Watched) -> None:
    declared: TypeAdapter[Any] = TypeAdapter(
        Annotated[Message, Field(discriminator="type")], config=ConfigDict(strict=True, extra="forbid")
    )
    for message in watched.page + watched.late:
        declared.validate_python(message)
    assert {message["type"] for message in watched.page} >= {"hello", "handle", "samples", "felt", "figures", "events"}


@pytest.mark.realtime
def test_late_page_ends_with_the_same_figures(watched: Watched) -> None:
    assert final(watched.late)["figures"] == final(watched.page)["figures"]


@pytest.mark.realtime
def test_page_gets_ordered_rows_and_every_send(watched: Watched) -> None:
    for messages in (watched.page, watched.late):
        assert messages[0]["type"] == "hello" and messages[0]["session"] == watched.session
        for side in ("master", "slave"):
            times = rows(messages, side)
            assert times == sorted(times) and len(times) > 20
        assert [t for message in messages if message["type"] == "felt" for t in message["t"]]
    for side, channel in (("slave", "force"), ("master", "position")):
        sent = sum(sum(of["columns"]["sent"]) for of in watched.page if of.get("side") == side)
        assert sent == watched.report[channel]["packets"]


@pytest.mark.realtime
def test_greeting_describes_the_session(watched: Watched) -> None:
    hello = [message for message in watched.page if message["type"] == "hello"][-1]
    assert hello["present"] == ["master", "slave"]
    description = hello["sides"]["master"]
    assert hello["sides"]["slave"]["side"] == "slave"
    assert description["file"].endswith("loopback.yaml")
    assert [shape["shape"] for shape in hello["scene"]] == ["plane", "sphere"]
    assert hello["settings"] == {"weber": 0.1, "predictor": "hybrid"}


@pytest.mark.realtime
def test_metrics_equal_the_report(watched: Watched) -> None:
    told, report = watched.metrics, watched.report
    for side in ("master", "slave"):
        ticks = report["ticks"][side]
        assert told["weberlink_ticks_total", ("side", side)] == ticks["count"]
        assert told["weberlink_ticks_missed_total", ("side", side)] == ticks["missed"]
        for quantile, percentile in (("0.5", "p50"), ("0.99", "p99"), ("0.999", "p99_9")):
            value = told["weberlink_tick_lateness_seconds", ("quantile", quantile), ("side", side)]
            assert value == pytest.approx(ticks["lateness_us"][percentile] * 1e-6)
    for name in COUNTERS:
        assert ("weberlink_" + name + "_total", ("side", "master")) in told
    for name, figure in (("sent", "sent"), ("received", "received"), ("lost", "lost"), ("dropped", "dropped")):
        total = sum(told[f"weberlink_datagrams_{name}_total", ("side", side)] for side in ("master", "slave"))
        assert total == report["link"][figure]
    assert told["weberlink_updates_sent_total", ("side", "slave")] == report["force"]["packets"]
    assert told["weberlink_updates_sent_total", ("side", "master")] == report["position"]["packets"]
    for channel in ("force", "position"):
        for name, figure in (
            ("packets_per_second", "packets_per_s"),
            ("reduction_ratio", "reduction"),
            ("violation_ratio", "violation_fraction"),
        ):
            value = told[f"weberlink_{name}", ("channel", channel)]
            assert value == pytest.approx(report[channel][figure], rel=1e-9)
    assert told["weberlink_session_duration_seconds",] == pytest.approx(report["duration_s"])
    assert told["weberlink_session_live",] == 0 and told["weberlink_session_seen_from_start",] == 1


@pytest.mark.realtime
def test_monitor_has_lower_priority_than_daemons(watched: Watched) -> None:
    assert watched.niceness >= 5


def test_ctrl_c_closes_open_pages_and_exits_0(tmp_path: Path) -> None:
    async def interrupted(monitor: Monitor) -> int | None:
        async with (
            asyncio.timeout(PATIENCE),
            aiohttp.ClientSession() as client,
            client.ws_connect(f"{monitor.url}/ws") as page,
        ):
            monitor.send(signal.SIGINT)
            async for _ in page:
                pass
            return page.close_code

    with Monitor(tmp_path, "--session", 1) as monitor:
        assert asyncio.run(interrupted(monitor)) == aiohttp.WSCloseCode.GOING_AWAY
        status, said = monitor.finish()
    assert status == 0
    assert "Traceback" not in said and "waiting for a daemon; start weberlink loopback" in said


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        yield server.getsockname()[1]


def test_port_in_use_is_one_line(tmp_path: Path, taken_port: int) -> None:
    with Monitor(tmp_path, "--port", taken_port) as monitor:
        status, said = monitor.finish()
    assert status == 1
    assert said.count("\n") == 1 and f"port {taken_port} is in use" in said and "--port" in said
