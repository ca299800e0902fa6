"""The driver on models of a few lines: what it keeps beyond the contract of every driver."""

from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

from tests.slave.robots.mjcf.models import GROUND, TICK, gantry, hold, robot, wall
from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.robots.contract import RobotFault
from weberlink.slave.robots.mjcf.driver import LONGEST_GAP

STIFF = 5000.0
SERIES = 1.0 / (1.0 / GROUND + 1.0 / STIFF)
"""What is felt of the ground through a control of STIFF [N/m]."""


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


def test_force_sensor_feels_inertia(tmp_path: Path) -> None:
    """Jerked upwards, the tool holds back: downwards, by its share of the mass times the acceleration."""
    made = robot(tmp_path, gantry(), force="wrist")
    made.open(0.0)
    made.command((0.0, 0.0, 0.01), 0.0)
    pulled = 1000.0 * 0.01
    assert made.latest(TICK).force == pytest.approx((0.0, 0.0, -pulled / 3.0), rel=1e-6)


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
