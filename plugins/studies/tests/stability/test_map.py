"""Cells of the stability map: their scripts, their runs as whole systems, and the map itself."""

from dataclasses import replace

import pytest

from weberlink_studies.stability.cells import EXTREMES, FAMILIES, SCHEMES, SystemCell, cells
from weberlink_studies.stability.study import judge


def test_hold_over_a_long_delay_is_unstable() -> None:
    found = judge(SystemCell("a", "none", "zoh", stiffness_n_m=500.0, round_trip_s=0.1))
    assert not found["bounded"]
    assert found["energy_out_j"] > 1.0
    assert 9.0 < found["peak_force_n"] <= 10.0  # the robot presses up to its limit, which is that of the operator
    assert "settle_s" not in found


def test_the_default_system_is_calm() -> None:
    found = judge(SystemCell("a"))
    assert found["state"] == "settled"
    assert found["energy_out_j"] < 0.01
    assert found["felt"] == found["felt_share"] == pytest.approx(1.0, abs=0.05)
    assert found["pressed_share"] == pytest.approx(1.0, abs=0.05)
    assert found["drift_m"] < 1e-3
    assert found["force_reduction"] > 0.9


def test_an_arm_is_judged() -> None:
    pytest.importorskip("weberlink_arms")
    found = judge(SystemCell("a", robot="arm", stiffness_n_m=30.0))
    assert found["bounded"]
    assert found["bound_kept"]


@pytest.mark.parametrize("share", [0.7, 1.4])
def test_uncoded_cells_are_bounded_below_the_limit(share: float) -> None:
    cell = SystemCell("a", "none", "zoh", "zoh", weber=0.0, floor_n=0.0, bound_m=0.0, rate_hz=100.0)
    limit = cell.limits()["stable_to_n_m"]
    assert judge(replace(cell, stiffness_n_m=share * limit))["bounded"] is (share < 1.0)


@pytest.mark.parametrize(
    ("cell", "state", "said"),
    [
        (SystemCell("a", scheme="no such scheme"), "refused", "loopback.yaml"),
        (SystemCell("a", damping_n_s_m=-1.0), "failed", "damping_n_s_m"),
    ],
)
def test_a_cell_that_cannot_run_is_a_verdict(cell: SystemCell, state: str, said: str) -> None:
    found = judge(cell)
    assert (found["state"], found["bounded"]) == (state, False)
    assert said in found["failure"]


@pytest.mark.parametrize("full", [False, True])
def test_the_map_has_every_family_under_every_scheme(full: bool) -> None:
    found = cells(7, full=full)
    assert len(set(found)) == len(found)
    mapped = {(cell.family, cell.scheme) for cell in found if cell.family != "extremes"}
    assert mapped == {(name, scheme) for name in FAMILIES for scheme in SCHEMES}
    assert {cell.case for cell in found} == {"", *EXTREMES}
