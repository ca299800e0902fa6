"""Cells of the stability map: their scripts, their runs as whole systems, and the map itself."""

from dataclasses import replace

import pytest

from weberlink.master.devices.operator import OperatorOptions, motion_of
from weberlink.studies.stability.cells import (
    DEPTH,
    EXTREMES,
    FAMILIES,
    SCHEMES,
    SystemCell,
    cells,
)
from weberlink.studies.stability.script import HEIGHT, timing
from weberlink.studies.stability.study import judge


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


SCRIPTED = [
    SystemCell("a"),
    SystemCell("a", contact="box"),
    SystemCell("a", friction=0.5, wall_damping_n_s_m=1.0),
    SystemCell("a", round_trip_s=0.1, jitter_s=0.02, loss=0.3),
    SystemCell("a", mass_kg=10.0),
]


@pytest.mark.parametrize("cell", SCRIPTED)
def test_the_script_follows_the_timing(cell: SystemCell) -> None:
    when = timing(cell)
    options = OperatorOptions.model_validate({"script": when.steps, "home_m": (0.0, 0.0, HEIGHT), "repeat": False})
    motion = motion_of(options.script, options.home_m, repeat=False)
    assert motion.duration == pytest.approx(when.end)
    assert motion.at(when.press)[0][2] == pytest.approx(HEIGHT)
    assert motion.at(when.press + 0.2)[0][2] < HEIGHT
    assert all(motion.at(share * when.press)[0][2] == pytest.approx(HEIGHT) for share in (0.25, 0.5, 0.75))
    for time in (when.hold, 0.5 * (when.hold + when.release), when.release):
        assert motion.at(time)[0][2] == pytest.approx(-DEPTH)
    assert motion.at(when.release + 0.2)[0][2] > -DEPTH


@pytest.mark.parametrize("full", [False, True])
def test_the_map_has_every_family_under_every_scheme(full: bool) -> None:
    found = cells(7, full=full)
    assert len(set(found)) == len(found)
    mapped = {(cell.family, cell.scheme) for cell in found if cell.family != "extremes"}
    assert mapped == {(name, scheme) for name in FAMILIES for scheme in SCHEMES}
    assert {cell.case for cell in found} == {"", *EXTREMES}
