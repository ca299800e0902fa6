"""`weberlink study experiment` and `weberlink study ratings` as their users run them."""

import io
import json
import os
import pty
import re
import signal
import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from tests.program import ENGAGED, Program
from tests.system.packages import install
from tests.system.systems import CONFIGS, raw, steps
from tests.wait import until
from weberlink.cli import app
from weberlink.geometry.vector import ZERO, distance
from weberlink.protocol.keys import generate
from weberlink.system.configuration import load
from weberlink.system.simulate import build_simulation
from weberlink_studies.experiment.command import ExperimentRequest, run
from weberlink_studies.experiment.ledger import read
from weberlink_studies.experiment.plan import REFERENCES, order
from weberlink_studies.experiment.trial_runner import TrialSignals
from weberlink_studies.paper.claims import PREDICTORS

FILE = CONFIGS / "loopback.yaml"
SHORT = 0.5
"""Length of a trial [s]: enough to touch something for who begins on the surface."""
ON_SURFACE = "master.device.home_m=[-0.03, -0.02, -0.001]"


def command(*arguments: object) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)))


def simulated(folder: Path, *further: object) -> Result:
    return command(
        "study", "experiment", FILE, "--simulate", "--out", folder, "--duration", SHORT, "--set", ON_SURFACE, *further
    )


def lines_of(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two simulated subjects."""
    folder = tmp_path_factory.mktemp("study")
    for _ in range(2):
        result = simulated(folder)
        assert result.exit_code == 0, result.output
    return folder


# --- experiment, simulated


def test_a_simulated_subject_rates_every_condition(study: Path) -> None:
    assert sorted(path.name for path in study.iterdir()) == ["simulated-001.jsonl", "simulated-002.jsonl"]
    plan, *events = lines_of(study / "simulated-001.jsonl")
    assert plan["simulated"] is True
    assert all(event["simulated"] is True for event in events)
    rated = [event for event in events if event["event"] == "trial_rated"]
    assert [(event["predictor"], event["weber"]) for event in rated] == [(c.predictor, c.weber) for c in order(0, 1)]
    for event in rated:
        figures = event["figures"]
        assert figures["outcome"] == "completed"
        assert figures["faults"] == {"master": {}, "slave": {}}
        for name in ("packets_per_s", "reduction", "error_rms", "violation_fraction", "error_rms_jnd"):
            assert figures[name] >= 0.0
    assert [event["level"] for event in events if event["event"] == "reference"] == [5, 3, 1]
    # More packets at a smaller Weber factor, and most in the reference in which every sample is sent.
    rates = {(event["predictor"], event["weber"]): event["figures"]["packets_per_s"] for event in rated}
    assert all(rates[predictor, 0.025] > rates[predictor, 0.30] for predictor in PREDICTORS)
    reference = next(event for event in events if event["event"] == "reference")
    assert reference["figures"]["packets_per_s"] > 3 * max(rates.values())


@pytest.mark.hunt
def test_after_a_kill_the_ratings_are_the_same(study: Path, tmp_path: Path) -> None:
    path = tmp_path / "simulated-001.jsonl"
    arguments = ("study", "experiment", FILE, "--simulate", "--out", tmp_path, "--subject", 1)
    with Program(*arguments, "--duration", SHORT, "--set", ON_SURFACE) as program:
        until(lambda: path.exists() and path.read_bytes().count(b'"trial_rated"') >= 5, "five ratings")
        program.send(signal.SIGKILL)
        program.finish()
    found = read(path)
    assert found is not None
    assert 5 <= len(found.rated) < 30
    result = command(*arguments, "--set", ON_SURFACE)  # the length of a trial is known
    assert result.exit_code == 0, result.output
    whole = [
        [(e["rating"], e["figures"]) for e in lines_of(folder / path.name) if e["event"] == "trial_rated"]
        for folder in (study, tmp_path)
    ]
    assert whole[0] == whole[1]


def test_paths_and_addresses_are_no_change(study: Path, tmp_path: Path) -> None:
    moved = tmp_path / "elsewhere.yaml"
    moved.write_text(FILE.read_text())
    mine = TrialSignals(FILE, ())
    assert TrialSignals(moved, ("link.listen='127.0.0.1:5000'", "codec.force.weber=0.3")).digest == mine.digest
    assert TrialSignals(FILE, ("codec.force.reference=sent",)).digest != mine.digest
    trace = tmp_path / "operator.npz"
    trace.write_bytes((CONFIGS / "traces" / "operator.npz").read_bytes())
    override = f"master.device.trace={trace}"
    replay = CONFIGS / "replay.yaml"
    assert TrialSignals(replay, (override,)).digest == TrialSignals(replay, ()).digest  # the same content elsewhere
    with np.load(trace) as held:
        arrays = dict(held)
    arrays["t"][1] = 0.0011
    np.savez(trace, **arrays)
    assert TrialSignals(replay, (override,)).digest != TrialSignals(replay, ()).digest


def test_an_edited_file_stops_the_experiment(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(FILE.read_text())

    def edit(done: int, of: int) -> None:
        if done == 2:
            file.write_text(FILE.read_text().replace("stiffness_n_m: 500}", "stiffness_n_m: 400}"))

    request = ExperimentRequest(file, (ON_SURFACE,), tmp_path, None, 0, SHORT, simulate=True, record=False)
    with pytest.raises(ValueError, match="changed during the experiment") as caught:
        run(request, ports=list, source=io.StringIO(), screen=io.StringIO(), report=edit)
    assert "slave.scene" in str(caught.value)
    progress = read(tmp_path / "simulated-001.jsonl")
    assert progress is not None
    assert len(progress.rated) == 2


@pytest.mark.parametrize(
    ("file", "force"),
    [("loopback.yaml", "deadband={shape: level_crossing}"), ("rotation.yaml", "smooth_ms=20")],
)
def test_the_best_reference_disturbs_no_channel(file: str, force: str) -> None:
    signals = TrialSignals(CONFIGS / file, (f"codec.force.{force}", "codec.position.weber=0.5"))
    simulation = build_simulation(load(CONFIGS / file, signals.with_condition(REFERENCES[0].condition)))
    bounds, apart, before = [], [], ZERO
    for step in list(steps(simulation, 2.0)):
        if step.master.state == step.slave.state == ENGAGED and not step.slave.ramping:
            bounds += [step.master.bound, step.slave.bound, step.master.rotation_bound, step.slave.rotation_bound]
            commanded = (step.slave.position_x, step.slave.position_y, step.slave.position_z)
            apart.append(min(distance(commanded, raw(step.master)), distance(commanded, before)))
        before = raw(step.master)
    assert len(apart) > 1000
    assert max(bounds) == 0.0
    assert max(apart) <= 0.5 * 3**0.5 * 1e-5 * 1.001, "half a wire step on each axis"


# --- experiment, live


class _RatesOnce(io.StringIO):
    """Presses Enter at every question, rates one trial however often it is repeated, and leaves."""

    def __init__(self, screen: io.StringIO) -> None:
        super().__init__()
        self._screen = screen
        self._ratings = ["4\n", ""]

    def readline(self, size: int = -1, /) -> str:
        is_over = len(self._ratings) == 1
        return self._ratings.pop(0) if is_over or self._screen.getvalue().endswith("Rating 0 to 5: ") else "\n"


def _ports() -> list[str]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    return [f'link.listen="127.0.0.1:{port}"', f'link.slave="127.0.0.1:{port}"']


@pytest.mark.realtime
def test_a_person_rates_and_leaves(tmp_path: Path) -> None:
    """Both sides as processes, each trial recorded."""
    pytest.importorskip("mcap")
    screen = io.StringIO()
    patient = ("link.silence_ms=2000",)  # so that few trials are disturbed by a stall of the host
    request = ExperimentRequest(FILE, patient, tmp_path, 1, 0, SHORT, simulate=False, record=True)
    words = run(request, ports=_ports, source=_RatesOnce(screen), screen=screen, report=lambda done, of: None)
    assert words.startswith("continue with: "), words
    progress = read(tmp_path / "subject-001.jsonl")
    assert progress is not None
    ((number, entry),) = progress.rated.items()
    assert (number, entry.rating, entry.figures["outcome"]) == (1, 4, "completed")
    assert entry.figures["samples"] > 0
    assert entry.recording is not None
    assert (tmp_path / entry.recording).stat().st_size > 1000
    # A trial that a stall of the host disturbed is repeated, and its number then says which attempt it was.
    assert re.fullmatch(r"subject-001/trial-01(-\d)?\.mcap", entry.recording)


HELD = '''
from weberlink.master.devices.operator import OperatorDevice

class Held(OperatorDevice):
    """Stands for a device that a person holds."""
'''


@pytest.mark.realtime
def test_ctrl_c_in_a_live_trial_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = pty.openpty()
    (site := tmp_path / "site").mkdir()
    install(site, "held", {"held": HELD}, "[weberlink.devices]\nheld = held:Held")
    monkeypatch.setenv("PYTHONPATH", str(site))
    generate(key := tmp_path / "trial.key")
    secured = ("--set", "link.security=psk", "--set", f"link.key_file={key}", "--set", "master.device.driver=held")
    path = tmp_path / "subject-001.jsonl"
    try:
        with Program(
            "study", "experiment", FILE, *secured, "--out", tmp_path, "--duration", 30, "--no-record", terminal=theirs
        ) as program:
            shown = _read_until(ours, b"Enter to start: ")
            os.write(ours, b"\n")
            until(lambda: len(program.daemons()) == 2, "two daemons")
            shown += _read_until(ours, b"29 s left")
            program.send(signal.SIGINT)
            shown += _read_until(ours, b"continue with: ")
            status, _, _ = program.finish()
            assert status == 0
            assert program.rings() == []
    finally:
        os.close(ours)
        os.close(theirs)
    text = shown.decode().partition("continue with: ")[0]  # a command is not broken
    assert max(map(len, re.split(r"[\r\n]+", text))) < 80
    progress = read(path)
    assert progress is not None
    assert not progress.references
    assert not progress.rated


def _read_until(descriptor: int, text: bytes) -> bytes:
    shown = b""
    while text not in shown:
        shown += os.read(descriptor, 4096)
    return shown


# --- ratings


def test_ratings_are_the_means_of_the_ledgers(study: Path) -> None:
    result = command("study", "ratings", study, "--json", "-", "--level", 3)
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert document["subjects"] == [1, 2]
    assert document["incomplete"] == []
    rated = [
        event for number in (1, 2) for event in lines_of(study / f"simulated-00{number}.jsonl") if "rating" in event
    ]
    assert [(row["trial"], row["predictor"], row["rating"]) for row in document["rows"]] == [
        (event["trial"], event["predictor"], event["rating"]) for event in rated
    ]
    assert list(dict.fromkeys(row["predictor"] for row in document["means"])) == list(PREDICTORS)
    assert len(document["means"]) == 30
    for row in document["means"]:
        mine = [e for e in rated if (e["predictor"], e["weber"]) == (row["predictor"], row["weber"])]
        assert len(mine) == row["units"] == 2
        assert row["rating_mean"] == pytest.approx(sum(e["rating"] for e in mine) / 2)
        assert row["packets_per_s_mean"] == pytest.approx(sum(e["figures"]["packets_per_s"] for e in mine) / 2)
        assert row["rating_low"] <= row["rating_mean"] <= row["rating_high"]
    assert document["tests"]["friedman_predictors"]["p"] is None  # too few subjects
    assert document["savings"]["level"] == 3.0
