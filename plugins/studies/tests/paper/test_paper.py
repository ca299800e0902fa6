"""The claims of the paper: savings computed by hand, and verdicts by source."""

from math import nan

import pytest
from pandas import DataFrame

from weberlink_studies.paper.claims import FAILS, HOLDS, NO_CLAIM, PREDICTORS, TOO_EASY, UNMEASURED, judge, verdict

RATES = {"zoh": 40.0, "linear": 30.0, "plane": 20.0, "sphere": 44.0, "hybrid": 16.0}
WEBERS = (0.05, 0.1, 0.2)


def signal(name: str, source: str = "some", *, surface: bool = True, **changes: float) -> list[dict[str, object]]:
    """Rates fall, and errors rise in proportion, with the Weber factor."""
    return [
        {
            "condition": "recordings",
            "source": source,
            "surface": surface,
            "signal": name,
            "predictor": predictor,
            "weber": weber,
            "packets_per_s": rate * (0.2 / (0.1 + weber)),
            "error_rms_jnd": 5.0 * weber,
        }
        for predictor, rate in (RATES | changes).items()
        for weber in WEBERS
    ]


def claim(rows: list[dict[str, object]], predictor: str, reference: str, at: str = "weber") -> DataFrame:
    """One claim on every source."""
    judged = judge(DataFrame(rows), len(PREDICTORS) * len(WEBERS))
    return judged[(judged.predictor == predictor) & (judged.reference == reference) & (judged["at"] == at)]


def test_a_source_counts_once_by_the_geometric_mean_of_its_signals() -> None:
    rows = [
        *signal("a", hybrid=10.0), *signal("b", hybrid=40.0), *signal("silent", zoh=0.0, hybrid=0.0),
        *signal("c", "other", hybrid=4.0), *signal("d", "field", surface=False, hybrid=10.0), *signal("half")[:9],
    ]  # fmt: skip
    found = claim(rows, "hybrid", "zoh")
    assert found.source.to_list() == ["some", "other", "field"]
    assert found.signals.to_list() == [2, 1, 1]
    assert found.fewer.to_list() == pytest.approx([0.5, 0.9, 0.75])
    assert found.verdict.to_list() == [HOLDS, HOLDS, NO_CLAIM]
    assert claim(rows, "sphere", "zoh").verdict.to_list() == [FAILS, FAILS, NO_CLAIM]


@pytest.mark.parametrize(
    ("fewer", "unreached", "expected"),
    [
        (0.42, 0, HOLDS), (0.41, 0, FAILS), (0.94, 0, HOLDS), (0.95, 0, TOO_EASY), (-0.2, 0, FAILS),
        (nan, 0, UNMEASURED), (nan, 1, FAILS), (0.6, 1, FAILS), (0.99, 1, FAILS),
    ],
)  # fmt: skip
def test_the_verdict_on_a_claim_of_42_percent(fewer: float, unreached: int, expected: str) -> None:
    assert verdict(0.42, fewer, unreached) == expected
