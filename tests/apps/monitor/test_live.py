"""One recorded session of six degrees of freedom, which pages, a browser, Prometheus and a recorder watch.

Only a live session shows that all of them tell what its report says.
"""

import asyncio
import os
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import aiohttp
import pytest
from prometheus_client.parser import text_string_to_metric_families
from pydantic import ConfigDict, Field, TypeAdapter

from tests.apps.monitor.browser import CHROMIUM, browser
from tests.apps.monitor.monitors import Monitor
from tests.program import PATIENT, Program, document, weberlink
from tests.system.systems import CONFIGS
from tests.wait import PATIENCE, soon, until
from weberlink.apps.monitor.messages import Message
from weberlink.apps.monitor.metrics import COUNTERS
from weberlink.telemetry.recording.reader import read_recording

Figures = dict[str, Any]
# Its number is known before it begins, so that everybody is there by then.
HELD_BACK = ("sh", "-c", 'while [ ! -e "$0" ]; do sleep 0.05; done; exec "$@"')
UNTOLD = {
    *("addresses", "drops", "dscp", "environment", "host", "lookahead_ms", "outcome", "peers", "playout_ms"),
    *("realtime", "recording", "verdict"),
}
"""What the report has beside the figures."""


@dataclass
class Watched:
    """What everybody saw of the session."""

    session: str
    report: Figures
    early: list[Figures]
    late: list[Figures]
    """Of pages, one of which opened in the middle."""
    shown: dict[str, str]
    """Figures in a browser; none where there is no browser."""
    metrics: dict[tuple[Any, ...], float]
    recording: Path
    niceness: int


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

    async def collect(page: aiohttp.ClientWebSocketResponse, into: list[Figures]) -> None:
        async for message in page:
            into.append(document(message.data))
            if into[-1].get("ended"):
                return

    def rows(into: list[Figures]) -> int:
        return min(sum(each.get("side") == side for each in into) for side in ("master", "slave"))

    async with asyncio.timeout(2 * PATIENCE), aiohttp.ClientSession() as client:
        address = f"{url}/ws?session={session}"
        async with client.ws_connect(address) as early:
            collecting = [asyncio.create_task(collect(early, told[0]))]
            await soon(lambda: rows(told[0]) > 5, "the session")
            async with client.ws_connect(address) as late:
                collecting.append(asyncio.create_task(collect(late, told[1])))
                await soon(lambda: rows(told[1]) > 5, "rows of the later page")
                os.kill(int(session), signal.SIGINT)
                await asyncio.gather(*collecting)
    return told


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Watched:
    folder = tmp_path_factory.mktemp("watched")
    out, go, recording = folder / "report.json", folder / "go", folder / "live.mcap"
    arguments = (CONFIGS / "rotation.yaml", "--json", out, "--record", recording, *PATIENT)
    shown: dict[str, str] = {}
    with (
        Program("loopback", *arguments, prefix=(*HELD_BACK, str(go))) as program,
        Monitor(folder, "--session", program.pid) as monitor,
    ):
        address = monitor.address
        opened = browser(folder / "profile") if CHROMIUM is not None else None
        page = None if opened is None else opened.__enter__()
        try:
            if page is not None:
                page.open(address)
            go.touch()
            early, late = asyncio.run(watch(monitor.url, str(program.pid)))
            status, _, errors = program.finish()
            assert status == 0, errors
            if page is not None:
                until(lambda: page.data("state") == "ended", "the end on the page")
                figures = (
                    "[...document.querySelectorAll('[data-figure]')].map(e => [e.dataset.figure, e.dataset.value])"
                )
                shown = dict(page.run(f"return {figures}"))
                assert (page.console(), len(page.hosts())) == ([], 1)
        finally:
            if opened is not None:
                opened.__exit__(None, None, None)
        niceness = os.getpriority(os.PRIO_PROCESS, monitor.pid)
        exposed = asyncio.run(metrics(monitor.url, str(program.pid)))
    report = document(out.read_text())
    return Watched(str(program.pid), report, early, late, shown, exposed, recording, niceness)


async def metrics(url: str, session: str) -> dict[tuple[Any, ...], float]:
    async with aiohttp.ClientSession() as client, client.get(f"{url}/metrics") as response:
        assert response.content_type == "text/plain"
        text = await response.text()
    return {
        (sample.name, *sorted(value for key, value in sample.labels.items() if key != "session")): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
        if sample.labels.get("session") == session
    }


def final(messages: list[Figures]) -> Figures:
    (last,) = (message for message in messages if message.get("ended"))
    return last


@pytest.mark.realtime
def test_pages_end_with_the_figures_of_the_report_whenever_they_opened(watched: Watched) -> None:
    last = final(watched.early)
    assert set(watched.report) - set(last["figures"]) <= UNTOLD
    assert_same(last["figures"], {key: watched.report[key] for key in last["figures"]})
    assert (last["seen_from_start"], last["faults"]) == (True, watched.report["faults"])
    assert final(watched.late)["figures"] == last["figures"]


@pytest.mark.realtime
def test_every_message_is_of_a_declared_type_and_rows_are_in_order(watched: Watched) -> None:
    declared: TypeAdapter[Any] = TypeAdapter(
        Annotated[Message, Field(discriminator="type")], config=ConfigDict(strict=True, extra="forbid")
    )
    for messages in (watched.early, watched.late):
        for message in messages:
            declared.validate_python(message)
        assert {message["type"] for message in messages} >= {"hello", "handle", "samples", "felt", "figures", "events"}
        hello = [message for message in messages if message["type"] == "hello"][-1]
        assert (hello["session"], hello["present"]) == (watched.session, ["master", "slave"])
        for side in ("master", "slave"):
            times = [t for message in messages if message.get("side") == side for t in message["t"]]
            assert times == sorted(times)
    for side, channel in (("slave", "force"), ("master", "position")):
        sent = sum(sum(of["columns"]["sent"]) for of in watched.early if of.get("side") == side)
        assert sent == watched.report[channel]["packets"], "every send is a row"


@pytest.mark.realtime
def test_browser_shows_the_figures_of_the_report(watched: Watched) -> None:
    if not watched.shown:
        pytest.skip("needs a browser and its driver: apt-get install chromium chromium-driver")
    report = watched.report | {"felt": watched.report["force"]}
    assert len(watched.shown) > 25
    for path, exact in watched.shown.items():
        value: Any = None if path.startswith(("joint_", "gripper_")) else report
        for key in path.split("."):
            value = (value or {}).get(key)
        if not path.startswith("now."):  # of the last moment, which no report has
            expected = float("nan") if value is None else value
            assert float(exact or "nan") == pytest.approx(expected, rel=1e-9, nan_ok=True), path


@pytest.mark.realtime
def test_metrics_equal_the_report(watched: Watched) -> None:
    told, report = watched.metrics, watched.report
    for side in ("master", "slave"):
        ticks = report["ticks"][side]
        assert told["weberlink_ticks_total", side] == ticks["count"]
        assert told["weberlink_ticks_missed_total", side] == ticks["missed"]
        for quantile, percentile in (("0.5", "p50"), ("0.99", "p99"), ("0.999", "p99_9")):
            value = told["weberlink_tick_lateness_seconds", quantile, side]
            assert value == pytest.approx(ticks["lateness_us"][percentile] * 1e-6)
        assert all((f"weberlink_{name}_total", side) in told for name in COUNTERS)
    for name in ("sent", "received", "lost", "dropped"):
        total = sum(told[f"weberlink_datagrams_{name}_total", side] for side in ("master", "slave"))
        assert total == report["link"][name]
    for channel, side in (("force", "slave"), ("position", "master")):
        assert told["weberlink_updates_sent_total", side] == report[channel]["packets"]
        for name, figure in (
            ("packets_per_second", "packets_per_s"),
            ("reduction_ratio", "reduction"),
            ("violation_ratio", "violation_fraction"),
        ):
            assert told[f"weberlink_{name}", channel] == pytest.approx(report[channel][figure], rel=1e-9)
    assert told["weberlink_session_duration_seconds",] == pytest.approx(report["duration_s"])
    assert (told["weberlink_session_live",], told["weberlink_session_seen_from_start",]) == (0, 1)


@pytest.mark.realtime
def test_recording_has_every_record_and_the_figures_of_the_report(watched: Watched) -> None:
    made, report = read_recording(watched.recording), watched.report
    told = report["recording"]
    assert (told["outcome"], any(told["lost"].values()), made.complete) == ("complete", False, True)
    assert told["bytes"] == watched.recording.stat().st_size
    counts = {side: report["ticks"][side]["count"] for side in ("master", "slave")}
    assert told["records"] == {side: len(made.records[side]) for side in ("master", "slave")} == counts
    found = document(weberlink("record", "info", watched.recording, "--json", "-").output)
    for key in ("duration_s", "force", "position", "torque", "orientation", "link"):
        assert_same(found[key], report[key], key)


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
    assert (status, "Traceback" in said, "weberlink loopback" in said) == (0, False, True)
