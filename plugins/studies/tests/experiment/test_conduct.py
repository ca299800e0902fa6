"""Plan and order of an experiment, and what the ledger says of it."""

import json
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from plugins.studies.tests.experiment.studies import Rig, Robot, conduct, plan
from weberlink_studies.experiment.ledger import read
from weberlink_studies.experiment.plan import REFERENCES, order
from weberlink_studies.paper.claims import PREDICTORS, WEBERS


@given(st.integers(0, 2**63), st.integers(1, 10_000))
def test_an_order_has_every_condition_once(seed: int, subject: int) -> None:
    trials = order(seed, subject)
    assert len(trials) == 30
    assert Counter((trial.predictor, trial.weber) for trial in trials) == {
        (predictor, weber): 1 for predictor in PREDICTORS for weber in WEBERS
    }
    assert trials == order(seed, subject)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "subject-001.jsonl"


def test_an_experiment_runs_every_trial_once(path: Path) -> None:
    rig, robot = Rig(), Robot()
    progress = conduct(path, rig, robot)
    assert [trial.condition for trial in rig.felt] == [
        *(REFERENCES[place].condition for place in (0, 1, 1, 2)),
        *plan().trials,
    ]
    trials = [f"trial {number}" for number in range(1, 31)]
    assert robot.said == [
        *(f"reference {place}" for place in (1, 2, 2, 3)),
        *(*trials[:10], "rest 10", *trials[10:20], "rest 20", *trials[20:]),
        "thanks",
    ]
    assert {number: entry.rating for number, entry in progress.rated.items()} == {n: n % 6 for n in range(1, 31)}
    assert read(path) == progress


@pytest.mark.parametrize("leave_at", [1, 11, 30])
def test_an_experiment_continues_after_leaving(leave_at: int, path: Path) -> None:
    rig, first, second = Rig(), Robot(leave_at=leave_at), Robot()
    assert len(conduct(path, robot=first).rated) == leave_at - 1
    conduct(path, rig, second)
    assert second.said[0] == f"trial {leave_at}"
    assert [trial.condition for trial in rig.felt] == list(plan().trials[leave_at - 1 :])
    assert [said for said in first.said + second.said if said.startswith("rest")] == ["rest 10", "rest 20"]


def test_a_failed_trial_is_repeated(path: Path) -> None:
    robot, rig = Robot(), Rig(["no link", *[None] * 4, "the link was silent", "failed: master ended"])
    progress = conduct(path, rig, robot)
    assert [trial.condition for trial in rig.felt[5:8]] == [plan().trials[0]] * 3
    assert robot.said[:3] == ["reference 1", "again: no link", "reference 1"]
    assert robot.said[6:11] == [
        *("trial 1", "again: the link was silent", "trial 1", "again: failed: master ended", "trial 1")
    ]
    events = [json.loads(line) for line in path.read_text().splitlines()]
    assert [(e["trial"], e["attempt"], e["problem"]) for e in events if e["event"] == "trial_failed"] == [
        (1, 1, "the link was silent"),
        (1, 2, "failed: master ended"),
    ]
    assert progress.rated[1].attempt == 3
    assert len(progress.rated) == 30


def test_recordings_have_neutral_and_unique_names(path: Path) -> None:
    folder = path.with_suffix("")
    folder.mkdir()
    conduct(path, Rig([None] * 4 + ["silence", None, "interrupted"]), recordings=folder)
    path.rename(path.with_name("lost.jsonl"))  # even then: a new ledger finds recordings of the old one
    progress = conduct(path, Rig(), recordings=folder)  # the rig refuses a name that is taken
    assert [progress.rated[number].recording for number in (1, 2, 3)] == [
        *("subject-001/trial-01-3.mcap", "subject-001/trial-02-2.mcap", "subject-001/trial-03.mcap")
    ]
