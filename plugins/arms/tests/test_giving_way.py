"""An axis under position control, at rest between its goal, its weight and a wall, gives way."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.joints import Joints
from weberlink_arms.servo.on_close import LEAST_RAD, STEPS, give_way

STIFFNESS_NM_RAD = 5.0


class Axis:
    """An axis without friction, with a wall at 0 [N m/rad] and a weight [N m] that the driver may know."""

    def __init__(self, wall: float, weight: float, modelled: bool) -> None:
        self.wall, self.weight = wall, weight
        self.raised = weight / STIFFNESS_NM_RAD if modelled else 0.0
        self.goals: list[float] = []
        self.angle = 0.0

    def go(self, goals: Joints) -> Joints:
        (goal,) = goals
        self.goals.append(goal)
        self.angle = goal - self.weight / STIFFNESS_NM_RAD
        if self.angle > 0.0:
            self.angle *= STIFFNESS_NM_RAD / (STIFFNESS_NM_RAD + self.wall)
        return (self.angle + self.raised,)

    @property
    def push(self) -> float:
        """Torque on the wall [N m]."""
        return self.wall * max(0.0, self.angle)


weights = st.floats(-1.0, 1.0)


@given(st.floats(0.01, 1.0), st.floats(20.0, 1000.0), weights, st.booleans())
def test_push_on_a_wall_ends(goal: float, wall: float, weight: float, modelled: bool) -> None:
    axis = Axis(wall, weight, modelled)
    here = axis.go((goal,))
    before = axis.push
    give_way((goal,), here, axis.go)
    assert len(axis.goals) <= 1 + STEPS
    mirrored = Axis(wall, weight, modelled)
    give_way((-goal,), (-mirrored.go((goal,))[0],), lambda goals: (-mirrored.go((-goals[0],))[0],))
    assert mirrored.goals == axis.goals, "in either direction"
    assert axis.push <= 0.1 * before + STIFFNESS_NM_RAD * LEAST_RAD + max(0.0, 0.0 if modelled else -weight)


@given(st.floats(-1.0, 1.0), weights)
def test_free_arm_with_a_model_keeps_its_place(goal: float, weight: float) -> None:
    axis = Axis(0.0, weight, modelled=True)
    here = axis.go((goal,))
    angle = axis.angle
    assert give_way((goal,), here, axis.go) == pytest.approx((goal,))
    assert axis.angle == pytest.approx(angle)


@given(st.floats(-1.0, 1.0), weights)
def test_free_arm_without_a_model_sinks_once(goal: float, weight: float) -> None:
    axis = Axis(0.0, weight, modelled=False)
    here = axis.go((goal,))
    angle = axis.angle
    give_way((goal,), here, axis.go)
    assert axis.angle == pytest.approx(angle - weight / STIFFNESS_NM_RAD)


def test_axes_are_judged_apart() -> None:
    axes = [Axis(100.0, 0.0, modelled=False), Axis(0.0, 0.5, modelled=False)]

    def go(goals: Joints) -> Joints:
        return tuple(axis.go((goal,))[0] for axis, goal in zip(axes, goals, strict=True))

    goals = (0.5, 0.5)
    give_way(goals, go(goals), go)
    assert axes[0].push < 0.02
    assert axes[1].angle == pytest.approx(0.5 - 2.0 * 0.5 / STIFFNESS_NM_RAD)
