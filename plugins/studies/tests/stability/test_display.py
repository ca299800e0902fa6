"""The cells of what is felt: those that a seed draws, and what they are compared with."""

from itertools import chain
from math import radians
from pathlib import Path

import pytest

from weberlink import configs
from weberlink.cli.shipped import find
from weberlink.config import load
from weberlink_studies.frame import data_frame
from weberlink_studies.stability import display
from weberlink_studies.stability.display import DisplayCell, cells, file_cells, former, judged, rows_of
from weberlink_studies.stability.held_out import COUNT, SCENES, held_out

LOOPBACK = Path(str(configs.__path__[0])) / "loopback.yaml"


def test_a_seed_draws_the_same_cells_and_another_seed_others() -> None:
    drawn = [held_out(seed) for seed in range(20)]
    assert drawn == [held_out(seed) for seed in range(20)]
    assert len(set(chain(*drawn))) == 20 * COUNT
    assert {cell.scene for cell in drawn[0]} == SCENES.keys()
    assert not set(chain(*drawn)) & set(cells())
    for cell in drawn[0]:
        load(LOOPBACK, list(cell.overrides))


def test_drawn_cells_are_compared_with_the_baselines_and_the_others_with_the_schemes_before() -> None:
    drawn, known = held_out(0)[0], DisplayCell("plane", 0)
    figures = {"failure": "", "ghost_s": 0.0, "bound_share": 0.0, "contacts": 13, "tracking_m": 0.0}
    rows = [
        cell._asdict() | figures | {"scheme": scheme, "error_n": error}
        for cell in (drawn, known)
        for scheme, error in (("bounded", 0.5), ("none", 0.3), ("baseline-tdpa", 0.4))
    ]
    found = judged(data_frame(rows))
    before = former().query("scene == 'plane' and delay_ms == 0 and link == 'clean' and hand == 'default'")
    assert list(found.former_error_n) == pytest.approx([0.3] * 3 + [before.error_n.min()] * 3)
    assert list(found.worse[:3]) == [True, False, True]


def test_the_shipped_files_are_tried_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(display, "RUN_S", 4.0)
    assert all(find(cell.scene).exists() for cell in file_cells())
    (row,) = rows_of((DisplayCell("rotation", 50), "bounded"))
    assert not row["failure"]
    assert row["turned_rad"] < radians(0.5)
    assert row["bound_share"] < 1.0
