"""Plan and order of an experiment, and what the ledger says of it."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.studies.experiment.studies import Rig, Robot, plan
from weberlink.studies.experiment.conduct import Conduct, SubjectLeft
from weberlink.studies.experiment.ledger import Ledger, read
from weberlink.studies.experiment.plan import (
    HIGHEST,
    LOWEST,
    REFERENCES,
    SCALE,
    TrialPlan,
    order,
    rating_of,
)
from weberlink.studies.paper.claims import PREDICTORS, WEBERS

DOCS = Path(__file__).parents[3] / "docs"


@given(st.integers(0, 2**63), st.integers(1, 10_000))
def test_an_order_has_every_condition_once(seed: int, subject: int) -> None:
    trials = order(seed, subject)
    assert len(trials) == 30
    assert Counter((trial.predictor, trial.weber) for trial in trials) == {
        (predictor, weber): 1 for predictor in PREDICTORS for weber in WEBERS
    }
    assert trials == order(seed, subject)


def test_predictors_are_uniform_over_places() -> None:
    """Over many subjects each predictor comes as often at the first place as at the last."""
    subjects = 1000
    for place in (0, 14, 29):
        counts = Counter(order(0, subject)[place].predictor for subject in range(1, subjects + 1))
        assert set(counts) == set(PREDICTORS)
        # 6 standard deviations of a binomial with n = 1000 and p = 1/5
        assert all(abs(count - subjects / 5) < 6 * (subjects * 0.2 * 0.8) ** 0.5 for count in counts.values())


def test_a_plan_survives_json() -> None:
    first = plan(7, simulated=True, seed=3)
    assert TrialPlan.from_json(json.loads(json.dumps(first.as_json()))) == first


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"version": 2}, "version 1, not 2"),
        ({"trials": None}, "not a plan"),
        ({"trials": []}, "trials without repetition"),
        ({"trials": [{"predictor": "zoh", "weber": 0.1}] * 2}, "trials without repetition"),
        ({"trials": [{"predictor": "zoh"}]}, "'weber'"),
        ({"wording": {"good": "no difference"}}, "expected levels 0 to 5, not good"),
    ],
)
def test_wrong_plans_are_refused(change: dict[str, object], part: str) -> None:
    with pytest.raises(ValueError, match=part):
        TrialPlan.from_json(plan().as_json() | change)


def test_references_are_those_of_the_paper() -> None:
    assert [(r.level, r.condition.predictor, r.condition.weber) for r in REFERENCES][1:] == [
        (3, "zoh", 0.125),
        (1, "linear", 0.25),
    ]
    assert (REFERENCES[0].level, REFERENCES[0].condition.weber) == (5, 0.0)
    assert sorted(SCALE) == [0, 1, 2, 3, 4, 5] == list(range(LOWEST, HIGHEST + 1))


@pytest.mark.parametrize("page", ["experiment.md", "glossary.md"])
def test_the_scale_is_explained_in_the_words_that_are_shown(page: str) -> None:
    text = (DOCS / page).read_text(encoding="utf-8")
    for level, words in SCALE.items():
        assert f"| {level} | {words} |" in text or f"{level} {words}" in text


@given(st.one_of(st.text(max_size=4), st.sampled_from(["", " ", "6", "-1", "3.5", "33", "05", "\u0663", "\u00b2"])))
def test_a_rating_is_one_digit_of_the_scale(text: str) -> None:
    rating = rating_of(text)
    assert rating == (int(text) if text.strip() in {"0", "1", "2", "3", "4", "5"} else None)


def events(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def run(path: Path, rig: Rig, robot: Robot, recordings: Path | None = None) -> None:
    with Ledger(path) as ledger:
        if ledger.progress is None:
            ledger.begin(plan())
        Conduct(ledger, rig, robot, recordings).run()


def test_an_experiment_runs_every_trial_once(tmp_path: Path) -> None:
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


@pytest.mark.parametrize("leave_at", [1, 11, 30])
def test_an_experiment_continues_after_leaving(leave_at: int, tmp_path: Path) -> None:
    path, rig, robot = tmp_path / "subject-001.jsonl", Rig(), Robot(leave_at=leave_at)
    with pytest.raises(SubjectLeft):
        run(path, rig, robot)
    assert robot.said[-1] == "leave"
    again, second = Rig(), Robot()
    run(path, again, second)
    assert second.said[0] == f"welcome {leave_at - 1}"
    assert not any(said.startswith("reference") for said in second.said)
    assert [trial.condition for trial in again.felt] == list(plan().trials[leave_at - 1 :])
    rests = [said for said in robot.said + second.said if said.startswith("rest")]
    assert rests == ["rest 10", "rest 20"]  # a break is had once


def test_the_training_continues_after_leaving(tmp_path: Path) -> None:
    path = tmp_path / "subject-001.jsonl"
    with pytest.raises(SubjectLeft):
        run(path, Rig([None, "interrupted"]), Robot())
    rig = Rig()
    run(path, rig, Robot())
    assert [trial.condition.weber for trial in rig.felt[:3]] == [0.125, 0.125, 0.25]


def test_a_failed_trial_is_repeated(tmp_path: Path) -> None:
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


def test_an_interrupted_trial_is_repeated(tmp_path: Path) -> None:
    path = tmp_path / "subject-001.jsonl"
    with pytest.raises(SubjectLeft):
        run(path, Rig([None] * 6 + ["interrupted"]), Robot())
    progress = read(path)
    assert progress is not None
    assert (list(progress.rated), progress.begun[3]) == ([1, 2], 1)
    run(path, Rig(), Robot())
    progress = read(path)
    assert progress is not None
    assert [progress.rated[number]["attempt"] for number in (2, 3, 4)] == [1, 2, 1]


def test_recordings_have_neutral_and_unique_names(tmp_path: Path) -> None:
    path, folder = tmp_path / "subject-001.jsonl", tmp_path / "subject-001"
    folder.mkdir()
    with pytest.raises(SubjectLeft):
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
