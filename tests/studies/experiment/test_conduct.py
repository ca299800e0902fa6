"""What is felt, asked and written, in which order; and what of it the subject can know."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.studies.experiment.studies import Rig, Robot, plan
from weberlink.studies.experiment.conduct import Conduct, Left
from weberlink.studies.experiment.ledger import Ledger, read


def events(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def run(path: Path, rig: Rig, robot: Robot, recordings: Path | None = None) -> None:
    with Ledger(path) as ledger:
        if ledger.progress is None:
            ledger.begin(plan())
        Conduct(ledger, rig, robot, recordings).run()


def test_a_whole_experiment_feels_every_trial_of_the_plan_once(tmp_path: Path) -> None:
    path, rig, robot = tmp_path / "subject-001.jsonl", Rig(), Robot()
    run(path, rig, robot)
    felt = [trial.condition for trial in rig.felt]
    assert [(c.predictor, c.weber) for c in felt[:4]] == [
        ("zoh", 0.0),
        ("zoh", 0.125),
        ("zoh", 0.125),
        ("linear", 0.25),
    ]
    assert tuple(felt[4:]) == plan().trials
    assert robot.said == [
        "welcome 0",
        *("reference 5", "reference 3", "reference 3", "reference 1"),
        *(f"trial {number} of 30" for number in range(1, 11)),
        "rest 10",
        *(f"trial {number} of 30" for number in range(11, 21)),
        "rest 20",
        *(f"trial {number} of 30" for number in range(21, 31)),
        "farewell",
    ]


def test_the_figures_of_a_trial_stand_beside_its_rating(tmp_path: Path) -> None:
    path = tmp_path / "subject-001.jsonl"
    run(path, Rig(), Robot())
    for event in events(path):
        if event["event"] == "trial_rated":
            assert event["figures"]["packets_per_s"] == 1000.0 / (1 + 100 * event["weber"])
            assert event["attempt"] == 1


@pytest.mark.parametrize("leave_at", [1, 2, 10, 11, 21, 30])
def test_who_leaves_goes_on_with_the_first_unrated_trial(leave_at: int, tmp_path: Path) -> None:
    path, rig, robot = tmp_path / "subject-001.jsonl", Rig(), Robot(leave_at=leave_at)
    with pytest.raises(Left):
        run(path, rig, robot)
    assert robot.said[-1] == "leave"
    again, second = Rig(), Robot()
    run(path, again, second)
    assert second.said[0] == f"welcome {leave_at - 1}"
    assert not any(said.startswith("reference") for said in second.said)
    assert [trial.condition for trial in again.felt] == list(plan().trials[leave_at - 1 :])
    rests = [said for said in robot.said + second.said if said.startswith("rest")]
    assert rests == ["rest 10", "rest 20"]  # a break is had once


def test_a_training_that_was_left_goes_on_with_the_next_reference(tmp_path: Path) -> None:
    path = tmp_path / "subject-001.jsonl"
    with pytest.raises(Left):
        run(path, Rig([None, "interrupted"]), Robot())
    rig = Rig()
    run(path, rig, Robot())
    assert [trial.condition.weber for trial in rig.felt[:3]] == [0.125, 0.125, 0.25]


def test_a_trial_that_failed_is_not_rated_but_felt_again(tmp_path: Path) -> None:
    path, robot = tmp_path / "subject-001.jsonl", Robot()
    rig = Rig([None] * 4 + ["the link was silent", "failed: master ended", None])
    run(path, rig, robot)
    assert [trial.condition for trial in rig.felt[4:7]] == [plan().trials[0]] * 3
    assert robot.said[5:10] == [
        "trial 1 of 30",
        "trial again: the link was silent",
        "trial 1 of 30",
        "trial again: failed: master ended",
        "trial 1 of 30",
    ]
    failed = [event for event in events(path) if event["event"] == "trial_failed"]
    assert [(event["trial"], event["attempt"], event["problem"]) for event in failed] == [
        (1, 1, "the link was silent"),
        (1, 2, "failed: master ended"),
    ]
    progress = read(path)
    assert progress is not None
    assert progress.rated[1]["attempt"] == 3
    assert len(progress.rated) == 30


def test_a_reference_that_failed_is_felt_again_and_anchors_nothing(tmp_path: Path) -> None:
    path, robot = tmp_path / "subject-001.jsonl", Robot()
    run(path, Rig(["the link was silent"]), robot)
    assert robot.said[1:4] == ["reference 5", "reference again: the link was silent", "reference 5"]
    assert sum(event["event"] == "reference" for event in events(path)) == 4


def test_a_trial_interrupted_by_the_subject_is_felt_once_more_and_the_ledger_says_so(tmp_path: Path) -> None:
    path = tmp_path / "subject-001.jsonl"
    with pytest.raises(Left):
        run(path, Rig([None] * 6 + ["interrupted"]), Robot())
    progress = read(path)
    assert progress is not None
    assert (list(progress.rated), progress.begun[3]) == ([1, 2], 1)
    run(path, Rig(), Robot())
    progress = read(path)
    assert progress is not None
    assert [progress.rated[number]["attempt"] for number in (2, 3, 4)] == [1, 2, 1]


def test_recordings_have_neutral_names_and_never_cover_one_another(tmp_path: Path) -> None:
    path, folder = tmp_path / "subject-001.jsonl", tmp_path / "subject-001"
    folder.mkdir()
    with pytest.raises(Left):
        run(path, Rig([None] * 4 + ["silence", None, "interrupted"]), Robot(), folder)
    path.rename(tmp_path / "lost.jsonl")  # even then: a new ledger finds recordings of the old one
    rig = Rig()
    run(path, rig, Robot(), folder)  # the rig refuses a name that is taken
    names = sorted(file.name for file in folder.iterdir())
    assert len(names) == 7 + 34
    words = {"zoh", "linear", "plane", "sphere", "hybrid", "2.5", "0.1", "30"}
    assert not any(word in name.replace("trial-30", "") for name in names for word in words)
    assert [event["recording"] for event in events(path) if event["event"] == "trial_rated"][:3] == [
        "subject-001/trial-01-3.mcap",
        "subject-001/trial-02-2.mcap",
        "subject-001/trial-03.mcap",
    ]
    assert [trial.name for trial in rig.felt[4:]] == [f"trial-{number:02d}" for number in range(1, 31)]
