"""A live session watched by monitors: page, metrics and another host show the figures of the report.

One session serves all of these tests: it is watched by two pages, by a second monitor over the authenticated link, and
by a third with another key.
"""

import asyncio
import os
import signal
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from prometheus_client.parser import text_string_to_metric_families

from tests.apps.monitor.monitors import Monitor
from tests.system.processes import PATIENCE, PATIENT, Program, document, free_port
from tests.system.systems import CONFIGS
from weberlink.apps.monitor.metrics import COUNTERS
from weberlink.protocol.keys import generate

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
    remote: list[Figures]
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


async def collected(
    client: aiohttp.ClientSession, url: str, session: str, questions: tuple[Figures, ...] = ()
) -> list[Figures]:
    """All that a page is sent, to the end of the session."""
    await there(client, url, session)
    messages: list[Figures] = []
    async with client.ws_connect(f"{url}/ws?session={session}") as page:
        for question in questions:
            await page.send_json(question)
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
def key(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("key") / "key"
    generate(path)
    return path


@pytest.fixture(scope="module")
def watched(key: Path, tmp_path_factory: pytest.TempPathFactory) -> Watched:
    folder = tmp_path_factory.mktemp("watched")
    generate(folder / "other")
    out, go = folder / "report.json", folder / "go"
    # Its number is known before it begins, so that everybody is there by then and looks at nothing else.
    held_back = ("sh", "-c", f'while [ ! -e "{go}" ]; do sleep 0.05; done; exec "$@"', "sh")
    with Program("loopback", "--duration", LENGTH_S, "--json", out, *PATIENT, prefix=held_back) as program:
        mine = ("--session", program.pid)
        with (
            Monitor(folder, *mine) as monitor,
            Monitor(folder, *mine, "--share", "127.0.0.1:0", "--key-file", key) as sharing,
            Monitor(folder, "--session", 1, "--from", sharing.shares_on, "--key-file", key) as looking,
            Monitor(folder, "--session", 1, "--from", sharing.shares_on, "--key-file", folder / "other") as stranger,
        ):
            stranger.until_said("--key-file must be")
            looking.until_said("connected")
            assert monitor.url
            go.touch()
            session = str(program.pid)

            async def watch() -> tuple[list[Figures], ...]:
                async with asyncio.timeout(PATIENCE), aiohttp.ClientSession() as client:
                    return await asyncio.gather(
                        collected(client, monitor.url, session),
                        late(client, monitor.url, session),
                        collected(client, looking.url, "remote", ({"type": "change", "weber": 0.2},)),
                    )

            page, opened_late, remote = asyncio.run(watch())
            status, _, errors = program.finish()
            assert status == 0, errors
            niceness = os.getpriority(os.PRIO_PROCESS, monitor.pid)
            exposed = asyncio.run(asked(monitor.url, session))
    return Watched(session, document(out.read_text()), page, opened_late, remote, exposed, niceness)


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
def test_other_host_sees_the_same_read_only(watched: Watched) -> None:
    last = final(watched.remote)
    assert last["seen_from_start"]
    assert_same(last["figures"], {key: watched.report[key] for key in last["figures"]})
    hello = watched.remote[0]
    assert hello["remote"] and hello["readonly"] and hello["changes"] == []
    (answer,) = (message for message in watched.remote if message["type"] == "answer")
    assert answer["accepted"] is False


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


def test_port_in_use_is_one_line(tmp_path: Path, taken_port: int, key: Path) -> None:
    with Monitor(tmp_path, "--port", taken_port) as monitor:
        status, said = monitor.finish()
    assert status == 1
    assert said.count("\n") == 1 and f"port {taken_port} is in use" in said and "--port" in said
    with Monitor(tmp_path, "--share", f"127.0.0.1:{taken_port}", "--key-file", key) as monitor:
        status, said = monitor.finish()
    assert status == 1
    assert f"--share 127.0.0.1:{taken_port}: cannot be served" in said.splitlines()[-1]


def test_missing_server_is_one_line_and_page_is_served(tmp_path: Path, key: Path) -> None:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))  # and nobody listens
        nobody = f"127.0.0.1:{server.getsockname()[1]}"
        with Monitor(tmp_path, "--from", nobody, "--key-file", key, "--session", 1) as monitor:
            monitor.until_said("cannot be reached")
            assert monitor.url
            assert monitor.said.count("cannot be reached") == 1
            monitor.send(signal.SIGTERM)
            assert monitor.finish()[0] == 0


@pytest.mark.realtime
@pytest.mark.hunt
def test_joined_session_equals_the_joined_recordings(key: Path, tmp_path: Path) -> None:
    """The slave is followed over the link, the master on this host; `info` puts the two files on one clock."""
    address = f"127.0.0.1:{free_port()}"
    where = ("--set", f"link.listen={address}", "--set", f"link.slave={address}", *PATIENT)
    files = tmp_path / "master.mcap", tmp_path / "slave.mcap"
    with (
        Program("slave", CONFIGS / "loopback.yaml", *where, "--record", files[1]) as slave,
        Monitor(tmp_path, "--session", slave.pid, "--share", "127.0.0.1:0", "--key-file", key) as sharing,
        Monitor(tmp_path, "--session", 1, "--from", sharing.shares_on, "--key-file", key) as looking,
    ):
        looking.until_said("connected")
        with Program(
            "master", CONFIGS / "loopback.yaml", *where, "--duration", LENGTH_S, "--record", files[0]
        ) as master:
            looking.until_said("are one session")
            joined = asyncio.run(to_the_end(looking.url, "remote-2"))
            assert master.finish()[0] == 0
        slave.send(signal.SIGINT)
        assert slave.finish()[0] == 0
    with Program("record", "info", *files, "--json", "-") as info:
        status, output, errors = info.finish()
    assert status == 0, errors
    figures, recorded = final(joined)["figures"], document(output)
    for channel in ("force", "position"):
        for name in ("error_rms", "error_max", "violation_fraction"):
            assert figures[channel][name] == pytest.approx(recorded[channel][name], rel=1e-9), (channel, name)
    assert figures["ticks"]["master"]["count"] == recorded["ticks"]["master"]["count"]


async def to_the_end(url: str, session: str) -> list[Figures]:
    async with asyncio.timeout(PATIENCE), aiohttp.ClientSession() as client:
        return await collected(client, url, session)
