"""Cells of the stability map: their scripts, their runs as whole systems, and the map itself."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from rich.console import Console

from tests.system.systems import output, steps, system
from weberlink.geometry.vector import norm
from weberlink.master.devices.hand import modelled_hand
from weberlink.master.devices.operator import OperatorOptions, motion_of
from weberlink.slave.robots.point import PointOptions, PointRobot
from weberlink.studies.stability.cells import (
    CONTACT_LIMIT_N,
    COUPLING_N_M,
    DEPTH,
    SENSOR_RANGE_N,
    Contact,
    SystemCell,
)
from weberlink.studies.stability.command import assemble, compute, configuration, judge
from weberlink.studies.stability.figures import AXES
from weberlink.studies.stability.measured_wall import plane
from weberlink.studies.stability.script import HEIGHT, timing
from weberlink.studies.stability.slices import cells
from weberlink.studies.stability.verdict import CellVerdict
from weberlink.studies.stability.wall import Grip, SampledWall, stability_limit
from weberlink.system.composition.coupling import coupling, press_limit
from weberlink.system.simulate import build_simulation

UNCODED = SystemCell("a", "none", "zoh", "zoh", weber=0.0, floor_n=0.0, bound_m=0.0)


def test_hold_over_a_long_delay_is_unstable() -> None:
    verdict = judge(SystemCell("a", "none", "zoh", stiffness_n_m=500.0, round_trip_s=0.1))
    assert not verdict.bounded
    assert verdict.energy_out_j is not None
    assert verdict.energy_out_j > 1.0
    assert verdict.peak_force_n is not None
    assert 9.0 < verdict.peak_force_n <= 10.0  # the robot presses up to its limit, which is that of the operator
    assert verdict.settle_s is None


def test_the_default_system_is_calm() -> None:
    verdict = judge(SystemCell("a"))
    assert verdict.state == "settled"
    assert verdict.energy_out_j is not None
    assert verdict.energy_out_j < 0.01
    assert verdict.felt_share == pytest.approx(1.0, abs=0.05)
    assert verdict.pressed_share == pytest.approx(1.0, abs=0.05)
    assert verdict.settle_s is not None
    assert verdict.force_reduction is not None
    assert verdict.force_reduction > 0.9


@pytest.mark.parametrize("cell", [replace(UNCODED, damping_n_s_m=2.0), replace(UNCODED, rate_hz=100.0)])
@pytest.mark.parametrize("share", [0.7, 1.4])
def test_uncoded_cells_are_bounded_below_the_limit(cell: SystemCell, share: float) -> None:
    limit = cell.limits()["stable_to_n_m"]
    assert judge(replace(cell, stiffness_n_m=share * limit)).bounded is (share < 1.0)


def test_a_lossy_link_is_engaged_for_the_press() -> None:
    verdict = judge(SystemCell("a", round_trip_s=0.1, jitter_s=0.01, loss=0.3))
    assert verdict.failure is None


@pytest.mark.parametrize("cell", [SystemCell("a", scheme="no such scheme"), SystemCell("a", stiffness_n_m=1e10)])
def test_a_cell_out_of_range_is_refused(cell: SystemCell) -> None:
    verdict = judge(cell)
    assert verdict.state == "refused"
    assert verdict.failure is not None
    assert "loopback.yaml" in verdict.failure


def test_a_broken_cell_is_a_failed_verdict() -> None:
    verdict = judge(SystemCell("a", damping_n_s_m=-1.0))
    assert verdict.state == "failed"
    assert verdict.failure is not None
    assert "damping_n_s_m" in verdict.failure


@pytest.mark.parametrize("contact", ["ball", "box"])
def test_other_objects_are_explored_and_pressed(contact: Contact) -> None:
    verdict = judge(SystemCell("a", contact=contact, friction=0.3))
    assert verdict.state == "settled"
    assert verdict.felt_share == pytest.approx(1.0, abs=0.06)
    assert verdict.impulse_ratio == pytest.approx(1.0, abs=0.06)


def test_robots_grips_and_walls_reach_the_system() -> None:
    """Each of them changes the force that a press is answered with at once, over a link that codes nothing."""
    varied = (
        UNCODED,
        replace(UNCODED, robot="simulated", robot_mass_kg=1.0),
        replace(UNCODED, robot="simulated", robot_mass_kg=1.0, robot_damping_n_s_m=10.0),
        replace(UNCODED, grip="pinch"),
        replace(UNCODED, grip="fingertip"),
        replace(UNCODED, wall_damping_n_s_m=1.0),
        replace(UNCODED, wall_speed_m_s=0.1),
    )
    assert len({pressing_force(cell) for cell in varied}) == len(varied)


def pressing_force(cell: SystemCell) -> float:
    """The largest force that the operator feels until the hand is all the way down."""
    when = timing(cell)
    return max(norm(output(step.master)) for step in steps(build_simulation(configuration(cell, when)), when.hold))


@pytest.mark.parametrize("grip", ["firm", "pinch", "fingertip"])
@pytest.mark.parametrize("stiffness", [500.0, 1e7])
def test_the_ideal_force_is_that_of_a_local_simulation(grip: Grip, stiffness: float) -> None:
    """The hand of the cell on the wall that the robot displays, at the device and without delay.

    In steps of 0.2 ms: at 1 kHz the wall of 2500 N/m is unstable with a fingertip.
    """
    step = 2e-4
    for cell in (SystemCell("a", grip=grip, stiffness_n_m=stiffness), SystemCell("a", grip=grip, robot="simulated")):
        wall, hand = plane(cell.displayed_n_m), modelled_hand(cell.wall.hand, (0.0, 0.0, HEIGHT))
        force = (0.0, 0.0, 0.0)
        for _ in range(10_000):
            hand.advance((0.0, 0.0, -DEPTH), force, step)
            force = wall.force(hand.position, step)
        assert force[2] == pytest.approx(cell.ideal_n, rel=1e-3)


def test_the_ideal_force_of_a_rigid_wall() -> None:
    """15 mm on 300 N/m and the coupling of 2500 N/m in series."""
    assert SystemCell("a", stiffness_n_m=1e7).ideal_n == pytest.approx(4.018, abs=1e-3)
    assert SystemCell("a", stiffness_n_m=1e7, robot="simulated").ideal_n == pytest.approx(4.018, abs=1e-3)
    assert SystemCell("a", robot="simulated").ideal_n == pytest.approx(0.015 / (1 / 300 + 1 / 500 + 1 / 2500))
    assert SystemCell("a", wall_speed_m_s=0.1).ideal_n is None


def test_the_limits_of_the_robot_are_those_of_the_system() -> None:
    cell = SystemCell("a")
    composed, robot = configuration(cell, timing(cell)), PointRobot(PointOptions(), None, 1e-3)
    assert coupling(composed) == COUPLING_N_M
    assert press_limit(composed.system, robot) == composed.system.master.limits.force_n == CONTACT_LIMIT_N
    assert robot.spec.force_n == SENSOR_RANGE_N


@pytest.mark.hunt
def test_the_map_does_not_depend_on_workers(tmp_path: Path) -> None:
    surveyed = [SampledWall(0.1, 5.0, 0.01, 1e-3), SampledWall(0.001, 5.0, 0.01, 1e-3, delay_ticks=1)]
    mapped = [
        SystemCell("walls", "none", round_trip_s=0.02, stiffness_n_m=1000.0),
        SystemCell("walls", "none", round_trip_s=0.02, stiffness_n_m=1e10),
        SystemCell("walls", "none", "zoh", stiffness_n_m=1000.0, round_trip_s=0.02),
        SystemCell("loss", round_trip_s=0.05, jitter_s=0.02, loss=0.3, seed=3),
        replace(UNCODED, slice="masses", mass_kg=1.0),
    ]
    told: list[tuple[int, int]] = []
    alone = compute(surveyed, mapped, 1, lambda done, total: told.append((done, total)))
    assert told == [(done, 7) for done in range(1, 8)]
    assert repr(compute(surveyed, [], 2, lambda *_: None)) == repr((alone[0], []))
    assert [cell for cell, _ in alone[1]] == mapped
    result = assemble(*alone, full=False, of=7, run_time=1.0)
    assert result.interrupted == ""
    document = json.loads(json.dumps(result.document, allow_nan=False))
    assert [cell["bounded"] for cell in document["cells"]][:3] == [True, False, False]
    assert [wall["mass_kg"] for wall in document["walls"]] == [0.1, 0.001]
    assert result.table.row_count == 4
    two_by_two = [SystemCell("walls", round_trip_s=trip) for trip in (0.0, 0.1)]
    verdicts = [*alone[1], *((cell, alone[1][0][1]) for cell in two_by_two)]
    assemble(alone[0], verdicts, full=False, of=9, run_time=1.0).draw(tmp_path / "figures")
    for name in ("stability_wall.png", "stability_map.png"):
        assert (tmp_path / "figures" / name).read_bytes().startswith(b"\x89PNG")


def test_a_map_that_was_stopped_says_so(tmp_path: Path) -> None:
    judged = [(SystemCell("walls"), CellVerdict("settled"))]
    result = assemble([], judged, full=False, of=5, run_time=1.0)
    assert result.interrupted == "1 of 5 pieces"
    result.draw(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["stability_map.png"]
    assemble([], [], full=False, of=5, run_time=1.0).draw(tmp_path)


@pytest.mark.parametrize("full", [False, True])
def test_the_table_fits_80_columns(full: bool) -> None:
    """With the widest figures that each column can have."""
    wide = CellVerdict(
        "lost",
        energy_out_j=1.2e-12,
        bound_share=12.0,
        felt_share=-0.1,
        pressed_share=12.0,
        impulse_ratio=-0.1,
        saturated=("sensor",),
    )
    rows = {(cell.slice, cell.scheme, cell.variant): cell for cell in cells(0, full=full)}
    result = assemble([], [(cell, wide) for cell in rows.values()], full=full, of=1, run_time=1.0)
    console = Console(width=80, record=True, file=StringIO())
    console.print(result.table)
    assert "…" not in console.export_text()


def pressed(wall: SampledWall, stiffness: float) -> NDArray[np.float64]:
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
            "stiffness_n_m": stiffness,
        },
        "slave.scene": [{"shape": "plane", "stiffness_n_m": stiffness}],
    }
    built = system(*(f"{path}={json.dumps(value)}" for path, value in values.items()))
    return np.asarray([step.master.raw_z for step in steps(built, seconds, 1.0 / wall.tick_period)])


def test_the_whole_system_has_the_delayed_walls_limit() -> None:
    wall = SampledWall(0.3, 8.0, 300.0, 1e-3, 1)
    limit = stability_limit(wall)
    for share in (0.95, 1.05):
        height = pressed(wall, share * limit)
        third = len(height) // 3
        middle, end = np.ptp(height[third : third + third // 2]), np.ptp(height[-third // 2 :])
        if share < 1.0:
            assert end < 0.6 * middle
        else:
            assert end > 0.98 * middle > 1e-5


SCRIPTED = [
    SystemCell("a"),
    SystemCell("a", scheme="none"),
    SystemCell("a", contact="ball"),
    SystemCell("a", contact="box"),
    SystemCell("a", friction=0.5, wall_damping_n_s_m=1.0),
    SystemCell("a", wall_speed_m_s=0.1),
    SystemCell("a", round_trip_s=1.0),
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


def test_delay_and_inertia_lengthen_only_the_hold() -> None:
    plain, far, heavy = (
        timing(SystemCell("a")),
        timing(SystemCell("a", round_trip_s=1.0)),
        timing(SystemCell("a", mass_kg=10.0)),
    )
    for other in (far, heavy):
        assert other.release - other.hold > plain.release - plain.hold
        assert other.hold - other.press == pytest.approx(plain.hold - plain.press)


def test_the_wall_of_a_cell_has_its_delay() -> None:
    assert SystemCell("a").wall.delay_ticks == 1
    assert SystemCell("a", round_trip_s=0.02).wall.delay_ticks == 20
    assert SystemCell("a", round_trip_s=0.001).wall.delay_ticks == 2  # half a tick is a tick
    assert SystemCell("a", rate_hz=4000.0, round_trip_s=0.02).wall.delay_ticks == 80


def test_least_damping_makes_the_stiffness_the_limit() -> None:
    cell = SystemCell("a", stiffness_n_m=2000.0)
    limited = SystemCell("a", damping_n_s_m=cell.least_damping())
    assert stability_limit(limited.wall) == pytest.approx(2000.0, rel=0.01)


@pytest.mark.parametrize("full", [False, True])
def test_a_map_has_every_cell_once(full: bool) -> None:
    found = cells(7, full=full)
    assert len(set(found)) == len(found)
    assert {cell.seed for cell in found} == {7}
    assert {cell.slice for cell in found} <= set(AXES)
    assert {cell.slice for cell in found} >= {"walls", "hands", "contacts", "extremes"}
    assert {cell.scheme for cell in found if cell.slice == "walls"} == {"none", "bounded"}
    assert {cell.robot_mass_kg for cell in found if cell.robot == "simulated"} >= {0.005, 1.0}
    assert max(cell.round_trip_s for cell in found if cell.slice == "walls") == 1.0
    assert any(cell.loss for cell in found if cell.slice == "walls")
    assert any(cell.wall_damping_n_s_m and cell.friction for cell in found)
    assert all(len(cell.variant) <= 16 for cell in found)


def test_the_full_map_has_every_slice() -> None:
    assert {cell.slice for cell in cells(0, full=True)} == set(AXES)
