"""Time-domain passivity approach (TDPA): the link never releases more energy than it took in.

At each port a passivity observer books the work, and a passivity controller keeps the energy tank above zero: by a
smaller force at the operator's port, by a shorter step at the robot's. Delay, jitter and loss only postpone energy. No
bound on the delay is assumed, only that hand and environment are passive. Sources: Ryu, Kwon, Hannaford, "Stable
teleoperation with time-domain passivity control", IEEE Trans. Robotics and Automation 20(2), 2004; and those of
`weberlink.control.energy`.

The operator feels it if a tank cannot pay: drag while the tanks fill for the first time, a soft wall until the first
work has crossed the link, and stickiness when the hand turns back.
"""

from math import dist, hypot

from weberlink.control.contract import LEAST_CONTACT, LinkQuality, SchemeParameters, WallModel
from weberlink.control.energy import CreditPrediction, EnergyTank, LevelDrag
from weberlink.control.force_port import ForcePort
from weberlink.control.matching import ForceMatching
from weberlink.control.motion_port import MotionPort
from weberlink.geometry.vector import Vector, interpolate

SHARE_AT_MASTER = 0.3
"""Level of the master's tank as a share of the slave's."""
CAP = 10.0
"""Largest energy of the master's tank, as a multiple of its level: energy back from the wall pays for the next push."""
LEAK = 0.2
"""Time constant with which the master's tank feeds the slave's [s]; the slave returns what it does not need."""
KEPT = 0.5
"""Share of its level that the master's tank keeps in contact, because the tremor of a resting hand can take energy."""
PREDICTED = 0.004
"""Largest predicted credit, as a share of the level."""
SLIDING_DEBT = 0.004
"""Largest debt that sliding along a surface may make, as a share of the level."""


class _TankedPort:
    """One end of the scheme: a port with an energy tank."""

    __slots__ = ("_tank",)

    active = "tdpa"

    def __init__(self) -> None:
        self._tank = EnergyTank()

    @property
    def tank(self) -> float:
        return self._tank.level

    @property
    def credit(self) -> int:
        return self._tank.credit


class TdpaMaster(_TankedPort):
    """Observer and controller of the operator's port."""

    __slots__ = ("_drag", "_elapsed", "_in_contact", "_level", "_matching", "_port", "_tick")

    def __init__(self, settings: SchemeParameters) -> None:
        super().__init__()
        self._level = SHARE_AT_MASTER * settings.level
        self._drag = LevelDrag(settings.damping, self._level)
        self._port = ForcePort(settings.tick_period, self._level)
        self._matching = ForceMatching(settings.coupling)
        self._elapsed = 0.0
        self._tick = 0.0
        self._in_contact = False

    @property
    def stiffness(self) -> float:
        return self._matching.stiffness

    def reset(self) -> None:
        self._tank.reset()
        self._forget()

    def resume(self, peer_credit: int) -> None:
        self._tank.renounce(peer_credit)
        self._forget()

    def _forget(self) -> None:
        self._port.reset()
        self._matching.reset()
        self._in_contact = False

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None:  # noqa: ARG002
        self._matching.learn(surface)

    def observe(self, position: Vector, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality) -> None:  # noqa: ARG002
        work = self._port.move(position)
        tank = self._tank
        tank.level += work
        if work > 0.0:  # the work of the hand goes to the robot, except for what this tank lacks
            tank.hand_over(min(work, tank.level - self._level))
        tank.receive(peer_credit)
        kept = KEPT * self._level if self._in_contact else 0.0
        tank.hand_over((min(tank.level, self._level) - kept) * min(1.0, elapsed / LEAK))
        tank.spill(CAP * self._level)
        self._elapsed, self._tick = elapsed, tick

    def command(self, position: Vector) -> Vector:
        return self._matching.command(position, self._tick)

    def render(self, force: Vector) -> Vector:
        port = self._port
        self._in_contact = hypot(force[0], force[1], force[2]) > LEAST_CONTACT
        passive = port.passive(force, self._tank.level, self._elapsed)
        return self._drag.added(passive, port.way, self._elapsed, self._tank.level, port.mobility)

    def displayed(self, force: Vector) -> None:
        self._port.hold(force)
        self._matching.displayed = force

    def forgive(self, elapsed: float) -> None:
        """Forget a debt slowly while another scheme is active; `elapsed` since the last call [s]."""
        self._tank.forgive(elapsed)


class TdpaSlave(_TankedPort):
    """Observer and controller of the robot's port."""

    __slots__ = ("_catch_up_speed", "_level", "_port", "_prediction", "_target")

    def __init__(self, settings: SchemeParameters) -> None:
        super().__init__()
        self._level = settings.level
        self._catch_up_speed = settings.catch_up_speed
        self._port = MotionPort(settings.force_range, SLIDING_DEBT * settings.level)
        self._prediction = CreditPrediction(PREDICTED * settings.level)
        self._target: Vector | None = None

    def reset(self) -> None:
        self._port.reset()
        self._tank.reset()
        self._prediction.reset()
        self._target = None

    def resume(self, peer_credit: int) -> None:
        self._port.reset()
        self._tank.renounce(peer_credit)
        self._prediction.reset(peer_credit)
        self._target = None

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> Vector:  # noqa: ARG002
        self._tank.receive(peer_credit)
        ahead = self._prediction.ahead(peer_credit, elapsed)
        goal = self._caught_up(target, here, elapsed)
        return self._port.affordable(goal, here, self._tank.level + ahead)

    def follow_freely(self, target: Vector, here: Vector, elapsed: float, peer_credit: int) -> Vector:
        """As `follow`, without a limit by energy; a debt is forgotten slowly."""
        self._tank.receive(peer_credit)
        self._tank.forgive(elapsed)
        return self._caught_up(target, here, elapsed)

    def _caught_up(self, target: Vector, here: Vector, elapsed: float) -> Vector:
        """The target, or the point towards it at a distance of the target's own motion plus the catch-up motion [m]."""
        before, self._target = self._target, target
        way = self._catch_up_speed * elapsed + (dist(target, before) if before is not None else 0.0)
        drift = dist(here, target)
        if drift <= way:
            return target
        return interpolate(here, target, way / drift)

    def observe(self, position: Vector, force: Vector) -> None:
        tank = self._tank
        tank.level -= self._port.book(position, force)
        tank.hand_over(tank.level - self._level)
