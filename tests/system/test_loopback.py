"""`weberlink loopback` as its user runs it: processes, signals, a terminal, and what is left behind (nothing)."""

import os
import signal
import socket
from contextlib import suppress
from math import cos, pi, sin
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
import pytest

from tests.program import ENGAGED, PATIENT, Program, document, faults_of
from tests.system.systems import CONFIGS
from tests.terminals import WIDTH, on_terminal
from tests.wait import until
from weberlink.protocol.keys import generate
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.ring import process_started

pytestmark = pytest.mark.realtime

LIMIT, RAMP, WEBER = 10.0, 0.05, 0.1
"""Of the default configuration [N], [s], [1]."""
PERCENTILES = ("p50", "p99", "p99_9", "max")
CHANNEL = (
    "samples",
    "packets",
    "packets_per_s",
    "reduction",
    "reduction_all",
    "bytes_per_s",
    "error_rms",
    "error_max",
    "violation_fraction",
)
NUMBERS = (
    "duration_s",
    *(f"ticks.{side}.{name}" for side in ("master", "slave") for name in ("count", "missed")),
    *(f"ticks.{side}.lateness_us.{name}" for side in ("master", "slave") for name in PERCENTILES),
    *(f"{channel}.{name}" for channel in ("force", "position") for name in CHANNEL),
    *(f"link.{name}.{percentile}" for name in ("rtt_us", "one_way_us") for percentile in ("p50", "p99")),
    *(f"link.{name}" for name in ("sent", "received", "lost", "dropped")),
    "energy.generated_j",
    "energy.dissipated_j",
)
"""Figures of a live run that other tools rely on; beside them, `faults` and `outcome`."""


def figure(summary: dict[str, Any], path: str) -> Any:
    value: Any = summary
    for key in path.split("."):
        value = value[key]
    return value


def assert_nothing_left(program: Program, daemons: list[int]) -> None:
    until(lambda: not any(process_started(pid) for pid in daemons), f"the end of the daemons {daemons}")
    assert program.rings() == []


def fits(text: str, width: int = WIDTH) -> bool:
    return all(len(line) <= width for line in text.splitlines())


def has_ipv6() -> bool:
    with suppress(OSError), socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as probe:
        probe.bind(("::1", 0))
        return True
    return False


@pytest.fixture(scope="module")
def three_seconds(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, dict[str, Any]]:
    """What a run of three seconds prints, and what it writes."""
    out = tmp_path_factory.mktemp("loopback") / "out.json"
    with Program("loopback", "--duration", 3, "--json", out, *PATIENT) as program:
        daemons = until(lambda: len(program.daemons()) == 2 and program.daemons(), "two daemons")
        assert isinstance(daemons, list)
        status, output, errors = program.finish()
        assert (status, errors) == (0, "")
        assert_nothing_left(program, daemons)
    return output, document(out.read_text())


def test_every_documented_figure_is_there_and_a_number(three_seconds: tuple[str, dict[str, Any]]) -> None:
    _, summary = three_seconds
    for path in NUMBERS:
        assert isinstance(figure(summary, path), int | float), path
    assert faults_of(summary) == {"master": {}, "slave": {}}
    assert summary["outcome"] == "completed"


def test_figures_agree_with_each_other(three_seconds: tuple[str, dict[str, Any]]) -> None:
    _, summary = three_seconds
    ticks, force = summary["ticks"], summary["force"]
    assert ticks["master"]["count"] + ticks["master"]["missed"] >= 3000
    assert summary["duration_s"] >= 3.0
    assert force["reduction"] == pytest.approx(1.0 - force["packets"] / force["samples"])
    assert force["packets_per_s"] == pytest.approx(force["packets"] / summary["duration_s"])
    assert force["reduction_all"] < force["reduction"]
    assert force["samples"] <= ticks["slave"]["count"]
    assert sum(force["selected"].values()) == force["packets"]
    assert summary["link"]["received"] + summary["link"]["dropped"] <= summary["link"]["sent"]


def test_the_default_saves_nine_packets_in_ten(three_seconds: tuple[str, dict[str, Any]]) -> None:
    _, summary = three_seconds
    assert summary["force"]["reduction"] >= 0.9
    assert summary["position"]["reduction"] >= 0.9
    assert summary["force"]["packets"] > 0  # the hand did touch something


def test_the_report_fits_80_columns(three_seconds: tuple[str, dict[str, Any]]) -> None:
    output, _ = three_seconds
    assert output.split()[0] in ("good", "degraded")
    assert "\nweberlink loopback" in output
    assert fits(output)


@pytest.mark.hunt
def test_two_at_once_each_write_json_and_nothing_else(tmp_path: Path) -> None:
    """One plain, over IPv6 if the host has it; one with a key over a bad link. Each finds a port that is free."""
    generate(key := tmp_path / "key")
    ipv6 = [argument for side in ("listen", "slave") for argument in ("--set", f'link.{side}="[::1]:0"')]
    secured = (f"link.key_file={key}", "link.security=psk")
    bad = ("link.emulate.delay_ms=5", "link.emulate.loss=0.2")
    overrides = [argument for text in (*secured, *bad) for argument in ("--set", text)]
    with (
        Program("loopback", "--duration", 1, "--json", "-", *(ipv6 if has_ipv6() else ())) as plain,
        Program("loopback", "--duration", 1, "--json", "-", *overrides) as emulated,
    ):
        ended = [program.finish() for program in (plain, emulated)]
    assert [(status, errors) for status, _, errors in ended] == [(0, ""), (0, "")]
    first, second = (document(output) for _, output, _ in ended)
    assert first["outcome"] == second["outcome"] == "completed"
    for summary in (first, second):
        assert summary["force"]["samples"] > 0
        assert "bad_tag" not in summary["drops"]["master"] | summary["drops"]["slave"]
    assert first["link"]["lost"] == 0
    assert second["link"]["lost"] > 0
    assert second["link"]["rtt_us"]["p50"] >= 10_000


@pytest.mark.hunt
def test_daemons_that_poll_leave_room_for_others_and_end_by_a_signal() -> None:
    """At ordinary priority: two processors may be all that the host has."""
    polling = ("--set", "realtime.busy_poll=true", "--set", "realtime.priority=0")
    with Program("loopback", "--json", "-", *polling, *PATIENT) as program:
        program.engaged("master")
        sleep(0.3)
        program.send(signal.SIGTERM)
        status, output, _ = program.finish()
    summary = document(output)
    assert (status, summary["outcome"]) == (0, "terminated")
    assert faults_of(summary) == {"master": {}, "slave": {}}


def test_a_signal_while_the_daemons_start_is_an_orderly_end() -> None:
    with Program("loopback", "--json", "-") as program:
        until(lambda: len(program.daemons()) == 2, "two daemons")
        program.send(signal.SIGTERM)
        status, output, errors = program.finish()
        assert document(output)["outcome"] == "terminated"
        assert (status, errors) == (0, "")
        assert_nothing_left(program, [])


def test_daemons_whose_launcher_is_killed_stop_by_themselves_and_in_order() -> None:
    """However many threads it had: the kernel tells the daemons of the death of each."""
    with Program("loopback") as program:
        sides = [program.engaged(side) for side in ("master", "slave")]
        until(lambda: np.linalg.norm(sides[0].last["output"]) > 1.0, "contact")
        program.send(signal.SIGKILL)
        _, _, errors = program.finish()  # whose end comes when the daemons have let go of it
        assert_nothing_left(program, [side.pid for side in sides])  # a ring is removed in an orderly stop only
        records = sides[0].records[-200:]
    force = np.linalg.norm(records["output"], axis=1)
    assert force[-1] == 0.0
    assert force.max() > 1.0
    elapsed = np.diff(records["at"] + 1e-6 * records["lateness_us"].astype(np.float64))
    assert (-np.diff(force) <= LIMIT * elapsed / RAMP + LIMIT * WEBER).all()  # faded, but for an update on the way
    assert errors == ""


@pytest.mark.realtime(alone=True)
def test_a_stall_of_one_end_does_not_pass_for_silence_of_the_other() -> None:
    """A daemon that was stopped for longer than the limit finds the datagrams of its peer in the socket."""
    with Program("loopback", "--json", "-") as program:
        master, slave = (program.engaged(side) for side in ("master", "slave"))
        for met in range(3):
            os.kill(slave.pid, signal.SIGSTOP)
            until(lambda: master.last["fault"] == Fault.SILENCE, f"silence {met}")
            os.kill(slave.pid, signal.SIGCONT)
            until(lambda: master.last["fault"] == Fault.NONE and master.last["state"] == ENGAGED, "the slave")
        program.send(signal.SIGTERM)
        status, output, errors = program.finish()
    assert (status, errors) == (0, "")
    faults = document(output)["faults"]
    assert faults["master"]["silence"] == 3
    assert faults["slave"]["stalled"] >= 3
    assert "silence" not in faults["slave"]


@pytest.mark.hunt
def test_late_launcher_reports_every_record() -> None:
    """It begins to read only when the master has ended."""
    with Program("loopback", "--duration", 0.5, "--json", "-", *PATIENT) as program:
        pids = until(lambda: pids if len(pids := program.daemons()) == 2 else None, "two daemons")
        program.send(signal.SIGSTOP)
        until(lambda: any(process_started(pid) is None for pid in pids), "the end of the master")
        program.send(signal.SIGCONT)
        status, output, _ = program.finish()
    ticks = document(output)["ticks"]["master"]
    assert status == 0
    assert ticks["count"] + ticks["missed"] >= 500


def test_after_a_stall_of_the_master_force_begins_at_zero_and_a_signal_ends_the_run_with_its_report() -> None:
    with Program("loopback") as program:
        master, slave = (program.engaged(side) for side in ("master", "slave"))
        until(lambda: np.linalg.norm(master.last["output"]) > 2.0, "a contact")
        os.kill(master.pid, signal.SIGSTOP)
        sleep(0.3)
        os.kill(master.pid, signal.SIGCONT)
        until(lambda: np.diff(master.records["at"]).max() > 0.25, "the end of the stall")
        ended = float(master.last["at"])
        until(lambda: master.last["at"] > ended + 0.2, "the force to fade in")
        records = master.records
        program.send(signal.SIGINT)
        status, output, errors = program.finish()
        assert (status, errors) == (0, "")
        (title,) = (line for line in output.splitlines() if line.startswith("weberlink loopback"))
        assert "interrupted" in title
        assert fits(output)
        assert_nothing_left(program, [master.pid, slave.pid])
        assert not master.last["output"].any()  # force is zero before the end
    after = int(np.argmax(np.diff(records["at"]))) + 1
    # A record carries the deadline of its tick; the signal may have stopped the process within the tick before.
    (first,) = (tick for tick in (after, after - 1) if records["fault"][tick] == Fault.STALLED)
    felt = np.linalg.norm(records["output"], axis=1)
    assert felt[first - 1] > 1.0
    assert felt[first] == 0.0
    assert np.diff(felt[first : first + 50]).max() <= 2.0 * 10.0 * 1e-3 / 0.05 + 0.5  # a late tick counts as two


def test_on_a_terminal_a_status_line_goes_before_the_report_and_both_fit() -> None:
    status, lines = on_terminal("loopback", "--duration", 1)
    assert status == 0
    assert max(map(len, lines)) <= WIDTH
    report = next(index for index, line in enumerate(lines) if line.startswith("weberlink loopback"))
    assert "completed" in lines[report]
    live = [line for line in lines[:report] if "engaged" in line]
    assert any("force" in line and "rtt" in line for line in live)
    assert not any("engaged" in line for line in lines[report:])


@pytest.mark.hunt
def test_a_replay_runs_to_the_end_of_its_trace(tmp_path: Path) -> None:
    trace = tmp_path / "trace.csv"
    angles = [2.0 * pi * index / 800 for index in range(800)]
    rows = [f"{i / 1000},{0.01 * sin(a)},0,{0.01 * cos(a)},0,0,0" for i, a in enumerate(angles)]
    trace.write_text("\n".join(["t,px,py,pz,fx,fy,fz", *rows]))
    overrides = ("--set", f"master.device.trace={trace}", "--set", "master.device.approach_s=0.2")
    with Program("loopback", CONFIGS / "replay.yaml", *overrides, "--json", "-") as program:
        status, output, errors = program.finish()
    summary = document(output)
    assert (status, errors, summary["outcome"]) == (0, "", "completed")
    assert summary["duration_s"] >= 0.999
    assert summary["force"]["packets"] > 0  # half of the circle lies in the plane
