"""The commands as their user runs them."""

import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner

from benchmarks import programs
from benchmarks.__main__ import app
from benchmarks.percentiles import NAMES
from tests.program import Program, document
from weberlink.system.configuration import SIDES


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        (("--duration", "0.5"), "--duration"),
        (("no-such.yaml",), "no-such.yaml"),
        (("--set", "rate_hz=500"), "rate_hz"),
        (("--set", "nonsense=1"), "nonsense"),
    ],
)
def test_a_wrong_argument_is_one_line_that_names_it(arguments: tuple[str, ...], field: str) -> None:
    ended = CliRunner().invoke(app, ["bench", *arguments])
    assert (ended.exit_code, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)
    assert field in ended.stderr


@pytest.mark.realtime
def test_a_failed_measurement_has_status_1() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        options = [f'--set=link.{end}="{address}"' for end in ("listen", "slave")]
        with Program("--quick", *options, module="benchmarks") as program:
            status, said, complaints = program.finish()
    assert (status, said, address in complaints, "Traceback" in complaints) == (1, "", True, False)


@pytest.mark.hunt  # half a minute alone on the machine
@pytest.mark.realtime(alone=True)
def test_a_quick_run_measures_everything(tmp_path: Path) -> None:
    out = tmp_path / "bench.json"
    with Program("--quick", "--json", out, "--plots", tmp_path / "figures", module="benchmarks") as program:
        status, said, complaints = program.finish(60.0)
    assert (status, complaints) == (0, "")
    found = document(out.read_text(encoding="utf-8"))
    assert found["quick"] is True
    for rate in found["lateness"]:
        assert rate["limit"]["name"] == (programs.cyclictest_version() or "timerfd in Python")
        for daemon in (rate["daemons"][each] for each in SIDES):
            assert daemon["ticks"] + daemon["missed"] > 0.5 * rate["rate_hz"] * found["duration_s"]
            assert daemon["lateness_us"]["p50"] <= daemon["lateness_us"]["p99_9"] <= daemon["lateness_us"]["max"]
            assert daemon["cpu_share"] > 0.0
    for way in ("position", "force", "round_trip"):
        assert all(found["latency"]["weberlink_us"][way][name] > 0.0 for name in NAMES)
    for step in ("send", "receive"):
        assert all(found["update_cost_us"][step][caches]["p50"] > 0.0 for caches in ("warm", "cold"))
    assert found["start_up"]["loopback"]["median_s"] > found["start_up"]["interpreter"]["median_s"]
    assert max(map(len, said.splitlines())) <= 80
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {"lateness.png"}
