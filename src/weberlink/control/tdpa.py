"""Time-domain passivity approach (TDPA): the link never releases more energy than it took in.

At each port a passivity observer books the work, and a passivity controller keeps the energy tank above zero: by a
smaller force at the operator's port, by a shorter step at the robot's. Delay, jitter and loss only postpone energy. No
bound on the delay is assumed, only that hand and environment are passive. Sources: Ryu, Kwon, Hannaford, "Stable
teleoperation with time-domain passivity control", IEEE Trans. Robotics and Automation 20(2), 2004; and those of
`weberlink.control.energy`.

In contact the energy goes to the side that displays the force: the slave keeps what pressing and rubbing need, the
master pushes the hand out of a wall that it felt late. While a force is withheld, the robot presses with what is felt
(`ForceMatching`); not so where only a sample is known.

A passive linear link of round trip R displays a stiffness of at most about b / (R / 2), with the damping b of the hand
(Colgate's bound with the delay). The predicted force belongs to the present position of the hand, so it is not delayed,
and only energy limits it: what the hand has put in must pay for pushing it out. To push a hand of stiffness k out by x
takes about k x^2 / 2.

The operator feels it if a tank cannot pay: drag while the tanks fill for the first time, a wall that pushes the hand
out slowly, and stickiness when the hand turns back. A robot that cannot pay for friction lifts.
"""

from math import dist, hypot
from typing import ClassVar

from weberlink.control.contract import LEAST_CONTACT, LinkQuality, SchemeParameters, WallModel
from weberlink.control.energy import CreditPrediction, EnergyTank, GripGrant, LevelDrag
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
KEPT_IN_CONTACT = 0.1
"""Share of its level that the slave's tank keeps in contact, beside as much as the contact took so far: pressing took
what it gives back, and rubbing goes on. With the rest the master pushes the hand out."""
PREDICTED = 0.004
"""Largest predicted credit, as a share of the level."""
FIRST_DEBT = 0.004
"""Largest debt that a first contact may make, as a share of the level."""
FASTEST = 1.0
"""Largest speed of the operator's motion that the robot follows at once [m/s]; a faster one is a jump of the signal."""


def book_hand(tank: EnergyTank, work: float, level: float, credit: int, elapsed: float, *, in_contact: bool) -> None:
    """Book the work of the hand in a tick on the master's tank, and hand over what the robot needs.

    Args:
        tank: of the master.
        work: of the hand on the device [J].
        level: energy at which the tank counts as full [J].
        credit: of the other side so far, in units of `CREDIT_STEP`.
        elapsed: duration of the tick [s].
        in_contact: whether the robot touches something.
    """
    tank.level += work
    if work > 0.0:  # the work of the hand goes to the robot, except for what this tank lacks
        tank.hand_over(min(work, tank.level - level))
    tank.receive(credit)
    if not in_contact:
        tank.hand_over(min(tank.level, level) * min(1.0, elapsed / LEAK))
    tank.spill(CAP * level)


def book_robot(tank: EnergyTank, work: float, level: float, taken: float | None, elapsed: float) -> None:
    """Book the work of the robot in a tick on the slave's tank, and hand over what it does not need.

    Args:
        tank: of the slave.
        work: on the environment [J].
        level: energy at which the tank counts as full [J].
        taken: by the present contact so far, on this tank's account [J]; None without a contact.
        elapsed: duration of the tick [s].
    """
    tank.level -= work
    tank.hand_over(tank.level - level)
    if taken is not None:
        tank.hand_over((tank.level - (KEPT_IN_CONTACT * level + taken)) * min(1.0, elapsed / LEAK))


class CatchUp:
    """Where the operator's motion leads a robot that has fallen behind.

    Args:
        speed: at which it reduces its distance, added to the operator's own motion [m/s].
    """

    __slots__ = ("_speed", "_target")

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._target: Vector | None = None

    def reset(self) -> None:
        self._target = None

    def goal(self, target: Vector, here: Vector, elapsed: float, *, waits: bool = False) -> Vector:
        """Where the target's own motion leads from `here`, and from there the catch-up motion towards it [m].

        Args:
            target: decoded position of the operator [m].
            here: last commanded position [m].
            elapsed: time since the last call [s].
            waits: whether to follow the motion without catching up.
        """
        before, self._target = self._target, target
        if before is None:
            before = target
        moved = dist(target, before)
        share = min(1.0, FASTEST * elapsed / moved) if moved > 0.0 else 0.0
        start = (
            here[0] + share * (target[0] - before[0]),
            here[1] + share * (target[1] - before[1]),
            here[2] + share * (target[2] - before[2]),
        )
        way, drift = 0.0 if waits else self._speed * elapsed, dist(start, target)
        return target if drift <= way else interpolate(start, target, way / drift)


class _TankedPort:
    """One end of the scheme: a port with an energy tank."""

    __slots__ = ("_tank",)

    active: ClassVar[str] = "tdpa"

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

    __slots__ = ("_drag", "_elapsed", "_grant", "_in_contact", "_level", "_matching", "_port", "_tick")

    def __init__(self, settings: SchemeParameters) -> None:
        super().__init__()
        self._level = SHARE_AT_MASTER * settings.level
        self._drag = LevelDrag(settings.damping, self._level, settings.free_force)
        self._port = ForcePort(settings.tick_period, self._level)
        self._matching = ForceMatching(settings.coupling)
        self._grant = GripGrant()
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
        self._grant.reset()
        self._matching.reset()
        self._in_contact = False

    def grip(self, stored: float, share: float) -> None:
        self._tank.level = self._grant.raised(self._tank.level, stored, share)

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None:  # noqa: ARG002
        self._matching.learn(surface)

    def refute(self) -> None: ...

    def observe(self, position: Vector, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality) -> None:  # noqa: ARG002
        work = self._port.move(position)
        book_hand(self._tank, work, self._level, peer_credit, elapsed, in_contact=self._in_contact)
        self._elapsed, self._tick = elapsed, tick

    def command(self, position: Vector) -> Vector:
        return self._matching.command(position, self._tick)

    def render(self, force: Vector) -> Vector:
        port = self._port
        self._in_contact = hypot(force[0], force[1], force[2]) > LEAST_CONTACT
        passive = port.passive(force, self._tank.level, self._elapsed)
        tank = self._tank.level
        return port.secured(self._drag.added(passive, port.way, self._elapsed, tank, port.mobility), tank)

    def displayed(self, force: Vector) -> None:
        self._port.hold(force)
        self._matching.displayed = force

    def stand_by(self, position: Vector, elapsed: float, tick: float, peer_credit: int) -> None:
        """As `observe` while another scheme is active: the tank stays as it is, and no energy is handed over."""
        self._port.move(position)
        self._tank.ignore(peer_credit)
        self._elapsed, self._tick = elapsed, tick

    def begin(self, energy: float) -> None:
        """Become active again, without the debt of another time, with this energy [J] at least."""
        tank = self._tank
        tank.level = max(tank.level, energy)
        tank.spill(CAP * self._level)


class TdpaSlave(_TankedPort):
    """Observer and controller of the robot's port."""

    __slots__ = ("_catch_up", "_elapsed", "_level", "_owed", "_port", "_prediction")

    def __init__(self, settings: SchemeParameters) -> None:
        super().__init__()
        self._level = settings.level
        self._catch_up = CatchUp(settings.catch_up_speed)
        self._port = MotionPort(settings.force_range, settings.coupling, FIRST_DEBT * settings.level)
        self._prediction = CreditPrediction(PREDICTED * settings.level)
        self._elapsed = 0.0
        self._owed = 0.0  # energy stored in the present contact that is on the master's account [J]

    def reset(self) -> None:
        self._port.renew()
        self._owed = 0.0
        self._tank.reset()
        self._prediction.reset()
        self._catch_up.reset()

    def resume(self, peer_credit: int) -> None:
        self._port.reset()
        self._tank.renounce(peer_credit)
        self._prediction.reset(peer_credit)
        self._catch_up.reset()
        self._owed = 0.0

    def begin(self) -> None:
        """Become active with the energy that was left, without a debt.

        What the present contact stores was paid by the hand, so it is on the account of the master's tank. It is not
        gained here when the contact returns it.
        """
        self._tank.level = max(0.0, self._tank.level)
        self._owed = self._port.taken

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> Vector:  # noqa: ARG002
        self._elapsed = elapsed
        self._tank.receive(peer_credit)
        ahead = self._prediction.ahead(peer_credit, elapsed)
        energy = self._tank.level + ahead
        # To catch up is to press, which costs; without energy the robot would be stuck by what it cannot pay.
        is_empty = energy <= 0.0 and self._port.touches
        goal = self._catch_up.goal(target, here, elapsed, waits=is_empty)
        return self._port.affordable(goal, here, energy)

    def follow_freely(self, target: Vector, here: Vector, elapsed: float, peer_credit: int) -> Vector:
        """As `follow`, without a limit by energy, while another scheme is active."""
        self._tank.ignore(peer_credit)
        self._prediction.reset(peer_credit)
        return self._catch_up.goal(target, here, elapsed)

    def observe(self, position: Vector, force: Vector) -> None:
        work = self._port.book(position, force)
        if self._owed > 0.0:
            returned = min(self._owed, max(0.0, -work))
            self._owed = min(self._owed - returned, self._port.taken)
            work += returned
        taken = max(0.0, self._port.taken - self._owed) if self._port.touches else None
        book_robot(self._tank, work, self._level, taken, self._elapsed)

    def stand_by(self, position: Vector, force: Vector) -> None:
        """As `observe` while another scheme is active: the tank stays as it is."""
        self._port.book(position, force)
