"""The weight of the SO-101, by its model where MuJoCo is installed."""

from collections.abc import Callable
from importlib import import_module
from typing import cast

from weberlink.geometry.joints import Joints

Gravity = Callable[[Joints], Joints]
"""Torques of all axes [N m] that hold the arm at these angles [rad]."""


def no_gravity(angles: Joints) -> Joints:
    return (0.0,) * len(angles)


def so101_gravity() -> Gravity:
    """By the model `so101`; raises ImportError without MuJoCo."""
    model = import_module("weberlink.arms.models").load("so101")
    return cast("Gravity", model.gravity)
