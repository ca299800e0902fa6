"""The table of shapes for a force, by the names that files and options use. A new one is a file beside this and a line.

Each takes the Weber factor, the floor and what is its own.
"""

from collections.abc import Callable

from weberlink.codec.deadband.cone import ConeDeadband
from weberlink.codec.deadband.contract import Deadband
from weberlink.codec.deadband.isotropic import ForceDeadband
from weberlink.codec.deadband.level_crossing import LevelCrossingDeadband
from weberlink.codec.deadband.velocity import VelocityDeadband

ISOTROPIC = "isotropic"
SHAPES: dict[str, Callable[..., Deadband]] = {
    ISOTROPIC: ForceDeadband,
    "cone": ConeDeadband,
    "level_crossing": LevelCrossingDeadband,
    "velocity_adaptive": VelocityDeadband,
}
