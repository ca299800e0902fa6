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
from weberlink.studies.frame import FrameResult, Row
from weberlink.studies.stability.cells import (
    CONTACT_LIMIT_N,
    COUPLING_N_M,
    DEPTH,
    EXTREMES,
    FAMILIES,
    SCHEMES,
    SENSOR_RANGE_N,
    Contact,
    SystemCell,
    cells,
)
from weberlink.studies.stability.measured_wall import plane
from weberlink.studies.stability.script import HEIGHT, timing
from weberlink.studies.stability.study import STUDY, MapOptions, configuration, judge, rows_of
from weberlink.studies.stability.wall import Grip, SampledWall, stability_limit
from weberlink.system.composition.coupling import coupling, press_limit
from weberlink.system.simulate import build_simulation

UNCODED = SystemCell("a", "none", "zoh", "zoh", weber=0.0, floor_n=0.0, bound_m=0.0)


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


@pytest.mark.parametrize("cell", [replace(UNCODED, damping_n_s_m=2.0), replace(UNCODED, rate_hz=100.0)])
@pytest.mark.parametrize("share", [0.7, 1.4])
def test_uncoded_cells_are_bounded_below_the_limit(cell: SystemCell, share: float) -> None:
    limit = cell.limits()["stable_to_n_m"]
    assert judge(replace(cell, stiffness_n_m=share * limit))["bounded"] is (share < 1.0)


def test_a_lossy_link_is_engaged_for_the_press() -> None:
    assert "failure" not in judge(SystemCell("a", round_trip_s=0.1, jitter_s=0.01, loss=0.3))


@pytest.mark.parametrize(
    ("cell", "state", "said"),
    [
        (SystemCell("a", scheme="no such scheme"), "refused", "loopback.yaml"),
        (SystemCell("a", stiffness_n_m=1e10), "refused", "loopback.yaml"),
        (SystemCell("a", damping_n_s_m=-1.0), "failed", "damping_n_s_m"),
    ],
)
def test_a_cell_that_cannot_run_is_a_verdict(cell: SystemCell, state: str, said: str) -> None:
    found = judge(cell)
    assert (found["state"], found["bounded"]) == (state, False)
    assert said in found["failure"]


@pytest.mark.parametrize("contact", ["ball", "box"])
def test_other_objects_are_explored_and_pressed(contact: Contact) -> None:
    found = judge(SystemCell("a", contact=contact, friction=0.3))
    assert found["state"] == "settled"
    assert found["felt_share"] == pytest.approx(1.0, abs=0.06)
    assert found["impulse_ratio"] == pytest.approx(1.0, abs=0.06)


def test_a_turned_stick_is_felt_as_torque() -> None:
    found = judge(SystemCell("a", robot="tool"))
    assert found["state"] == "settled"
    assert found["felt"] == pytest.approx(1.0, abs=0.1)
    assert found["steady_force_n"] > 0.01


def test_an_arm_on_a_table_is_felt_as_torque() -> None:
    pytest.importorskip("mujoco")
    found = judge(SystemCell("a", robot="arm", stiffness_n_m=100.0))
    assert found["state"] == "settled"
    assert found["felt"] == pytest.approx(1.0, abs=0.2)


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


@pytest.fixture(scope="module")
def result() -> FrameResult:
    """Two walls and three systems."""
    cases = [
        SampledWall(0.1, 5.0, 0.01, 1e-3),
        SampledWall(0.001, 5.0, 0.01, 1e-3, delay_ticks=1),
        SystemCell("plane", "none", round_trip_s=0.02, stiffness_n_m=1000.0),
        SystemCell("plane", "baseline-tdpa", stiffness_n_m=1e10),
        SystemCell("extremes", case="10 Hz", **EXTREMES["10 Hz"]),
    ]
    return replace(STUDY, cases=lambda _: cases).result(MapOptions(), workers=1)


def test_the_document_has_walls_and_systems(result: FrameResult) -> None:
    rows = json.loads(json.dumps(result.document, allow_nan=False))["rows"]
    assert [(row["kind"], row["mass_kg"], row.get("state")) for row in rows] == [
        ("wall", 0.1, None), ("wall", 0.001, None), ("system", 0.3, "settled"), ("system", 0.3, "refused"),
        ("system", 0.3, rows[4]["state"]),
    ]  # fmt: skip
    assert rows[2]["stable_to_n_m"] > rows[2]["passive_to_n_m"]
    assert "stable_to_n_m" not in rows[3]
    assert rows[0] == json.loads(json.dumps(rows_of(SampledWall(0.1, 5.0, 0.01, 1e-3))[0]))


def test_the_figures_are_drawn(result: FrameResult, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    result.draw(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"stability_map.png", "stability_wall.png"}


def wide(cell: SystemCell) -> list[Row]:
    """The widest figures that each column can have."""
    figures = {"state": "oscillating", "bounded": False, "bound_kept": True, "saturated": ["sensor"]}
    shares = {"bound_share": 12.0, "felt": -0.1 if cell.round_trip_s else 12.0, "impulse_ratio": 12.34}
    named = {"family": cell.family, "scheme": cell.scheme, "case": cell.case}
    return [{"kind": "system", **named, **figures, **shares, "energy_out_j": 1.2e-12, "drift_m": 0.123}]


@pytest.mark.parametrize("full", [False, True])
def test_the_table_fits_80_columns(full: bool) -> None:
    study = replace(STUDY, cases=lambda options: cells(0, full=options.full), run=wide)
    console = Console(width=80, record=True, file=StringIO())
    console.print(study.result(MapOptions(full), workers=1).table)
    text = console.export_text()
    assert "…" not in text
    for name in (*FAMILIES, *EXTREMES):
        assert name in text


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


@pytest.mark.parametrize("full", [False, True])
def test_the_map_has_every_family_under_every_scheme(full: bool) -> None:
    found = cells(7, full=full)
    assert len(set(found)) == len(found)
    assert {cell.seed for cell in found} == {7}
    mapped = [cell for cell in found if cell.family != "extremes"]
    assert {(cell.family, cell.scheme) for cell in mapped} == {
        (name, scheme) for name in FAMILIES for scheme in SCHEMES
    }
    for family in FAMILIES:
        mine = [cell for cell in mapped if cell.family == family]
        assert len({cell.stiffness_n_m for cell in mine}) >= 2
        assert {0.0, 0.1, 0.5} <= {cell.round_trip_s for cell in mine}
    assert {cell.case for cell in found} == {"", *EXTREMES}
