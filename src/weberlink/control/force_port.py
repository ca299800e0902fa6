"""The operator's port: observer of the work of the hand, and controller of the displayed force.

An impedance-type port: positions come in, forces go out and are held for a tick. So the work of a tick is exact: the
held force times the way.
"""

from math import hypot

from weberlink.geometry.vector import ZERO, Vector

SHARE_OF_TANK = 0.1
"""At most this part of the tank may be predicted to leave in one tick."""
STEEPEST = 300.0
"""A received force may rise this fast [N/s]: a new model comes as a steep ramp and not as a blow."""
RECOVERY = 0.2
"""Time constant with which a withheld force comes back while the tank is full [s]; slower while it is emptier, or the
force would be felt as a sawtooth."""
LEAST_MASS = 0.05
"""Hand and handle are taken to be at least as light as this, until they show that they are lighter [kg]."""
LEAST_STEP = 0.1
"""A smaller change of force says nothing about the device [N]."""
FORGET = 0.02
"""Part of the estimate of how easily the device moves that is forgotten in a tick."""


class ForcePort:
    """Observer and controller of the port.

    The device is predicted to go on as it did, and to give way to a change of force as much as it lately did
    (`mobility`). Where the force would give more than `SHARE_OF_TANK` of the tank, the excess is withheld and given
    back over `RECOVERY`. A constant is subtracted, not a share: the wall keeps its stiffness and lies deeper, and the
    control does not chatter.
    """

    __slots__ = (
        "_held",
        "_lately",
        "_least_mobility",
        "_level",
        "_mobility",
        "_position",
        "_step",
        "_way",
        "_withheld",
    )

    def __init__(self, tick_period: float, level: float) -> None:
        """Make the port.

        Args:
            tick_period: [s].
            level: energy at which the tank counts as full [J].
        """
        self._level = level
        self._least_mobility = tick_period * tick_period / (2.0 * LEAST_MASS)
        self.reset()

    def reset(self) -> None:
        self._position: Vector | None = None
        self._way: Vector = ZERO
        self._held: Vector = ZERO
        self._step: Vector = ZERO
        self._mobility = self._lately = self._least_mobility
        self._withheld = 0.0

    @property
    def way(self) -> Vector:
        """From the position before the last one [m]."""
        return self._way

    @property
    def position(self) -> Vector:
        """The newest position [m]."""
        return self._position or ZERO

    @property
    def mobility(self) -> float:
        """How far the device gives way in a tick to a change of force, as far as known [m/N].

        Kept until a change of force shows it anew: a damper must not forget how light the device is. The estimate that
        the control predicts with is forgotten: one wrong sample would withhold the force for good.
        """
        return self._mobility

    def move(self, position: Vector) -> float:
        """The device is here now; returns the work of the hand on it since the last call [J]."""
        before = self._position if self._position is not None else position
        x, y, z = position[0] - before[0], position[1] - before[1], position[2] - before[2]
        held, way = self._held, self._way
        self._position = position
        work = -(held[0] * x + held[1] * y + held[2] * z)
        self._learn_mobility(x - way[0], y - way[1], z - way[2])
        self._way = (x, y, z)
        return work

    def _learn_mobility(self, x: float, y: float, z: float) -> None:
        """From a change of way [m] after a change of force."""
        step = self._step
        squared = step[0] * step[0] + step[1] * step[1] + step[2] * step[2]
        least = self._least_mobility
        self._lately += FORGET * (least - self._lately)
        if squared < LEAST_STEP * LEAST_STEP:
            return
        seen = (step[0] * x + step[1] * y + step[2] * z) / squared
        self._lately = max(seen, self._lately)
        self._mobility = max(seen, self._mobility + FORGET * (least - self._mobility))

    def passive(self, force: Vector, tank: float, elapsed: float) -> Vector:
        """The part of a force [N] that may be displayed with this much in the tank [J]."""
        length = hypot(force[0], force[1], force[2])
        if length == 0.0:
            self._withheld = 0.0
            return ZERO
        self._withheld = max(
            self._withheld * max(0.0, 1.0 - elapsed / RECOVERY * min(1.0, max(0.0, tank) / self._level)),
            length * (1.0 - self._affordable_share(force, tank)),
        )
        held = self._held
        steepest = hypot(held[0], held[1], held[2]) + STEEPEST * elapsed
        share = max(0.0, min(length - self._withheld, steepest)) / length
        return (force[0] * share, force[1] * share, force[2] * share)

    def _affordable_share(self, force: Vector, tank: float) -> float:
        """The share of a force [N] that takes no more out of the tank [J] in the next tick than it may."""
        way, held = self._way, self._held
        along = force[0] * way[0] + force[1] * way[1] + force[2] * way[2]
        rise = force[0] * (force[0] - held[0]) + force[1] * (force[1] - held[1]) + force[2] * (force[2] - held[2])
        leaves = along + self._lately * max(0.0, rise)
        return 1.0 if leaves <= 0.0 else min(1.0, max(0.0, SHARE_OF_TANK * tank / leaves))

    def hold(self, force: Vector) -> None:
        """This force is displayed until the next call of `move` [N]."""
        held, self._held = self._held, force
        self._step = (force[0] - held[0], force[1] - held[1], force[2] - held[2])
