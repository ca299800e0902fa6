"""The command as its user runs it."""

import signal
import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner

from benchmarks import programs
from benchmarks.__main__ import app
from benchmarks.percentiles import NAMES
from tests.program import Program, document
from tests.wait import until
from weberlink.system.configuration import SIDES


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--duration", "0.5"), "--duration"),
        (("no-such.yaml",), "no-such.yaml"),
        (("--set", "rate_hz=500"), "--set rate_hz: cannot be set for the benchmarks"),
        (("--set", "nonsense=1"), "nonsense"),
    ],
)
def test_wrong_arguments_are_one_line(arguments: tuple[str, ...], complaint: str) -> None:
    ended = CliRunner().invoke(app, ["bench", *arguments])
    assert ended.exit_code == 2
    assert complaint in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert ended.stdout == ""


@pytest.mark.realtime(alone=True)
def test_a_failed_measurement_has_status_1() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        options = [f'--set=link.{end}="{address}"' for end in ("listen", "slave")]
        with Program("--quick", *options, module="benchmarks") as program:
            status, said, complaints = program.finish()
    assert (status, said) == (1, "")
    assert f"weberlink: weberlink loopback: weberlink slave: UDP {address} is in use" in complaints
    assert "Traceback" not in complaints


@pytest.mark.hunt  # a limit is measured before
@pytest.mark.realtime
def test_ctrl_c_ends_with_the_parts_so_far() -> None:
    with Program("--quick", "--json", "-", module="benchmarks") as program:
        until(lambda: any(b"loopback" in command for command in program.children().values()), "a daemon")
        program.send(signal.SIGINT)
        status, said, complaints = program.finish()
    assert status == 130
    assert document(said)["kind"] == "weberlink bench partial"
    assert complaints == "weberlink: interrupted: 0 of 7 parts are done, and in the JSON above\n"


@pytest.mark.hunt  # half a minute alone on the machine
@pytest.mark.realtime(alone=True)
def test_a_quick_run_measures_everything(tmp_path: Path) -> None:
    out = tmp_path / "bench.json"
    with Program("--quick", "--json", out, "--plots", tmp_path / "figures", module="benchmarks") as program:
        status, said, complaints = program.finish()
    assert (status, complaints) == (0, "")
    found = document(out.read_text(encoding="utf-8"))
    assert found["quick"] is True
    assert [rate["rate_hz"] for rate in found["lateness"]] == [1000.0, 2000.0, 4000.0]
    for rate in found["lateness"]:
        assert rate["limit"]["name"] == (programs.cyclictest_version() or "timerfd in Python")
        assert rate["limit"]["cycles"] > 0
        assert 0.0 <= rate["limit"]["missed_share"] < 1.0
        for side in SIDES:
            daemon = rate["daemons"][side]
            assert daemon["ticks"] + daemon["missed"] > 0.5 * rate["rate_hz"] * found["duration_s"]
            assert daemon["lateness_us"]["p50"] <= daemon["lateness_us"]["p99_9"] <= daemon["lateness_us"]["max"]
            assert daemon["cpu_share"] > 0.0
    for way in ("position", "force", "round_trip"):
        assert all(found["latency"]["weberlink_us"][way][name] > 0.0 for name in NAMES)
    assert (found["latency"]["sockperf"] is None) is (programs.sockperf_version() is None)
    for step in ("send", "receive"):
        assert all(found["update_cost_us"][step][caches]["p50"] > 0.0 for caches in ("warm", "cold"))
    assert found["steal_share"] is not None
    assert found["cpu"]["slave"]["cpu_us_per_tick"] > 0.0
    assert found["memory"]["master"]["first_kib"] > 1000
    assert found["start_up"]["loopback"]["median_s"] > found["start_up"]["interpreter"]["median_s"]
    assert len(found["targets"]) == 11
    assert "a quick run, no measurement" in said
    assert max(map(len, said.splitlines())) <= 80
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {"lateness.png"}
