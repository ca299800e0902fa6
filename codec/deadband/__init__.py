"""When a prediction is wrong by more than a person could feel: the shapes of the deadband, one a file.

`ForceDeadband` is the default. What each rests on and how to choose is in docs/deadbands.md.
"""

from codec.deadband.cone import ConeDeadband
from codec.deadband.contract import Deadband, Reference
from codec.deadband.isotropic import ForceDeadband
from codec.deadband.level_crossing import LevelCrossingDeadband
from codec.deadband.position import PositionDeadband
from codec.deadband.velocity import VelocityDeadband

__all__ = [
    "ConeDeadband",
    "Deadband",
    "ForceDeadband",
    "LevelCrossingDeadband",
    "PositionDeadband",
    "Reference",
    "VelocityDeadband",
]
