"""Cells of the map as whole systems, and the map itself."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.system.systems import steps, system
from weberlink.studies.stability.cells import Cell
from weberlink.studies.stability.command import arrangements, assemble, compute, judge
from weberlink.studies.stability.wall import Wall, stability_limit

UNCODED = Cell("a", "none", "zoh", "zoh", weber=0.0, floor_n=0.0, bound_m=0.0)


def no_progress(done: int, total: int) -> None:
    """Nobody looks."""


def test_zero_order_hold_over_a_long_round_trip_is_unstable() -> None:
    verdict = judge(Cell("a", predictor="zoh", stiffness_n_m=500.0, round_trip_s=0.1))
    assert not verdict.bounded
    assert verdict.energy_generated_j is not None
    assert verdict.energy_generated_j > 1.0
    assert verdict.peak_force_n == pytest.approx(10.0)
    assert verdict.settle_s is None


def test_the_default_system_is_calm() -> None:
    verdict = judge(Cell("a"))
    assert verdict.state == "settled"
    assert verdict.energy_generated_j is not None
    assert verdict.energy_generated_j < 0.01
    assert verdict.felt_share == pytest.approx(1.0, abs=0.1)
    assert verdict.settle_s is not None
    assert verdict.force_reduction is not None
    assert verdict.force_reduction > 0.9


@pytest.mark.parametrize("cell", [UNCODED, replace(UNCODED, rate_hz=100.0), replace(UNCODED, mass_kg=0.01)])
@pytest.mark.parametrize("share", [0.7, 1.4])
def test_uncoded_cells_are_bounded_up_to_the_limit_of_the_sampled_wall(cell: Cell, share: float) -> None:
    limit = cell.limits()["stable_to_n_m"]
    assert judge(replace(cell, stiffness_n_m=share * limit)).bounded is (share < 1.0)


def test_a_link_with_jitter_and_loss_is_engaged_for_the_press() -> None:
    verdict = judge(Cell("a", round_trip_s=0.1, jitter_s=0.01, loss=0.3))
    assert verdict.failure is None


@pytest.mark.parametrize("cell", [Cell("a", scheme="no such scheme"), Cell("a", stiffness_n_m=1e9)])
def test_a_cell_that_cannot_be_run_is_a_result(cell: Cell) -> None:
    verdict = judge(cell)
    assert verdict.state == "failed"
    assert verdict.failure is not None
    assert "ConfigurationError" in verdict.failure


def test_the_map_is_the_same_whatever_the_number_of_workers(tmp_path: Path) -> None:
    surveyed = [Wall(0.1, 5.0, 0.01, 1e-3), Wall(0.001, 5.0, 0.01, 1e-3, delay_ticks=1)]
    mapped = [
        Cell("stiffness x delay", round_trip_s=0.02, stiffness_n_m=1000.0),
        Cell("stiffness x delay", round_trip_s=0.02, stiffness_n_m=1e9),
        Cell("stiffness x delay", predictor="zoh", stiffness_n_m=1000.0, round_trip_s=0.02),
        Cell("loss x delay", round_trip_s=0.05, jitter_s=0.02, loss=0.3, seed=3),
        replace(UNCODED, slice="mass x damping", mass_kg=1.0),
    ]
    told: list[tuple[int, int]] = []
    alone = compute(surveyed, mapped, 1, lambda done, total: told.append((done, total)))
    assert told == [(done, 7) for done in range(1, 8)]
    some = slice(1, None, 3)
    assert repr(compute(surveyed, mapped[some], 2, no_progress)) == repr((alone[0], alone[1][some]))
    assert [cell for cell, _ in alone[1]] == mapped
    result = assemble(*alone, full=False, run_time=1.0)
    document = json.loads(json.dumps(result.document, allow_nan=False))
    assert [cell["bounded"] for cell in document["cells"]][:3] == [True, False, False]
    assert [wall["mass_kg"] for wall in document["walls"]] == [0.1, 0.001]
    assert result.table.row_count == 4
    two_by_two = [Cell("stiffness x delay", round_trip_s=trip) for trip in (0.0, 0.1)]
    drawn = replace(result, verdicts=[*result.verdicts, *((cell, result.verdicts[0][1]) for cell in two_by_two)])
    drawn.draw(tmp_path / "figures")
    for name in ("stability_wall.png", "stability_map.png"):
        assert (tmp_path / "figures" / name).read_bytes().startswith(b"\x89PNG")


def test_every_scheme_is_on_the_map() -> None:
    assert ("none", "zoh") in arrangements()
    assert ("none", "hybrid") in arrangements()


def pressed(wall: Wall, stiffness: float) -> NDArray[np.float64]:
    """Height of a hand that means to stay inside the wall, over the whole system without link delay [m].

    Codecs send everything, in steps of the 16-bit wire over a workspace of 2 mm. The session begins with a jolt.
    """
    edge, seconds = 0.002, 3.0
    hand = {
        "mass_kg": wall.mass_kg,
        "damping_n_s_m": wall.damping_n_s_m,
        "stiffness_n_m": wall.hand_stiffness_n_m,
    }
    values = {
        "rate_hz": 1.0 / wall.tick_period,
        "codec.force.predictor": "zoh",
        "codec.force.weber": 0.0,
        "codec.force.floor_n": 0.0,
        "codec.force.step_n": stiffness * edge / 32_000,
        "codec.position.predictor": "zoh",
        "codec.position.weber": 0.0,
        "codec.position.bound_m": 0.0,
        "codec.position.step_m": edge / 32_000,
        "master.device": {
            "driver": "operator",
            "hand": hand,
            "tremor_m": 0.0,
            "home_m": [0.0, 0.0, -0.5 * edge],
            "workspace_m": edge,
            "script": [{"motion": "rest", "duration_s": 2.0 * seconds}],
        },
        "slave.robot": {
            "driver": "point",
            "home_m": [0.0, 0.0, 0.5 * edge],
            "workspace_m": edge,
            "force_n": stiffness * edge,
        },
        "slave.scene": [{"shape": "plane", "stiffness_n_m": stiffness}],
    }
    built = system(*(f"{path}={json.dumps(value)}" for path, value in values.items()))
    return np.asarray([step.master.raw_z for step in steps(built, seconds, 1.0 / wall.tick_period)])


@pytest.mark.parametrize("wall", [Wall(0.3, 8.0, 300.0, 1e-3, 1), Wall(0.05, 3.0, 1000.0, 1e-3, 1)])
def test_the_whole_system_has_the_limit_of_a_wall_that_is_a_tick_late(wall: Wall) -> None:
    limit = stability_limit(wall)
    for share in (0.95, 1.05):
        height = pressed(wall, share * limit)
        third = len(height) // 3
        middle, end = np.ptp(height[third : third + third // 2]), np.ptp(height[-third // 2 :])
        if share < 1.0:
            assert end < 0.6 * middle
        else:
            assert end > 0.98 * middle > 1e-5
