"""`weberlink study experiment` and `weberlink study ratings` as their users run them."""

import io
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from plugins.studies.tests.experiment.studies import conduct, plan
from tests.program import free_port
from tests.session.systems import CONFIGS
from weberlink.cli import app
from weberlink_studies.experiment.command import ExperimentRequest, run
from weberlink_studies.experiment.ledger import TrainingDone, opened, path_of, read
from weberlink_studies.experiment.plan import order
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
    folder = tmp_path_factory.mktemp("study")
    result = simulated(folder)
    assert result.exit_code == 0, result.output
    return folder


# --- experiment, simulated


def test_a_simulated_subject_rates_every_condition(study: Path) -> None:
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


def test_paths_and_addresses_are_no_change(tmp_path: Path) -> None:
    moved = tmp_path / "elsewhere.yaml"
    moved.write_text(FILE.read_text())
    mine = TrialSignals(FILE, ())
    assert TrialSignals(moved, ("link.listen='127.0.0.1:5000'", "codec.force.weber=0.3")).digest == mine.digest
    assert TrialSignals(FILE, ("codec.force.reference=sent",)).digest != mine.digest


# --- experiment, live


class _Rates(io.StringIO):
    """Presses Enter at every question, rates as many trials however often they are repeated, and leaves."""

    def __init__(self, screen: io.StringIO, ratings: Sequence[str]) -> None:
        super().__init__()
        self._screen = screen
        self._ratings = [*ratings, ""]

    def readline(self, size: int = -1, /) -> str:
        is_over = len(self._ratings) == 1
        return self._ratings.pop(0) if is_over or self._screen.getvalue().endswith("Rating 0 to 5: ") else "\n"


def _ports() -> list[str]:
    port = free_port()
    return [f'link.listen="127.0.0.1:{port}"', f'link.slave="127.0.0.1:{port}"']


@pytest.mark.realtime
def test_a_person_rates_and_leaves(tmp_path: Path) -> None:
    """Both sides as processes, each trial recorded."""
    pytest.importorskip("weberlink_recording")
    screen = io.StringIO()
    patient = ("link.silence_ms=2000",)  # so that few trials are disturbed by a stall of the host
    request = ExperimentRequest(FILE, patient, tmp_path, 1, 0, SHORT, simulate=False, record=True)
    path = tmp_path / "subject-001.jsonl"

    def come(*ratings: str) -> None:
        source = _Rates(screen, ratings)
        words = run(request, ports=_ports, source=source, screen=screen, report=lambda done, of: None)
        assert words.startswith("continue with: "), words

    come()
    with opened(path) as ledger:
        ledger.append(TrainingDone())  # its references would be three more sessions
    come("4\n")
    progress = read(path)
    assert progress is not None
    ((number, entry),) = progress.rated.items()
    assert (number, entry.rating, entry.figures["outcome"]) == (1, 4, "completed")
    assert entry.figures["samples"] > 0
    assert entry.recording is not None
    assert (tmp_path / entry.recording).stat().st_size > 1000
    # A trial that a stall of the host disturbed is repeated, and its number then says which attempt it was.
    assert re.fullmatch(r"subject-001/trial-01(-\d)?\.mcap", entry.recording)


# --- ratings


def test_ratings_are_the_means_of_the_ledgers(tmp_path: Path) -> None:
    for number in (1, 2):
        conduct(path_of(tmp_path, number, simulated=False), first=plan(number))
    result = command("study", "ratings", tmp_path, "--json", "-", "--level", 3)
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert (document["subjects"], document["incomplete"], len(document["means"])) == ([1, 2], [], 30)
    rated = [event for path in tmp_path.iterdir() for event in lines_of(path) if "rating" in event]
    for row in document["means"]:
        mine = [e for e in rated if (e["predictor"], e["weber"]) == (row["predictor"], row["weber"])]
        assert len(mine) == row["units"] == 2
        assert row["rating_mean"] == pytest.approx(sum(e["rating"] for e in mine) / 2)
        assert row["packets_per_s_mean"] == pytest.approx(sum(e["figures"]["packets_per_s"] for e in mine) / 2)
        assert row["rating_low"] <= row["rating_mean"] <= row["rating_high"]
    assert document["tests"]["friedman_predictors"]["p"] is None  # too few subjects
