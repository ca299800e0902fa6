"""The weight of an arm, by its model."""

from collections.abc import Callable

from weberlink.geometry.joints import Joints
from weberlink_mujoco.arms.models import load

Gravity = Callable[[Joints], Joints]
"""Torques of all axes [N m] that hold the arm at these angles [rad]."""


def gravity_of(model: str, wanted: bool) -> Gravity:
    """By the model of this name, or none; raises ValueError where MuJoCo is missing."""
    return load(model).gravity if wanted else no_gravity


def no_gravity(angles: Joints) -> Joints:
    return (0.0,) * len(angles)
