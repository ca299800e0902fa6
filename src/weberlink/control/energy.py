"""Energy tanks, the prediction of energy under way, and the drag that fills an empty tank.

Each side has a tank of energy that its port may spend. A datagram carries the total energy handed over since the
session began, so a lost datagram delays energy and never creates or destroys any. While neither tank is negative, the
link has released no more energy than it took in. Sources:

- Franken, Stramigioli, Misra, Secchi, Macchelli, "Bilateral telemanipulation with time delays: a two-layer approach
  combining passivity and transparency", IEEE Trans. Robotics 27(4), 2011: tanks, and the damper that fills them.
- Artigas, Ryu, Preusche, Hirzinger, "Network representation and passivity of delayed teleoperation systems", IROS
  2011: the passivity approach over a network.
- Xu, Cizmeci, Schuwerk, Steinbach, "Energy prediction for teleoperation systems that combine the time domain passivity
  approach with perceptual deadband-based haptic data reduction", IEEE Trans. Haptics 9(4), 2016: prediction between
  two updates.
"""

from math import inf, sqrt

from weberlink.control.contract import CREDIT_STEP, FREE_FORCE
from weberlink.geometry.vector import Vector

LONGEST = 0.05
"""No energy is predicted later than this after the last increase of the credit [s]. At the default silence limit
`HeartbeatSchedule` tells energy sooner."""
SMALLEST = 1e-200
"""A smaller cost that grows with the square is none [J]: its products could underflow."""
STRONGEST = FREE_FORCE
"""Largest drag force [N]."""
STABLE_SHARE = 0.5
"""Largest damping, as a share of the damping that would reverse the velocity of a light hand in one tick."""


class EnergyTank:
    """Energy of one side [J]. The `level` falls below 0 if a tick takes more energy than predicted."""

    __slots__ = ("_handed", "_received", "level")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.level = 0.0
        self._handed = 0.0
        self._received = 0

    @property
    def credit(self) -> int:
        """Energy handed over since the session began, in whole units of `CREDIT_STEP`."""
        return int(self._handed / CREDIT_STEP)

    def receive(self, credit: int) -> None:
        """Take in the credit of the other side since the session began, in units of `CREDIT_STEP`."""
        if credit > self._received:
            self.level += (credit - self._received) * CREDIT_STEP
            self._received = credit

    def ignore(self, credit: int) -> None:
        """Take in the credit of the other side without its energy."""
        self._received = max(self._received, credit)

    def renounce(self, credit: int) -> None:
        """Give up the level and all credit of the other side so far; a debt stays."""
        self.receive(credit)
        self.spill(0.0)

    def hand_over(self, energy: float) -> None:
        """Hand energy [J] to the other side; nothing if it is negative."""
        if energy > 0.0:
            self.level -= energy
            self._handed += energy

    def spill(self, cap: float) -> None:
        """Give up the energy above the cap [J]: an unbounded store would hide an active loop until it is empty."""
        self.level = min(self.level, cap)

    def forgive(self) -> None:
        """Forget a debt."""
        self.level = max(0.0, self.level)


class GripGrant:
    """Pays for the contact in which the operator takes the handle.

    The robot moves into the contact by its own power then, and the hand that is pushed out has not pressed before. So
    while the force fades in, the account of the hand is raised to what the contact stores as displayed, as if the hand
    had pressed it in. In total that is no more than the contact stored at its largest force. A debt from before the
    grip is forgiven. So the energy for each grip is bounded. A link that returns after silence is no grip.
    """

    __slots__ = ("_granted", "_is_new", "_most")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin a new grip."""
        self._granted = self._most = 0.0
        self._is_new = True

    def raised(self, level: float, stored: float, share: float) -> float:
        """The account [J], raised as far as this grip may.

        Args:
            level: of the account [J].
            stored: energy that the contact stores [J].
            share: of its force which is displayed, 0..1.
        """
        if self._is_new:
            self._is_new = False
            level = max(0.0, level)
        self._most = max(self._most, stored)
        gift = max(0.0, min(share * stored - level, self._most - self._granted))
        self._granted += gift
        return level + gift


class CreditPrediction:
    """Extrapolates the credit of the other side at its last rate, because most ticks bring no datagram.

    Args:
        most: the largest prediction beyond the known credit, and so the largest error [J].
    """

    __slots__ = ("_age", "_credit", "_gained", "_most", "_over")

    def __init__(self, most: float) -> None:
        self._most = most
        self.reset()

    def reset(self, credit: int = 0) -> None:
        """Start again at a known credit, in units of `CREDIT_STEP`."""
        self._credit = credit
        self._age = 0.0
        self._gained = 0.0
        self._over = 0.0

    def ahead(self, credit: int, elapsed: float) -> float:
        """The predicted energy beyond the known credit [J].

        Args:
            credit: the credit known now, in units of `CREDIT_STEP`.
            elapsed: time since the last call [s].
        """
        self._age += elapsed
        if credit > self._credit:
            self._gained, self._over = (credit - self._credit) * CREDIT_STEP, self._age
            self._credit = credit
            self._age = 0.0
            return 0.0
        if self._age > LONGEST or self._over == 0.0:
            return 0.0
        # The division comes last: the rate between two credits at almost the same time would be infinite or NaN.
        return min(self._gained * self._age / self._over, self._most)


class LevelDrag:
    """A damper -b v with b = damping * (1 - tank / level); b = 0 above the level.

    Args:
        damping: with an empty tank [N s/m].
        level: energy at which the tank counts as full [J].
        strongest: largest drag force [N].
    """

    __slots__ = ("_damping", "_level", "_strongest")

    def __init__(self, damping: float, level: float, strongest: float = STRONGEST) -> None:
        self._damping = damping
        self._level = level
        self._strongest = strongest

    def added(self, force: Vector, way: Vector, elapsed: float, tank: float, mobility: float) -> Vector:
        """The force with the drag added [N].

        Args:
            force: the force without drag [N].
            way: displacement of the hand in the last tick [m].
            elapsed: duration of that tick [s].
            tank: energy in the tank [J].
            mobility: displacement of the hand in a tick per change of force [m/N].
        """
        lack = 1.0 - max(0.0, tank) / self._level
        if lack <= 0.0 or elapsed <= 0.0:
            return force
        drag = min(self._damping * lack / elapsed, STABLE_SHARE / mobility)
        squared = way[0] * way[0] + way[1] * way[1] + way[2] * way[2]
        strongest = self._strongest
        if drag * drag * squared > strongest * strongest:
            drag = strongest / squared**0.5
        return (force[0] - drag * way[0], force[1] - drag * way[1], force[2] - drag * way[2])


def root_share(linear: float, square: float, energy: float) -> float:
    """The largest s with  s linear + s^2 square <= energy, by the formula without cancellation; inf if there is none.

    Args:
        linear: cost of the whole change at the present rate [J]; negative if it pays.
        square: additional cost of the whole change, as its rate grows with the change [J], >= 0; may be infinite.
        energy: to pay with [J], >= 0.
    """
    if square == inf:
        return 0.0
    if square < SMALLEST:
        return energy / linear if linear > 0.0 else inf
    root = sqrt(linear * linear + 4.0 * square * energy)
    return 2.0 * energy / (linear + root) if linear > 0.0 else 0.5 * (root - linear) / square


def yielding_share(along: float, rise: float, before: float, most: float) -> float:
    """The largest share s of a force, 0 to 1, with  s along + s max(0, s rise - before) <= most.

    Args:
        along: work of the whole force if the device repeats its last displacement [J].
        rise: work of the whole force on the displacement that it causes by itself [J], >= 0.
        before: the same on the displacement that the present force causes [J].
        most: energy that may leave in the tick [J], >= 0.
    """
    share = min(1.0, root_share(along - before, rise, most))
    return share if share * along <= most else most / along
