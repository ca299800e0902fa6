"""Position control, posture and the way home, against formulas."""

from math import exp, sqrt
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

import numpy as np

from tests.slave.robots.mjcf.models import MASS, TICK, chain, gantry, readings, robot, written
from weberlink.geometry.vector import distance
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


@pytest.mark.parametrize("posture", [0.0, 2.0])
def test_redundant_joints_return_without_moving_the_tip(tmp_path: Path, posture: float) -> None:
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
