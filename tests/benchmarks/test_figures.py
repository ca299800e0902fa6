"""The figures of a run."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.figures import LEAST_US, exceedance
from benchmarks.study import assemble
from tests.benchmarks.findings import ARRANGEMENT, findings


def test_the_share_that_is_at_least_as_late() -> None:
    values, shares = exceedance([5.0, 2.0, 2.0, 9.0])
    assert values == pytest.approx([2.0, 5.0, 9.0], rel=0.003)
    assert shares == pytest.approx([1.0, 0.5, 0.25])


def test_what_is_on_time_is_at_the_edge() -> None:
    values, shares = exceedance([-3.0, 0.0, 4.0, 8.0])
    assert values == pytest.approx([LEAST_US, 4.0, 8.0], rel=0.003)
    assert shares == pytest.approx([1.0, 0.5, 0.25])


def test_both_figures_are_drawn(tmp_path: Path) -> None:
    made = findings()
    generator = np.random.default_rng(3)
    for rate in made.rates.values():
        for side in rate.sides.values():
            side.records["lateness_us"] = generator.lognormal(3.0, 0.7, side.ticks)
    bench = assemble(ARRANGEMENT, replace(made))
    bench.draw(tmp_path / "figures")
    for name in ("lateness.png", "cpu.png"):
        assert (tmp_path / "figures" / name).read_bytes().startswith(b"\x89PNG")
