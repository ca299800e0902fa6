"""One session of six degrees of freedom, which pages and Prometheus watch: all of them tell what its report says."""

import asyncio
import os
import signal
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import aiohttp
import pytest
from prometheus_client.parser import text_string_to_metric_families
from pydantic import ConfigDict, Field, TypeAdapter

from tests.apps.monitor.monitors import Monitor
from tests.program import PATIENT, Program, document
from tests.system.systems import CONFIGS
from tests.wait import PATIENCE, soon
from weberlink.apps.monitor.messages import Message
from weberlink.apps.monitor.metrics import COUNTERS

Figures = dict[str, Any]
SIDES = ("master", "slave")
# Its number is known before it begins, so that everybody is there by then.
HELD_BACK = ("sh", "-c", 'while [ ! -e "$0" ]; do sleep 0.05; done; exec "$@"')
UNTOLD = {
    *("addresses", "drops", "dscp", "environment", "host", "lookahead_ms", "outcome", "peers", "playout_ms"),
    *("realtime", "recording", "verdict"),
}
"""What the report has beside the figures."""


class Watched(NamedTuple):
    """What everybody saw of the session; one of two pages opened in the middle."""

    session: str
    report: Figures
    pages: tuple[list[Figures], list[Figures]]
    metrics: dict[tuple[Any, ...], float]


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


async def watch(url: str, session: str) -> tuple[list[Figures], list[Figures]]:
    """All that two pages are sent; the session ends when the second one has seen it run."""
    told: tuple[list[Figures], list[Figures]] = [], []

    async def collect(client: aiohttp.ClientSession, into: list[Figures]) -> None:
        async with client.ws_connect(f"{url}/ws?session={session}") as page:
            async for message in page:
                into.append(document(message.data))
                if into[-1].get("ended"):
                    return

    def rows(into: list[Figures]) -> int:
        return min(sum(each.get("side") == side for each in into) for side in SIDES)

    async with asyncio.timeout(2 * PATIENCE), aiohttp.ClientSession() as client, asyncio.TaskGroup() as group:
        for into in told:
            group.create_task(collect(client, into))
            await soon(lambda into=into: rows(into) > 5, "rows")
        os.kill(int(session), signal.SIGINT)
    return told


async def metrics(url: str, session: str) -> dict[tuple[Any, ...], float]:
    async with aiohttp.ClientSession() as client, client.get(f"{url}/metrics") as response:
        text = await response.text()
    return {
        (sample.name, *sorted(value for key, value in sample.labels.items() if key != "session")): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
        if sample.labels.get("session") == session
    }


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Watched:
    folder = tmp_path_factory.mktemp("watched")
    out, go = folder / "report.json", folder / "go"
    arguments = (CONFIGS / "rotation.yaml", "--json", out, *PATIENT)
    with (
        Program("loopback", *arguments, prefix=(*HELD_BACK, str(go))) as program,
        Monitor(folder, "--session", program.pid) as monitor,
    ):
        url, session = monitor.url, str(program.pid)
        assert os.getpriority(os.PRIO_PROCESS, monitor.pid) >= 5, "daemons go before it"
        go.touch()
        pages = asyncio.run(watch(url, session))
        status, _, errors = program.finish()
        assert status == 0, errors
        return Watched(session, document(out.read_text()), pages, asyncio.run(metrics(url, session)))


@pytest.mark.realtime
def test_pages_end_with_the_figures_of_the_report_whenever_they_opened(watched: Watched) -> None:
    (last,), (late,) = ([message for message in page if message.get("ended")] for page in watched.pages)
    assert set(watched.report) - set(last["figures"]) <= UNTOLD
    assert_same(last["figures"], {key: watched.report[key] for key in last["figures"]})
    assert (last["seen_from_start"], last["faults"]) == (True, watched.report["faults"])
    assert late["figures"] == last["figures"]


@pytest.mark.realtime
def test_every_message_is_of_a_declared_type_and_rows_are_in_order(watched: Watched) -> None:
    declared: TypeAdapter[Any] = TypeAdapter(
        Annotated[Message, Field(discriminator="type")], config=ConfigDict(strict=True, extra="forbid")
    )
    for messages in watched.pages:
        for message in messages:
            declared.validate_python(message)
        assert {message["type"] for message in messages} >= {"hello", "handle", "samples", "felt", "figures", "events"}
        hello = [message for message in messages if message["type"] == "hello"][-1]
        assert (hello["session"], hello["present"]) == (watched.session, ["master", "slave"])
        for side in SIDES:
            times = [t for message in messages if message.get("side") == side for t in message["t"]]
            assert times == sorted(times)
    for side, channel in (("slave", "force"), ("master", "position")):
        sent = sum(sum(of["columns"]["sent"]) for of in watched.pages[0] if of.get("side") == side)
        assert sent == watched.report[channel]["packets"], "every send is a row"


@pytest.mark.realtime
def test_metrics_equal_the_report(watched: Watched) -> None:
    told, report = watched.metrics, watched.report
    for side in SIDES:
        ticks = report["ticks"][side]
        assert told["weberlink_ticks_total", side] == ticks["count"]
        lateness = told["weberlink_tick_lateness_seconds", "0.99", side]
        assert lateness == pytest.approx(ticks["lateness_us"]["p99"] * 1e-6)
        assert all((f"weberlink_{name}_total", side) in told for name in COUNTERS)
    for name in ("sent", "received", "lost", "dropped"):
        assert sum(told[f"weberlink_datagrams_{name}_total", side] for side in SIDES) == report["link"][name]
    for channel, side in (("force", "slave"), ("position", "master")):
        assert told["weberlink_updates_sent_total", side] == report[channel]["packets"]
        assert told["weberlink_reduction_ratio", channel] == pytest.approx(report[channel]["reduction"], rel=1e-9)
    assert (told["weberlink_session_live",], told["weberlink_session_seen_from_start",]) == (0, 1)


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
    assert (status, "Traceback" in said) == (0, False)
