"""Ratings predicted from a measure: the line that made them is found, and none for programs or a single person."""

import json
from dataclasses import replace
from io import StringIO
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from tests.examples import examples
from tests.studies.experiment.studies import plan
from weberlink.studies.experiment.analysis import analyse
from weberlink.studies.experiment.answers import StudyRatings, TrialRating
from weberlink.studies.experiment.prediction import MEASURES, predictions
from weberlink.studies.experiment.ratings import table_of

KEY = "log_error_rms_jnd"


def study(
    subjects: int, slope: float = -1.5, noise: float = 0.3, *, simulated: bool = False, keys: Any = tuple(MEASURES)
) -> StudyRatings:
    """Subjects who rate 5 at no error and less in a straight line, each a little differently."""
    chance = Random(7)
    answers = []
    for subject in range(1, subjects + 1):
        own = chance.gauss(0.0, noise)
        for trial, condition in enumerate(plan(subject).trials, 1):
            error = 8.0 * condition.weber
            rating = min(5, max(0, round(5.0 + slope * error + own + chance.gauss(0.0, noise))))
            figures = {"packets_per_s": 10.0 / condition.weber} | dict.fromkeys(keys, error)
            answers.append(TrialRating(subject, trial, 1, condition, rating, figures))
    return StudyRatings(plan(1, simulated=simulated), answers, {})


def test_the_line_that_made_the_ratings_lies_in_the_interval() -> None:
    (found,) = [one for one in predictions(study(40), seed=0) if one.measure == KEY]
    assert found.trials == 40 * 30
    assert found.per_jnd.low < -1.5 < found.per_jnd.high
    assert found.points[1.0].low < 3.5 < found.points[1.0].high
    assert found.points[1.0].high - found.points[1.0].low < 0.4
    assert 0.3 < found.scatter < 0.7  # noise of subject, trial and rounding
    assert found.range_jnd == pytest.approx((0.2, 2.4))


@examples(20)
@given(st.integers(2, 8), st.floats(-2.0, -0.1), st.floats(0.0, 1.0))
def test_the_line_is_that_of_least_squares_and_lies_in_its_interval(subjects: int, slope: float, noise: float) -> None:
    answers = study(subjects, slope, noise)
    x = np.array([one.figures[KEY] for one in answers.answers])
    y = np.array([one.rating for one in answers.answers])
    expected = np.polyfit(x, y, 1)
    (found,) = [one for one in predictions(answers, seed=1) if one.measure == KEY]
    assert (found.per_jnd.mean, found.at_none.mean) == pytest.approx(tuple(expected), abs=1e-9)
    for band in (found.per_jnd, found.at_none, *found.points.values()):
        assert band.low <= band.mean <= band.high
    assert all(0.0 <= end <= 5.0 for band in found.points.values() for end in band)
    assert predictions(answers, seed=1) == predictions(answers, seed=1)


@pytest.mark.parametrize(
    "answers",
    [study(12, simulated=True), study(1), study(3, keys=()), replace(study(3), answers=[])],
    ids=["a program", "one person", "ledgers without measures", "nobody"],
)
def test_without_several_people_no_rating_is_predicted(answers: StudyRatings) -> None:
    assert predictions(answers, seed=0) == []


@pytest.mark.parametrize(("simulated", "predicted"), [(False, True), (True, False)])
def test_tables_and_json_predict_for_people_only(simulated: bool, predicted: bool) -> None:
    pytest.importorskip("scipy")
    analysis = analyse(study(3, simulated=simulated), 4.0)
    paper = StringIO()
    Console(width=80, file=paper).print(table_of(analysis, "some machine"))
    text = paper.getvalue()
    assert ("predicted" in text) == predicted
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text
    listed = json.loads(json.dumps(analysis.document, allow_nan=False))["predicted_ratings"]
    assert [one["measure"] for one in listed] == (list(MEASURES) if predicted else [])
