"""Figures by source: geometric means that no source dominates, and the comparison with the best single predictor."""

from typing import Any

import pytest

from plugins.studies.tests.evaluate.signals import walk
from weberlink_studies.evaluate.study import EvaluationStudy
from weberlink_studies.evaluate.table import EVERY, SINGLES, by_source
from weberlink_studies.evaluate.traces import NamedTrace
from weberlink_studies.frame import data_frame

(ROW,) = EvaluationStudy(("zoh",)).rows(NamedTrace("walk", walk(1000, 1)))


def figures(packets: dict[tuple[str, str], dict[str, int]]) -> dict[tuple[str, str], Any]:
    """By source and predictor, of rows with so many packets in a second."""
    rows = [
        ROW | {"trace": trace, "source": source, "predictor": name, "packets": count, "duration_s": 1.0}
        for (trace, source), each in packets.items()
        for name, count in each.items()
    ]
    return {(one.source, one.predictor): one for one in by_source(data_frame(rows)).itertuples()}


def test_a_source_counts_once_however_many_recordings_it_has() -> None:
    many = {(f"a{number}", "a"): {"hybrid": 100, "adaptive": 50} for number in range(9)}
    found = figures({**many, ("b1", "b"): {"hybrid": 100, "adaptive": 200}})
    assert found["a", "adaptive"].over_hybrid == pytest.approx(0.5)
    assert found["b", "adaptive"].over_hybrid == pytest.approx(2.0)
    assert found[EVERY, "adaptive"].over_hybrid == pytest.approx(1.0)
    assert found[EVERY, "adaptive"].recordings == 10


def test_the_best_single_is_that_of_each_recording() -> None:
    singles = dict.fromkeys(SINGLES, 100)
    found = figures({
        ("a1", "a"): {**singles, "zoh": 50, "hybrid": 100},
        ("a2", "a"): {**singles, "sphere": 25, "hybrid": 25},
    })  # fmt: skip
    assert found["a", "hybrid"].over_best == pytest.approx(2.0**0.5)
    assert found["a", "hybrid"].above == 0.5
    assert found["a", "zoh"].above == 0.5
    assert (EVERY, "hybrid") not in found


@pytest.mark.parametrize(
    ("rate", "best", "lost"), [(1, 1, 0.0), (2, 1, 0.0), (3, 1, 1.0), (105, 100, 0.0), (106, 100, 1.0)]
)
def test_a_loss_is_a_share_and_a_packet_a_second(rate: int, best: int, lost: float) -> None:
    assert figures({("a1", "a"): {**dict.fromkeys(SINGLES, best), "hybrid": rate}})["a", "hybrid"].above_by == lost
