"""When a prediction is wrong by more than a person could feel: the shapes of the deadband, one a file.

`ForceDeadband` is the default. What each rests on and how to choose is in docs/deadbands.md.
"""

from weberlink.codec.deadband.cone import ConeDeadband
from weberlink.codec.deadband.contract import Deadband, Reference
from weberlink.codec.deadband.isotropic import ForceDeadband
from weberlink.codec.deadband.level_crossing import LevelCrossingDeadband
from weberlink.codec.deadband.position import PositionDeadband
from weberlink.codec.deadband.velocity import VelocityDeadband

__all__ = [
    "ConeDeadband",
    "Deadband",
    "ForceDeadband",
    "LevelCrossingDeadband",
    "PositionDeadband",
    "Reference",
    "VelocityDeadband",
]
