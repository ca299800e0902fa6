"""Sensors of an arm's axes: each takes its part of a reading that is sound in all of them."""

from math import inf, nan
from types import SimpleNamespace

import pytest

from tests.arms.ends import sensors, spec
from weberlink.arms.contract import ArmReading
from weberlink.arms.sensor import PressedAxes, Quantity
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO

READING = ArmReading(0.0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))


@pytest.mark.parametrize(("quantity", "taken"), [("angles", (1.0, 2.0, 3.0)), ("torques", (4.0, 5.0, 6.0))])
def test_each_takes_and_sends_its_axes(quantity: Quantity, taken: tuple[float, ...]) -> None:
    joints, gripper = sensors(quantity)
    (alone,) = sensors(quantity, spec(joints=("base", "elbow", "wrist"), gripper=False))
    for sensor, part in ((joints, slice(0, 2)), (gripper, slice(2, 3)), (alone, slice(0, 3))):
        assert (sensor.sample(0), sensor.sampled) == ((ZERO, inf), (0.0,) * len(taken[part]))
        sensor.take(READING)
        sensor.sample(0)
        assert sensor.value == sensor.sampled == taken[part]
        sensor.shown = lambda values: values[:1]
        sensor.sample(0)
        assert sensor.sampled == taken[part][:1]


@pytest.mark.parametrize(
    ("angles", "torques", "says"),
    [
        ((1.0, 2.0), (0.0,) * 3, "2 angles for 3 axes"),
        ((1.0, 2.0, 3.0), (0.0,) * 4, "4 torques for 3 axes"),
        ((1.0, nan, 3.0), (0.0,) * 3, "the angles"),
        ((1.0, 2.0, 3.0), (0.0, 0.0, inf), "the torques"),
    ],
)
def test_a_reading_that_is_not_sound_in_all_axes_is_named(
    angles: tuple[float, ...], torques: tuple[float, ...], says: str
) -> None:
    for sensor in sensors("angles"):
        assert says in (sensor.complaint(ArmReading(0.0, angles, torques)) or "")
        assert sensor.complaint(READING) is None


@pytest.mark.parametrize(
    ("torques", "most"),
    [
        ((0.0, 0.0), inf),
        ((0.05, -0.05), inf),  # no more than its own deadband
        ((0.5, 0.0), 0.05 / (0.01 * 10.0)),
        ((-0.6, 0.0), 0.06 / (0.01 * 10.0)),
        ((-0.6, 0.8), 0.08 / (0.02 * 50.0)),
    ],
)
def test_where_a_torque_is_pressed_angles_are_sent_as_finely_as_it_is_felt(torques: Joints, most: float) -> None:
    pressed = PressedAxes((0.01, 0.02), (10.0, 50.0), lambda _, torque: max(0.1 * torque, 0.05))
    joints = sensors("angles")[0]
    joints.pressed, joints.felt = pressed, SimpleNamespace(decoded=(*torques, 0.5))
    assert joints.sample(0)[1] == pytest.approx(most)
