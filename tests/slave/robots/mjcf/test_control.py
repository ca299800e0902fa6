"""Position control, posture and the way home, against formulas."""

from math import exp, sqrt
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

import numpy as np

from tests.slave.robots.mjcf.models import MASS, TICK, chain, gantry, hold, lead, readings, robot, written
from weberlink.geometry.vector import ZERO, distance
from weberlink.slave.robots.mjcf.impedance import Impedance
from weberlink.slave.robots.mjcf.plant import Plant, settle

ABOVE = (0.0, 0.0, 0.04)


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


def test_a_robot_lags_as_it_says(tmp_path: Path) -> None:
    made = robot(tmp_path, gantry(), stiffness_n_m=2000.0)
    assert "lags a ramp by 20.0 ms" in made.description()
    made.open(0.0)
    reading = readings(made, ((0.0, 0.0, 0.1 * tick * TICK) for tick in range(1, 501)))[-1]
    assert 0.1 * 0.5 - reading.position[2] == pytest.approx(0.1 * 0.020, rel=0.06)  # a tick more or less


@pytest.mark.parametrize("compensated", [0.0, 1.0])
def test_gravity_and_servos_of_the_file_do_not_move_it(tmp_path: Path, compensated: float) -> None:
    made = robot(tmp_path, chain(compensated), home_m=ABOVE)
    made.open(0.0)
    assert distance(hold(made, ABOVE, 500).position, ABOVE) < 1e-9


def test_a_redundant_arm_goes_where_it_is_told_and_its_joints_come_back(tmp_path: Path) -> None:
    made = robot(tmp_path, chain(), home_m=ABOVE, stiffness_n_m=500.0)
    for goal in ((0.03, 0.04, 0.03), (-0.02, -0.03, 0.05)):
        assert distance(lead(made, ABOVE, goal, ticks=400).position, goal) < 1e-5


@pytest.mark.parametrize("posture", [0.0, 2.0])
def test_joints_left_over_return_while_the_end_effector_stays(tmp_path: Path, posture: float) -> None:
    """Pushed so that the end effector rests; without a posture they stay where the push left them."""
    plant = Plant(written(tmp_path, chain()), "tip", None)
    settle(plant, ABOVE)
    control = Impedance(plant, 1000.0, 1.0, posture)
    jacobian = plant.jacobian
    inner = np.eye(5) - np.linalg.pinv(jacobian) @ jacobian
    plant.data.qvel[:] = 3.0 * inner @ (1.0, 1.0, -1.0, 1.0, 1.0)
    away = [0.0]
    for _ in range(1500):
        control.apply(ABOVE)
        plant.advance(TICK)
        plant.refresh()
        away.append(float(np.linalg.norm(plant.data.qpos - plant.home)))
        assert distance(tuple(plant.position), ABOVE) < 0.003
    assert max(away) > 0.1
    assert (away[-1] < 1e-3) is (posture > 0.0)


@pytest.mark.parametrize("posture", [0.0, 3.0])
def test_the_posture_takes_nothing_from_the_stiffness(tmp_path: Path, posture: float) -> None:
    """Pressed against a hard table, the force is stiffness times depth, whatever the joints left over do."""
    made = robot(tmp_path, chain(), home_m=ABOVE, stiffness_n_m=400.0, posture_hz=posture)
    reading = lead(made, ZERO, (0.0, 0.0, -0.01), ticks=600)
    depth = reading.position[2] + 0.01
    assert reading.force[2] == pytest.approx(400.0 * depth, rel=0.01)
    assert reading.force[2] > 3.0


def test_home_is_reached_within_the_limits_of_the_joints(tmp_path: Path) -> None:
    plant = Plant(written(tmp_path, chain(limit_deg=10.0)), "tip", "bent")
    settle(plant, (0.03, -0.02, 0.05))
    assert tuple(plant.position) == pytest.approx((0.03, -0.02, 0.05), abs=1e-6)
    assert all(low <= q <= high for q, (low, high) in zip(plant.home, plant.model.jnt_range, strict=True))
    plant.data.qpos[:] = 0.0
    plant.reset()
    assert tuple(plant.position) == pytest.approx((0.03, -0.02, 0.05), abs=1e-6)


def test_home_is_where_the_file_or_its_keyframe_begins_if_it_is_not_given(tmp_path: Path) -> None:
    wide: dict[str, Any] = {"workspace_m": 1.0}
    for options in (wide, wide | {"keyframe": "bent"}):
        made = robot(tmp_path, chain(), **options)
        made.open(0.0)
        home = made.latest(0.0).position
        assert (distance(home, (0.0, 0.0, 0.01)) < 1e-9) is (options is wide)
        assert distance(hold(made, home, 100).position, home) < 1e-9
