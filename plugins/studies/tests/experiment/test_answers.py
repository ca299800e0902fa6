"""Answers of several subjects: which ledgers are comparable, and what is left out."""

from pathlib import Path
from typing import Any

import pytest

from plugins.studies.tests.experiment.studies import Robot, conduct, plan
from weberlink_studies.experiment.ledger import LedgerError, path_of
from weberlink_studies.experiment.plan import SCALE
from weberlink_studies.experiment.ratings import gather, rows_of


def subject(folder: Path, number: int, *, simulated: bool = False, leave_at: int = 99, **changes: Any) -> Path:
    """A ledger of somebody who rates trial n as n modulo 6."""
    path = path_of(folder, number, simulated=simulated)
    conduct(path, robot=Robot(leave_at=leave_at), first=plan(number, simulated=simulated, **changes))
    return path


def test_every_rating_is_a_row_in_order(tmp_path: Path) -> None:
    for number in (5, 1, 2):
        subject(tmp_path, number)
    subject(tmp_path, 3, leave_at=8)
    answers = gather(tmp_path, None)
    assert answers.incomplete == {3: 7}
    rows = [row for progress in answers.complete for row in rows_of(progress)]
    assert [(row["subject"], row["simulated"], row["trial"], row["predictor"], row["weber"]) for row in rows] == [
        (number, False, place, trial.predictor, trial.weber)
        for number in (1, 2, 5)
        for place, trial in enumerate(plan(number).trials, 1)
    ]
    assert all(row["rating"] == row["trial"] % 6 for row in rows)
    assert all(row["packets_per_s"] == pytest.approx(1000.0 / (1 + 100 * row["weber"])) for row in rows)


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"digest": "e" * 64}, "another configuration"),
        ({"duration_s": 5.0}, "trials of another length"),
        ({"wording": dict.fromkeys(SCALE, "bad")}, "another wording"),
        ({"trials": plan().trials[:29]}, "other trials"),
    ],
)
def test_incomparable_ledgers_are_refused(changes: dict[str, Any], part: str, tmp_path: Path) -> None:
    subject(tmp_path, 1, **changes)
    subject(tmp_path, 2)
    with pytest.raises(LedgerError, match=part) as caught:
        gather(tmp_path, None)
    assert "subject-002.jsonl: has" in str(caught.value)
