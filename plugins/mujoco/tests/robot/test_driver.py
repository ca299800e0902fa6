"""The driver on models of a few lines: what it keeps beyond the contract of every driver."""

from math import exp, sqrt
from pathlib import Path
from typing import Any

import pytest

from plugins.mujoco.tests.robot.models import GROUND, MASS, SLIDES, TICK, gantry, hold, readings, robot, wall
from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.robots.computed import LONGEST_GAP
from weberlink.slave.robots.contract import RobotFault

BALL = SLIDES + '<joint name="ball" type="ball"/>'
FIXED = '<mujoco><worldbody><body><geom size="0.1"/><site name="tip"/></body></worldbody></mujoco>'
STIFF = 5000.0
SERIES = 1.0 / (1.0 / GROUND + 1.0 / STIFF)  # what is felt of the ground through a control of STIFF [N/m]


@pytest.mark.parametrize("ratio", [0.5, 1.0])
def test_a_step_is_that_of_the_damped_oscillator(tmp_path: Path, ratio: float) -> None:
    """x = x_d (1 - (1 + w t) exp(-w t)) at a ratio of 1, and as far over as a ratio of 0.5 goes: exp(-pi / sqrt 3)."""
    made = robot(tmp_path, gantry(timestep=0.0001), stiffness_n_m=500.0, damping_ratio=ratio)
    made.open(0.0)
    omega = sqrt(500.0 / MASS)
    found = [reading.position[2] for reading in readings(made, [(0.0, 0.0, 0.01)] * 300)]
    if ratio == 1.0:
        expected = [0.01 * (1.0 - (1.0 + omega * t) * exp(-omega * t)) for t in (TICK * n for n in range(1, 301))]
        assert found == pytest.approx(expected, abs=0.004 * 0.01)
    else:
        assert max(found) == pytest.approx(0.01 * (1.0 + exp(-3.14159 / sqrt(3.0))), rel=0.01)


@pytest.mark.parametrize("force", ["contacts", "wrist"])
def test_wall_pushes_back_along_its_normal(tmp_path: Path, force: str) -> None:
    """Both springs in series; the sensor is turned, and the weight that hangs on it is not felt."""
    room = wall((1.0, 0.0, 0.0), 0.04) + wall((0.0, -1.0, 0.0), 0.04) + wall((0.0, 0.0, -1.0), 0.04)
    made = robot(tmp_path, gantry(room), force=force, stiffness_n_m=STIFF)
    made.open(0.0)
    reading = hold(made, (-0.05, 0.05, 0.05), 1000)
    felt = 0.01 * SERIES
    assert reading.force == pytest.approx((felt, -felt, -felt), rel=1e-6)
    assert reading.position == pytest.approx((-0.05 + felt / STIFF, 0.05 - felt / STIFF, 0.05 - felt / STIFF))


def test_long_gap_is_skipped(tmp_path: Path) -> None:
    """It moves on as far as in the longest gap, and no further."""
    positions = []
    for gap in (LONGEST_GAP, 3600.0):
        made = robot(tmp_path, gantry(), stiffness_n_m=20.0)
        made.open(0.0)
        made.command((0.0, 0.0, 0.03), 0.0)
        reading = made.latest(gap)
        assert reading.at == gap
        positions.append(reading.position)
    assert positions[0] == positions[1]
    assert 0.005 < positions[0][2] < 0.025


@pytest.mark.parametrize("command", [(1e308, 0.0, 0.0), (1e12, -1e12, 0.0)])
@pytest.mark.parametrize("force", ["contacts", "wrist"])
def test_extreme_command_is_a_silent_robot_fault(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, command: Vector, force: str
) -> None:
    folder = tmp_path / "working"
    folder.mkdir()
    monkeypatch.chdir(folder)
    made = robot(tmp_path, gantry(wall()), force=force)
    made.open(0.0)
    with pytest.raises(RobotFault, match=r"mujoco: the simulation cannot go on: Nan, Inf or huge value") as caught:
        hold(made, command, 20)
    assert "\n" not in str(caught.value)
    with pytest.raises(RobotFault):
        hold(made, ZERO, 1, start=1.0)
    made.open(2.0)
    assert hold(made, ZERO, 10, start=2.0).position == pytest.approx(ZERO, abs=1e-12)
    assert tuple(capfd.readouterr()) == ("", "")
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "options", "line"),
    [
        ("<mujoco><worldbody></mujoco>", {}, r"^model: .*model\.xml: XML parse error .*MISMATCHED"),
        ('<mujoco><include file="part.xml"/></mujoco>', {}, r"^model: .*part\.xml"),
        (gantry(), {"end_effector": "tipp"}, r"^end_effector: no site is called 'tipp'; nearest is 'tip', there are f"),
        (FIXED, {}, r"^end_effector: no joint moves the site 'tip'$"),
        (gantry(), {"force": "shaken"}, r"^force: no force sensor is called 'shaken'; nearest is 'wrist'"),
        (gantry(), {"stiffness_n_m": 1e9}, r"^stiffness_n_m: .* 1\.1e\+04 Hz; divide it by at least 12$"),
        (gantry(), {"rotation": {"torque": "twist"}}, r"^rotation\.torque: the model has no torque sensor with a name"),
        (gantry(joints=BALL), {"rotation": {"stiffness_n_m_rad": 1e7}}, r"rotation\.stiffness_n_m_rad: .* divide"),
    ],
)  # fmt: skip
def test_a_file_or_a_name_that_is_wrong(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], text: str, options: dict[str, Any], line: str
) -> None:
    with pytest.raises(ValueError, match=line) as caught:
        robot(tmp_path, text, **options)
    assert "\n" not in str(caught.value)
    assert tuple(capfd.readouterr()) == ("", "")
