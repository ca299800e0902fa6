"""Every combination once, in an order that is each subject's own and can be made again."""

import json
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.studies.experiment.studies import plan
from weberlink.studies.experiment.plan import PREDICTORS, TRIALS, WEBERS, Plan, order
from weberlink.studies.experiment.scale import HIGHEST, LOWEST, REFERENCES, WORDING, rating_of


@given(st.integers(0, 2**63), st.integers(1, 10_000))
def test_an_order_has_every_combination_exactly_once(seed: int, subject: int) -> None:
    trials = order(seed, subject)
    assert len(trials) == TRIALS == 30
    assert Counter((trial.predictor, trial.weber) for trial in trials) == {
        (predictor, weber): 1 for predictor in PREDICTORS for weber in WEBERS
    }
    assert trials == order(seed, subject)


def test_orders_differ_between_subjects_and_seeds() -> None:
    assert len({order(seed, subject) for seed in range(5) for subject in range(1, 41)}) == 200


def test_no_place_in_the_order_is_given_to_a_predictor() -> None:
    """Over many subjects each predictor comes as often at the first place as at the last."""
    subjects = 3000
    for place in (0, 14, 29):
        counts = Counter(order(0, subject)[place].predictor for subject in range(1, subjects + 1))
        assert set(counts) == set(PREDICTORS)
        # 6 standard deviations of a binomial with n = 3000 and p = 1/5
        assert all(abs(count - subjects / 5) < 6 * (subjects * 0.2 * 0.8) ** 0.5 for count in counts.values())


def test_a_plan_comes_back_as_it_was_written() -> None:
    first = plan(7, simulated=True, seed=3)
    assert Plan.from_json(json.loads(json.dumps(first.as_json()))) == first


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"version": 2}, "version 1, not 2"),
        ({"trials": None}, "a plan"),
        ({"trials": []}, "trials that differ"),
        ({"trials": [{"predictor": "zoh", "weber": 0.1}] * 2}, "trials that differ"),
        ({"trials": [{"predictor": "zoh"}]}, "'weber'"),
    ],
)
def test_what_is_no_plan_is_refused(change: dict[str, object], part: str) -> None:
    with pytest.raises(ValueError, match=part):
        Plan.from_json(plan().as_json() | change)


def test_a_plan_that_lacks_something_is_refused() -> None:
    facts = plan().as_json()
    del facts["digest"]
    with pytest.raises(ValueError, match="digest"):
        Plan.from_json(facts)


def test_references_are_those_of_the_paper() -> None:
    assert [(r.level, r.condition.predictor, r.condition.weber) for r in REFERENCES][1:] == [
        (3, "zoh", 0.125),
        (1, "linear", 0.25),
    ]
    assert (REFERENCES[0].level, REFERENCES[0].condition.weber) == (5, 0.0)
    assert sorted(WORDING) == [0, 1, 2, 3, 4, 5] == list(range(LOWEST, HIGHEST + 1))
    assert all(0 < len(text) <= 60 for text in WORDING.values())


@given(st.text(max_size=4))
def test_a_rating_is_one_digit_of_the_scale_and_nothing_else(text: str) -> None:
    rating = rating_of(text)
    assert rating == (int(text) if text.strip() in {"0", "1", "2", "3", "4", "5"} else None)


@pytest.mark.parametrize("text", ["", " ", "6", "-1", "3.5", "33", "05", "r", "\u0663", "four", "\u00b2"])
def test_no_rating(text: str) -> None:
    assert rating_of(text) is None
