"""A wall, and the settings of the schemes under test."""

from dataclasses import dataclass

from weberlink.control.contract import AccountParameters, SchemeParameters
from weberlink.geometry.vector import Vector

TICK = 1e-3
ACCOUNT = AccountParameters(allowance=0.02, refill=0.01, damping=1.0, rise=80.0)  # as in a file without other settings
SETTINGS = SchemeParameters(TICK, 2500.0, ACCOUNT)  # with a coupling of 2500 N/m


@dataclass(frozen=True)
class Wall:
    """Solid below a height [m] on z."""

    stiffness: float = 500.0
    height: float = 0.0

    def at(self, tick: float, position: Vector) -> Vector:
        return (0.0, 0.0, max(0.0, self.stiffness * (self.height - position[2])))
