"""Which ledgers are analysed together, and what becomes of their ratings."""

import csv
import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.studies.experiment.studies import Rig, Robot, plan
from weberlink.studies.experiment.answers import gather
from weberlink.studies.experiment.conduct import Conduct, Left
from weberlink.studies.experiment.ledger import Ledger, LedgerError, path_of
from weberlink.studies.experiment.plan import PREDICTORS, WEBERS


def subject(folder: Path, number: int, *, simulated: bool = False, leave_at: int = 99, **changes: Any) -> Path:
    """A ledger of somebody who rates trial n as n modulo 6."""
    path = path_of(folder, number, simulated=simulated)
    with Ledger(path) as ledger:
        ledger.begin(replace(plan(number, simulated=simulated), **changes))
        with suppress(Left):
            Conduct(ledger, Rig(), Robot(leave_at=leave_at), None).run()
    return path


def test_ratings_stand_where_their_condition_is_whatever_the_order(tmp_path: Path) -> None:
    for number in (1, 2, 5):
        subject(tmp_path, number)
    answers = gather(tmp_path, None)
    assert answers.subjects == [1, 2, 5]
    assert (answers.predictors, answers.webers) == (list(PREDICTORS), list(WEBERS))
    ratings, rates = answers.ratings(), answers.packet_rates()
    assert ratings.shape == rates.shape == (3, 5, 6)
    for row, number in enumerate((1, 2, 5)):
        for place, trial in enumerate(plan(number).trials, 1):
            at = (row, PREDICTORS.index(trial.predictor), WEBERS.index(trial.weber))
            assert ratings[at] == place % 6
            assert rates[at] == pytest.approx(1000.0 / (1 + 100 * trial.weber))
    assert {one.unit for one in answers.observations} == {"subject 1", "subject 2", "subject 5"}
    assert list(dict.fromkeys(one.predictor for one in answers.observations)) == list(PREDICTORS)


def test_incomplete_subjects_are_left_out_and_named(tmp_path: Path) -> None:
    subject(tmp_path, 1)
    subject(tmp_path, 2, leave_at=8)
    path_of(tmp_path, 3, simulated=False).touch()
    answers = gather(tmp_path, None)
    assert (answers.subjects, answers.incomplete) == ([1], {2: 7, 3: 0})


def test_a_ledger_that_is_being_written_is_read_up_to_its_last_whole_line(tmp_path: Path) -> None:
    subject(tmp_path, 1)
    path = subject(tmp_path, 2)
    data = path.read_bytes()
    path.write_bytes(data[:-5])
    assert gather(tmp_path, None).incomplete == {2: 29}
    assert path.read_bytes() == data[:-5]


def test_people_and_programs_are_never_mixed(tmp_path: Path) -> None:
    subject(tmp_path, 1)
    subject(tmp_path, 1, simulated=True)
    with pytest.raises(LedgerError, match="never analysed together; say which: --only people or --only simulated"):
        gather(tmp_path, None)
    assert not gather(tmp_path, "people").simulated
    assert gather(tmp_path, "simulated").simulated


def test_a_renamed_ledger_does_not_pass_for_a_person(tmp_path: Path) -> None:
    made = subject(tmp_path, 1, simulated=True)
    made.rename(path_of(tmp_path, 1, simulated=False))
    with pytest.raises(LedgerError, match=r"subject-001.jsonl:1: is the ledger of simulated subject 1"):
        gather(tmp_path, None)


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"digest": "e" * 64}, "another configuration"),
        ({"duration_s": 5.0}, "trials of another length"),
        ({"wording": {"0": "bad"}}, "another wording"),
        ({"trials": plan().trials[:29]}, "other trials"),
    ],
)
def test_what_cannot_be_compared_is_refused(changes: dict[str, Any], part: str, tmp_path: Path) -> None:
    subject(tmp_path, 1)
    subject(tmp_path, 2, **changes)
    with pytest.raises(LedgerError, match=part) as caught:
        gather(tmp_path, None)
    assert "subject-002.jsonl: had" in str(caught.value)


def test_nobody_complete_is_an_error_that_counts(tmp_path: Path) -> None:
    subject(tmp_path, 1, leave_at=3)
    with pytest.raises(LedgerError, match="no person has rated all trials; 1 incomplete"):
        gather(tmp_path, None)


def test_csv_has_every_rating_in_the_order_in_which_it_was_given(tmp_path: Path) -> None:
    path = subject(tmp_path, 4, simulated=True)
    gather(tmp_path, None).write_csv(tmp_path / "out.csv")
    with (tmp_path / "out.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    events = [event for line in path.read_text().splitlines() if (event := json.loads(line))["event"] == "trial_rated"]
    assert [(row["trial"], row["predictor"], row["weber"], row["rating"]) for row in rows] == [
        tuple(str(event[name]) for name in ("trial", "predictor", "weber", "rating")) for event in events
    ]
    assert all(row["simulated"] == "true" and row["subject"] == "4" for row in rows)
