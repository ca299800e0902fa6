"""What is felt of a scene: its cells, its figures and its table."""

from typing import Any

import pytest

from weberlink.studies.frame import Row, data_frame
from weberlink.studies.stability.display import DisplayCell
from weberlink.studies.stability.display_study import judged

FINE: Row = {
    "error_n": 0.3, "contacts": 12, "ghost_s": 0.0, "energy_out_j": 0.01, "tracking_m": 1e-3, "bound_share": 0.5,
    "failure": "",
}  # fmt: skip


def row(cell: DisplayCell, scheme: str = "ours", **figures: Any) -> Row:
    return cell._asdict() | {"scheme": scheme} | FINE | figures


@pytest.mark.parametrize(
    ("cell", "figures", "judgement"),
    [
        (DisplayCell("plane", 100), {"ghost_s": 0.25}, {"ghost": False}),  # as long as the round trip
        (DisplayCell("plane", 100), {"ghost_s": 0.27}, {"ghost": True}),
        (DisplayCell("plane", 0), {"bound_share": 1.1, "contacts": 25}, {"bound_kept": False, "few_contacts": False}),
        (DisplayCell("plane", 0), {"error_n": 0.0}, {"worse": False, "compared": True, "bound_kept": True}),
        (DisplayCell("plane", 0), {"error_n": 9.0}, {"worse": True, "few_contacts": True}),
    ],
)
def test_a_run_is_judged(cell: DisplayCell, figures: Row, judgement: Row) -> None:
    found = judged(data_frame([row(cell, **figures)])).iloc[0]
    assert {name: bool(found[name]) for name in judgement} == judgement
