"""The deadband of the force channel from a configuration."""

from collections.abc import Callable
from math import radians

from weberlink.codec.deadband import ConeDeadband, Deadband, ForceDeadband, LevelCrossingDeadband, VelocityDeadband
from weberlink.geometry.vector import Vector
from weberlink.system.configuration import System
from weberlink.system.configuration.deadband import ConeSettings, LevelCrossingSettings, VelocityAdaptiveSettings


def force_deadband(system: System, weber: float) -> Deadband:
    """The shape that the file asks for, at a Weber factor that a session may have changed."""
    force = system.codec.force
    match force.deadband:
        case ConeSettings(direction_deg=direction):
            return ConeDeadband(weber, force.floor_n, radians(direction))
        case LevelCrossingSettings(direction_deg=direction, hysteresis=hysteresis):
            return LevelCrossingDeadband(weber, force.floor_n, radians(direction), hysteresis)
        case VelocityAdaptiveSettings(slope_s_m=slope, most_weber=most):
            return VelocityDeadband(weber, force.floor_n, force.reference, slope, most, system.tick_period)
        case _:
            return ForceDeadband(weber, force.floor_n, force.reference)


def measure_of(system: System) -> Callable[[Vector, Vector], float] | None:
    """How the deadband of the file measures an error; None where that is the distance, which is quicker without."""
    apart = isinstance(system.codec.force.deadband, ConeSettings | LevelCrossingSettings)
    return force_deadband(system, system.codec.force.weber).error if apart else None


def deadband_in_words(system: System) -> str:
    """The shape and what is its own, for a person."""
    match system.codec.force.deadband:
        case ConeSettings(direction_deg=direction):
            return f"cone of {direction:g} deg"
        case LevelCrossingSettings(direction_deg=direction, hysteresis=hysteresis):
            return f"level crossing, hysteresis {hysteresis:g}, direction within {direction:g} deg"
        case VelocityAdaptiveSettings(slope_s_m=slope, most_weber=most):
            return f"velocity-adaptive, k + {slope:g} s/m of the speed, at most {most:g}"
        case _:
            return "isotropic"
