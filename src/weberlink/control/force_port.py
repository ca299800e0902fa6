"""The operator's port: passivity observer of the hand's work, and passivity controller of the displayed force.

The port is of impedance type: it reads positions and commands forces, which are held for a tick. So the work of a tick
is exact: the held force times the displacement.
"""

from math import hypot

from weberlink.control.energy import yielding_share
from weberlink.geometry.vector import ZERO, Vector

SHARE_OF_TANK = 0.1
"""Largest predicted loss of the tank in one tick, as a share of its energy."""
STEEPEST = 300.0
"""Largest rise of the displayed force [N/s]: a new model is felt as a steep ramp, not as a blow."""
RECOVERY = 0.2
"""Time constant with which a withheld force returns while the tank is full [s]; longer while it is emptier, because a
fast return would be felt as a sawtooth."""
LEAST_MASS = 0.05
"""Assumed mass of hand and handle [kg], until a lower one is measured."""
LEAST_STEP = 0.1
"""Smallest change of force from which the mobility is estimated [N]."""
FORGET = 0.02
"""Share of the estimated mobility that is forgotten: per tick, or per estimate."""
DEBT = 5e-4
"""Debt that the tank may have [J], so that a force against the motion can fill an empty tank."""
STAKE = 0.5
"""Largest loss in one tick if the hand turns against the force, as a share of the energy above the floor."""
LEAST_STAKE = 1e-12
"""What is left of `DEBT` at least [J]: from here a motion against the force doubles it in a few ticks."""
MEMORY = 1.0
"""Time constant with which the longest displacement in a tick is forgotten [s]."""
FASTEST = 1.0
"""Largest speed that a hand is assumed to turn to within a tick while the tank is not empty [m/s]."""


class ForcePort:
    """Observer and controller of the port.

    The prediction: the device repeats its last displacement, and a change of force moves it as much as in the recent
    past (`mobility`). If the force would then take more than `SHARE_OF_TANK` of the tank, the excess is withheld and
    returned over `RECOVERY`. A constant is subtracted, not a share: so the wall keeps its stiffness and lies deeper,
    and the control does not chatter.

    The prediction has the wrong sign where the hand is shaken faster than a quarter of the tick rate. So `secured`
    bounds the loss for both directions of motion: no tick takes more than `STAKE` of what is left above a floor, at
    first `DEBT` below zero. A motion that always turns against the force takes less and less and never reaches the
    floor; one that works against the force raises the stake as it fills the tank. A motion that suddenly is `1 / STAKE`
    times longer than all before can break the floor once, and must then earn the debt back before the next.
    """

    __slots__ = (
        "_fastest",
        "_floor",
        "_forgotten",
        "_held",
        "_lately",
        "_least_mobility",
        "_level",
        "_mobility",
        "_passed",
        "_position",
        "_reach",
        "_steepest",
        "_step",
        "_way",
        "_withheld",
    )

    def __init__(self, tick_period: float, level: float, steepest: float = STEEPEST) -> None:
        """Make the port.

        Args:
            tick_period: time between ticks [s].
            level: energy at which the tank counts as full [J].
            steepest: largest rise of what `passive` lets through [N/s].
        """
        self._steepest = steepest
        self._level = level
        self._least_mobility = tick_period * tick_period / (2.0 * LEAST_MASS)
        self._fastest = FASTEST * tick_period
        self._forgotten = tick_period / MEMORY
        self.reset()

    def reset(self) -> None:
        self._position: Vector | None = None
        self._way: Vector = ZERO
        self._held: Vector = ZERO
        self._step: Vector = ZERO
        self._mobility = self._lately = self._least_mobility
        self._withheld = self._passed = 0.0
        self._reach = 0.0
        self._floor = -DEBT

    @property
    def way(self) -> Vector:
        """Displacement in the last tick [m]."""
        return self._way

    @property
    def position(self) -> Vector:
        """The newest position [m]."""
        return self._position or ZERO

    @property
    def mobility(self) -> float:
        """Estimated displacement of the device in a tick per change of force [m/N].

        Kept until the next usable change of force: a damper must not forget how light the device is. The estimate for
        the prediction is forgotten tick by tick instead: otherwise one wrong sample would withhold the force for good.
        """
        return self._mobility

    def move(self, position: Vector) -> float:
        """Take in the position of the device [m]; returns the work of the hand on it since the last call [J]."""
        before = self._position if self._position is not None else position
        x, y, z = position[0] - before[0], position[1] - before[1], position[2] - before[2]
        held, way = self._held, self._way
        self._position = position
        work = -(held[0] * x + held[1] * y + held[2] * z)
        self._learn_mobility(x - way[0], y - way[1], z - way[2])
        self._reach = max(hypot(x, y, z), self._reach - self._forgotten * self._reach)
        self._way = (x, y, z)
        return work

    def _learn_mobility(self, x: float, y: float, z: float) -> None:
        """Estimate the mobility from the change of displacement [m] that followed a change of force."""
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
        """The part of a force [N] that may be displayed.

        Args:
            force: the whole of it [N].
            tank: energy in the tank [J].
            elapsed: time since the last call [s].
        """
        length = hypot(force[0], force[1], force[2])
        if length == 0.0:
            self._withheld = self._passed = 0.0
            return ZERO
        self._withheld = max(
            self._withheld * max(0.0, 1.0 - elapsed / RECOVERY * min(1.0, max(0.0, tank) / self._level)),
            length * (1.0 - self._affordable_share(force, SHARE_OF_TANK * tank)),
        )
        # A ramp from the force that is held would never rise against a drag that is added to it.
        self._passed = max(0.0, min(length - self._withheld, self._passed + self._steepest * elapsed))
        share = self._passed / length
        return (force[0] * share, force[1] * share, force[2] * share)

    def _affordable_share(self, force: Vector, energy: float) -> float:
        """The largest share of a force [N] that takes at most this energy [J] in the next tick."""
        way, held = self._way, self._held
        along = force[0] * way[0] + force[1] * way[1] + force[2] * way[2]
        square = force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
        now = force[0] * held[0] + force[1] * held[1] + force[2] * held[2]
        return yielding_share(along, self._lately * square, self._lately * now, max(0.0, energy))

    def secured(self, force: Vector, tank: float) -> Vector:
        """The part of a force [N] that leaves energy above the floor whichever way the hand goes.

        Args:
            force: all that is to be displayed [N].
            tank: energy in the tank [J].
        """
        if tank >= 0.0:
            self._floor = -DEBT
            reach = min(self._reach, self._fastest)
        else:
            self._floor = min(self._floor, tank - LEAST_STAKE)
            reach = self._reach
        worst = hypot(force[0], force[1], force[2]) * reach
        stake = STAKE * (tank - self._floor)
        if worst <= stake:
            return force
        share = stake / worst
        return (force[0] * share, force[1] * share, force[2] * share)

    def hold(self, force: Vector) -> None:
        """Take in the force that is displayed until the next call of `move` [N]."""
        held, self._held = self._held, force
        self._step = (force[0] - held[0], force[1] - held[1], force[2] - held[2])
