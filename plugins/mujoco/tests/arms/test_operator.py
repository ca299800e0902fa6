"""The scripted hand on a leader arm: it follows its script, yields to torque, and gives no energy of its own."""

from typing import Any

import pytest

from tests.session.systems import ARMS
from weberlink.arms.contract import ArmReading
from weberlink.geometry.joints import Joints, is_finite
from weberlink_mujoco.arms.operator import ArmOperator, ArmOperatorOptions

TICK = 0.001
MODEL = ARMS.with_name("arm.xml")
FRICTION = 0.005  # [N m] of its joints
REST = [{"motion": "hold", "duration_s": 1.0}]
NONE = (0.0,) * 6


def operator(**options: Any) -> ArmOperator:
    made = ArmOperator(ArmOperatorOptions.model_validate({"model": MODEL} | options), TICK)
    made.open(0.0)
    return made


def run(made: ArmOperator, ticks: int, torques: Joints = NONE) -> ArmReading:
    for tick in range(1, ticks + 1):
        reading = made.latest(tick * TICK)
        made.command(torques, tick * TICK)
    return reading


def test_it_comes_where_the_script_says() -> None:
    script = [
        {"motion": "move", "joints_rad": (0.5, -0.6, 0.4, -0.3, 0.2), "duration_s": 1.0},
        {"motion": "move", "gripper_rad": 1.0, "duration_s": 0.5},
        {"motion": "swing", "amplitude_rad": (0.2,) * 6, "frequency_hz": 1.0, "duration_s": 1.0},
        {"motion": "hold", "duration_s": 1.0},
    ]
    made = operator(script=script, repeat=False)
    assert not run(made, 3400).ended
    reading = run(made, 3600)
    assert reading.ended
    assert reading.angles == pytest.approx((0.5, -0.6, 0.4, -0.3, 0.2, 1.0), abs=FRICTION / 2.0 + 2e-3)


def test_the_hand_yields_to_displayed_torque_within_its_limit() -> None:
    """By its own compliance, but for the friction of the arm, whose gravity is compensated."""
    made = operator(script=REST)
    torques = (0.1, -0.1, 0.1, -0.1, 0.1, 0.15)
    reading = run(made, 700, torques)
    for angle, torque in zip(reading.angles, torques, strict=True):
        assert angle == pytest.approx(torque / 2.0, abs=FRICTION / 2.0 + 1e-3)
    assert reading.torques == NONE
    held = [run(operator(script=REST), 500, (torque, *NONE[1:])).angles[0] for torque in (2.94, 1e9)]
    assert held[0] == held[1]
    home = (0.0, 0.6, 0.3, 0.2, 0.0, 0.5)
    assert run(operator(script=REST, home_rad=home), 500).angles == pytest.approx(home, abs=1e-6)


@pytest.mark.parametrize("stiffness", [1e-3, 1e6])
def test_no_hand_and_no_torque_makes_it_diverge(stiffness: float) -> None:
    """Torques that turn in every tick, on an arm that is pushed against its end stops."""
    hand = {"stiffness_nm_rad": stiffness, "damping_nm_s_rad": 0.0, "inertia_kg_m2": 0.0}
    made = operator(hand=hand, torque_nm=5.0)
    for tick in range(1, 300):
        angles = made.latest(tick * TICK).angles
        assert is_finite(angles)
        way = 1.0 if tick % 7 < 3 or tick > 180 else -1.0
        made.command((way * 1e3,) * made.spec.axes, tick * TICK)
    beyond = (a - high for a, high in zip(angles, made.spec.upper, strict=True))
    assert max(beyond) < 0.3
