"""The table of shapes for a force, by the names that files and options use. A new one is a file beside this and a line.

Each takes the Weber factor, the floor and what is its own.
"""

from collections.abc import Callable

from codec.deadband.cone import ConeDeadband
from codec.deadband.contract import Deadband
from codec.deadband.isotropic import ForceDeadband
from codec.deadband.level_crossing import LevelCrossingDeadband
from codec.deadband.velocity import VelocityDeadband

ISOTROPIC = "isotropic"
SHAPES: dict[str, Callable[..., Deadband]] = {
    ISOTROPIC: ForceDeadband,
    "cone": ConeDeadband,
    "level_crossing": LevelCrossingDeadband,
    "velocity_adaptive": VelocityDeadband,
}
