"""What is felt of a scene: its cells, its figures and its table."""

import json
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from weberlink.studies.stability import display
from weberlink.studies.stability.display import SCENES, Display, DisplayCell, cells, measured
from weberlink.studies.stability.display_study import assemble, best, former, is_ghost, run, summary
from weberlink.system.configuration import ConfigurationError

FINE = Display(0.2, 0.3, 12, 0.0, 0.01, 1e-3, bound_share=0.5)
BEFORE = {cell: {"none": FINE, "mmt": FINE._replace(error_n=0.1)} for cell in cells()}


def test_every_cell_comes_once() -> None:
    found = cells()
    assert len(found) == len(set(found)) == 156
    assert {cell.scene for cell in found} == set(SCENES)
    assert {cell.hand for cell in found} == {"default", "light", "stiff", "pinch"}


def test_the_schemes_before_are_stored_for_the_cells() -> None:
    before, origin = former()
    assert before.keys() <= set(cells())
    assert {tuple(each) for each in before.values()} == {("none", "tdpa", "mmt", "auto")}
    assert origin["commit"].startswith("586f3695")
    reference = [figures["none"].ideal_error_n for cell, figures in before.items() if cell.delay_ms == 0]
    assert reference
    assert set(reference) == {0.0}
    least = min(figures.error_n for figures in before[DisplayCell("plane", 100, "lossy")].values())
    assert best(before, DisplayCell("plane", 100, "lossy")) == least


def test_without_delay_none_is_its_own_reference() -> None:
    found = measured((DisplayCell("plane", 0), "none"))
    assert found.failure == ""
    assert found.ideal_error_n == found.ghost_s == 0.0
    assert found.impulse_ratio == pytest.approx(1.0, abs=0.05)
    assert found.error_n >= found.shifted_error_n


def test_a_cell_that_cannot_run_has_failed() -> None:
    assert "nothing" in measured((DisplayCell("plane", 0), "nothing")).failure


def test_the_longest_run_is_found() -> None:
    holds = np.array([1, 1, 0, 1, 1, 1, 0, 1], bool)
    assert display._longest(holds) == 3
    assert display._longest(holds[:0]) == display._longest(~holds[:2]) == 0


def test_a_ghost_outlasts_the_round_trip() -> None:
    assert not is_ghost(DisplayCell("plane", 100), FINE._replace(ghost_s=0.25))
    assert is_ghost(DisplayCell("plane", 100), FINE._replace(ghost_s=0.27))


def test_a_scheme_is_judged_against_the_best_before() -> None:
    near, far, broken = DisplayCell("plane", 0), DisplayCell("plane", 250), DisplayCell("box", 5)
    figures = {
        near: {"ours": FINE._replace(error_n=0.14)},
        far: {"ours": FINE._replace(bound_share=1.1, contacts=25, tracking_m=1.0, ghost_s=0.6)},
        broken: {"ours": FINE._replace(failure="no session")},
    }
    judged = summary(figures, BEFORE, "ours")
    assert (judged["cells"], judged["failed"], judged["worse"], judged["ghosts"]) == (2, 1, 1, 1)
    assert judged["compared"] == 2
    assert (judged["bound_kept"], judged["few_contacts"], judged["tracking_m"]) == (1, 1, 1e-3)


def test_table_document_and_figure(tmp_path: Path) -> None:
    figures = {cell: {"baseline-tdpa": FINE._replace(energy_out_j=9.9, error_n=12.0)} for cell in cells()}
    result = assemble(figures, of=157, run_time=1.0)
    assert result.interrupted == "156 of 157 runs"
    console = Console(width=80, record=True, file=StringIO())
    console.print(result.table)
    text = console.export_text()
    assert "…" not in text
    assert "12.00" in text
    assert len(json.loads(json.dumps(result.document, allow_nan=False))["cells"]) == 156
    few = {cell: figures[cell] for cell in (DisplayCell("plane", 0), DisplayCell("box", 5, "lossy"))}
    assemble(few, of=2, run_time=1.0).draw(tmp_path)
    assert (tmp_path / "stability_display.png").read_bytes().startswith(b"\x89PNG")


def test_an_unknown_scheme_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"--scheme: 'bound' is none of none, bounded, .*baseline-tdpa"):
        run(["bound"], plots=False, workers=1, progress=lambda *_: None)
