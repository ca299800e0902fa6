"""The drag that fills an empty tank: the operator pays for what the robot will spend.

The tank level controller of Franken et al. (see `control.tank`): a damper at the operator's hand, the weaker the fuller
the tank. It is felt at the beginning of a session and after energy was lost, and not otherwise.
"""

from weberlink.control.contract import Vector

STRONGEST = 1.0
"""Drag never exceeds this [N]."""
STABLE_SHARE = 0.5
"""Part of the damping at which the drag of one tick would throw a light hand back in the next."""


class LevelDrag:
    """A damper -b v with b = damping * (1 - tank / level), 0 above the level."""

    __slots__ = ("_damping", "_level")

    def __init__(self, damping: float, level: float) -> None:
        self._damping = damping
        self._level = level

    def added(self, force: Vector, way: Vector, elapsed: float, tank: float, mobility: float) -> Vector:
        """A force with the drag.

        Args:
            force: without it [N].
            way: of the hand in the last tick [m].
            elapsed: in which it went there [s].
            tank: energy that there is [J].
            mobility: how far the hand gives way in a tick to a change of force [m/N].
        """
        lack = 1.0 - max(0.0, tank) / self._level
        if lack <= 0.0 or elapsed <= 0.0:
            return force
        drag = min(self._damping * lack / elapsed, STABLE_SHARE / mobility)
        squared = way[0] * way[0] + way[1] * way[1] + way[2] * way[2]
        if drag * drag * squared > STRONGEST * STRONGEST:
            drag = STRONGEST / squared**0.5
        return (force[0] - drag * way[0], force[1] - drag * way[1], force[2] - drag * way[2])
