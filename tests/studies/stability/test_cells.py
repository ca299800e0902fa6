"""The cells of a map and their script."""

import pytest

from weberlink.master.devices.operator import OperatorOptions, motion_of
from weberlink.studies.stability.cells import DEPTH, HEIGHT, Cell, cells, timing
from weberlink.studies.stability.wall import stability_limit

ARRANGEMENTS = [("none", "zoh"), ("mmt", "hybrid")]
CELLS = [
    Cell("a"),
    Cell("a", round_trip_s=1.0),
    Cell("a", round_trip_s=0.1, jitter_s=0.02, loss=0.3),
    Cell("a", mass_kg=10.0),
]


@pytest.mark.parametrize("cell", CELLS)
def test_the_script_does_what_the_timing_says(cell: Cell) -> None:
    when = timing(cell)
    options = OperatorOptions.model_validate({"script": when.steps, "home_m": (0.0, 0.0, HEIGHT), "repeat": False})
    motion = motion_of(options.script, options.home_m, repeat=False)
    assert motion.duration == pytest.approx(when.end)
    assert motion.at(when.press)[0][2] == pytest.approx(HEIGHT)
    assert motion.at(when.press + 0.2)[0][2] < HEIGHT
    for time in (when.hold, 0.5 * (when.hold + when.release), when.release):
        assert motion.at(time)[0][2] == pytest.approx(-DEPTH)
    assert motion.at(when.release + 0.2)[0][2] > -DEPTH


def test_delay_and_inertia_lengthen_the_hold_and_not_the_motion() -> None:
    plain, far, heavy = timing(Cell("a")), timing(Cell("a", round_trip_s=1.0)), timing(Cell("a", mass_kg=10.0))
    for other in (far, heavy):
        assert other.release - other.hold > plain.release - plain.hold
        assert other.hold - other.press == pytest.approx(plain.hold - plain.press)


def test_over_the_wire_the_force_is_a_tick_late_and_later_with_delay() -> None:
    assert Cell("a").wall.delay_ticks == 1
    assert Cell("a", round_trip_s=0.02).wall.delay_ticks == 20
    assert Cell("a", round_trip_s=0.001).wall.delay_ticks == 2  # half a tick is a tick
    assert Cell("a", rate_hz=4000.0, round_trip_s=0.02).wall.delay_ticks == 80


def test_least_damping_is_that_whose_limit_is_the_stiffness() -> None:
    cell = Cell("a", stiffness_n_m=2000.0)
    limited = Cell("a", damping_n_s_m=cell.least_damping())
    assert stability_limit(limited.wall) == pytest.approx(2000.0, rel=0.01)


def test_a_map_has_every_slice_and_the_seed_and_no_cell_twice() -> None:
    for full in (False, True):
        found = cells(ARRANGEMENTS, 7, full=full)
        assert len(set(found)) == len(found)
        assert {cell.seed for cell in found} == {7}
        assert {(cell.scheme, cell.predictor) for cell in found if cell.slice == "stiffness x delay"} == {*ARRANGEMENTS}
        assert max(cell.round_trip_s for cell in found) == 1.0
        assert {cell.slice for cell in found} == {
            "stiffness x delay",
            "mass x damping",
            "rate x stiffness",
            "k x delay",
            "loss x delay",
            "hand, delayed",
        }
