"""Chooses the control scheme by the measured delay, and changes it at both ends at once, without a jump of force.

At almost no delay there is no control, at a moderate one the time-domain passivity approach (TDPA), and at a long one
the local model (MMT). Passivity control degrades with delay and assumes nothing about the scene; a model does not
degrade but needs a scene at rest (Xu, Liu, Steinbach, "Toward QoE-driven dynamic control scheme switching for
time-delayed teleoperation systems: a dedicated case study", arXiv:1705.05613, 2017).

A loop without delay can be active too, at a wall that is too stiff for the tick period. So the energy that the hand
puts into each contact is observed, and a debt calls for passivity control at any delay.

The operator's end chooses: the energy of an active loop comes out at its port, because a hand damps what it is moved
by, and only there is the energy known without delay. It asks, and `weberlink.control.tuning` changes the scheme of both
ends at an agreed tick. If messages are lost, the ends differ for a while. That is safe in every combination, because
each scheme of the operator's end bounds the energy that leaves its port whatever the robot does: `tdpa` and `mmt` by
their tanks, `none` by the guard of `ContactBalance`.
"""

from math import hypot, sqrt

from weberlink.control.contract import LEAST_CONTACT, LinkQuality, MasterControl, SchemeParameters, WallModel
from weberlink.control.direct import DirectMaster
from weberlink.control.energy import GripGrant, yielding_share
from weberlink.control.force_port import ForcePort
from weberlink.control.mmt import MmtMaster
from weberlink.control.tdpa import TdpaMaster, TdpaSlave
from weberlink.geometry.vector import ZERO, Vector

ORDER = ("none", "tdpa", "mmt")
"""The schemes in the order of rising delay."""
NONE, TDPA, MMT = range(3)
"""Their indices in `ORDER`."""

RISING = (0.008, 0.08)
"""Delay (round trip plus jitter) above which the next scheme is chosen [s]: from none to tdpa, from tdpa to mmt."""
FALLING = (0.005, 0.06)
"""Delay below which the previous scheme is chosen again [s]: from tdpa to none, from mmt to tdpa."""
CALM = 10.0
"""Time for which passivity control stays on after an energy debt at low delay [s]."""
DWELL = 1.0
"""Time for which the delay must be beyond a threshold before the scheme changes [s]; a spike changes nothing."""
HANDOVER = 0.2
"""Time in which the displayed force fades from one scheme to the next [s]."""
DEBT = 0.06
"""Debt without control that calls for control, as a share of `SchemeParameters.level`: 3 mJ of the default 50 mJ."""
LARGEST_DEBT = 0.1
"""Debt without control that the guard allows, likewise: 5 mJ."""
GUARDED_SHARE = 0.3
"""Largest part of the energy left until then that the guard lets out in one tick, as predicted."""
FORGET = 0.2
"""Time constant with which a debt is forgotten between contacts [s]: longer than a hand takes to bounce back."""
SLIDING = 0.1
"""Largest error of the direction of a decoded force, as a share of the force: the usual Weber factor."""
NEGLIGIBLE = 1e-9
"""Square of the sine of an angle between force and way that is none: rounding would be taken for sliding."""
MOST_KNOWN = 3.0
"""Energy that a contact may return beyond what its known stiffness stores, as a multiple of the level."""


class SchemeChoice:
    """The scheme that the state of the link calls for."""

    __slots__ = ("_active", "_asked", "_beyond_for", "_calm_for", "_falls_back")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._active = TDPA
        self._asked = 0
        self._beyond_for = 0.0
        self._calm_for = CALM
        self._falls_back = False

    def fall_back(self) -> None:
        """Call for `TDPA`, which is passive at any delay, before anything else."""
        self._falls_back = True

    def follow(self, active: int, quality: LinkQuality, elapsed: float, *, touches: bool, in_debt: bool) -> int:
        """Take in a tick; returns the index in `ORDER` of the scheme that is called for.

        Args:
            active: index of the scheme in use.
            quality: state of the link.
            elapsed: time since the last call [s].
            touches: whether the robot touches something. Control is not given up then: the operator would feel more
                force at the same depth, and that difference is energy out of nothing.
            in_debt: whether the loop is active.
        """
        self._calm_for += elapsed
        if active != self._active:
            self._active, self._asked, self._beyond_for = active, 0, 0.0
        self._falls_back = self._falls_back and active != TDPA
        if active == NONE and in_debt:
            self._calm_for = 0.0
        if self._falls_back or (active == NONE and self._calm_for < CALM):
            return TDPA
        if quality.rtt is None:
            return active
        step = self._step(quality.rtt + quality.jitter)
        if step != self._asked:  # the dwell time starts again at a change of direction
            self._asked, self._beyond_for = step, 0.0
        self._beyond_for += elapsed
        waits = self._beyond_for < DWELL or (touches and active + step == NONE)
        return active if waits else active + step

    def _step(self, delay: float) -> int:
        active = self._active
        if active < MMT and delay > RISING[active]:
            return 1
        if active > NONE and delay < FALLING[active - 1]:
            return 0 if active == TDPA and self._calm_for < CALM else -1
        return 0


class ContactBalance:
    """Energy that the hand has put into the present contact, and the guard that limits its debt.

    A passive environment at rest returns no more in a contact than the contact took. So the balance begins at zero with
    each contact. A debt is kept in contact and forgotten between contacts, slowly: an active loop bounces and makes its
    debt in many contacts, while a tap on a sampled wall returns 1 to 2 mJ too much and the hand damps it. What the
    contact dissipates would hide an active loop, so the balance is at most what the contact stores and some more.
    If the operator takes the handle within a contact, the balance begins with what that contact stores (`GripGrant`).

    A decoded force may err by the deadband in its direction too. On a hand that slides, that error does work which is
    no sign of an active loop: an active loop moves the hand along the force. So `SLIDING` times the force times the way
    across it is given back, as long as the balance is below what the contact stores.
    """

    __slots__ = ("_debt", "_force", "_grant", "_holds_back", "_least", "_most", "_port", "level")

    def __init__(self, settings: SchemeParameters) -> None:
        self._port = ForcePort(settings.tick_period, settings.level)
        self._grant = GripGrant()
        self._most = MOST_KNOWN * settings.level
        self._debt, self._least = -DEBT * settings.level, -LARGEST_DEBT * settings.level
        self.reset()

    def reset(self) -> None:
        self._port.reset()
        self._grant.reset()
        self._force: Vector = ZERO
        self._holds_back = False
        self.level = 0.0
        """The balance [J]; negative for a debt."""

    def resume(self) -> None:
        """Begin again after an interruption, without any contact; a debt stays."""
        self._port.reset()
        self._grant.reset()
        self._force = ZERO
        self._holds_back = False
        self.level = min(self.level, 0.0)

    @property
    def in_debt(self) -> bool:
        """Whether the loop is active: the debt is too large, or the guard had to act for the present force."""
        return self.level < self._debt or self._holds_back

    @property
    def left(self) -> float:
        """Energy that the hand may still take out of the contact [J]."""
        return max(0.0, self.level - self._least)

    def book(self, position: Vector, elapsed: float, *, touches: bool, stiffness: float) -> None:
        """Book the work of the last tick.

        Args:
            position: of the device [m].
            elapsed: time since the last call [s].
            touches: whether the robot touched something in it; the guard may hold all of that force back.
            stiffness: of the contact [N/m].
        """
        x, y, z = force = self._force
        squared = x * x + y * y + z * z
        level = self.level + self._port.move(position)
        if not touches:
            level = min(level, 0.0)
            self.level = level - level * min(1.0, elapsed / FORGET)
            return
        stored = 0.5 * squared / stiffness
        if level < stored:
            level = min(stored, level + SLIDING * slid(force, squared, self._port.way))
        self.level = min(level, self._most + stored)

    def grip(self, stored: float, share: float) -> None:
        """See `MasterControl.grip`."""
        self.level = self._grant.raised(self.level, stored, share)

    def forgive(self) -> None:
        """Forget a debt: another scheme keeps its own account."""
        self.level = max(self.level, 0.0)

    def guarded(self, force: Vector) -> Vector:
        """The part of a force [N] that keeps the debt below `LARGEST_DEBT`."""
        port, held = self._port, self._force
        way = port.way
        along = force[0] * way[0] + force[1] * way[1] + force[2] * way[2]
        squared = force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
        before = force[0] * held[0] + force[1] * held[1] + force[2] * held[2]
        share = yielding_share(along, port.mobility * squared, port.mobility * before, GUARDED_SHARE * self.left)
        self._holds_back = share < 1.0
        return (force[0] * share, force[1] * share, force[2] * share) if self._holds_back else force

    def displayed(self, force: Vector) -> None:
        """Take in the force that is displayed until the next call of `book` [N]."""
        self._force = force
        self._port.hold(force)


def slid(force: Vector, squared: float, way: Vector) -> float:
    """A force [N], of this square, times the length of the way across it [J]."""
    along = force[0] * way[0] + force[1] * way[1] + force[2] * way[2]
    whole = squared * (way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    across = whole - along * along
    return sqrt(across) if across > NEGLIGIBLE * whole else 0.0


class AutoMaster:
    """The operator's end of all schemes, of which one is displayed, or several while one fades into another."""

    __slots__ = (
        "_active",
        "_balance",
        "_choice",
        "_grip_changes",
        "_mmt",
        "_schemes",
        "_shares",
        "_tdpa",
        "_touches",
        "_wanted",
    )

    def __init__(self, settings: SchemeParameters) -> None:
        self._tdpa, self._mmt = TdpaMaster(settings), MmtMaster(settings)
        self._schemes: tuple[MasterControl, ...] = (DirectMaster(settings), self._tdpa, self._mmt)
        self._choice = SchemeChoice()
        self._balance = ContactBalance(settings)
        self._begin()

    def _begin(self) -> None:
        self._active = self._wanted = TDPA
        self._shares = [0.0, 1.0, 0.0]
        self._touches = self._grip_changes = False

    @property
    def active(self) -> str:
        return ORDER[self._active]

    @property
    def wanted(self) -> str | None:
        return None if self._wanted == self._active else ORDER[self._wanted]

    @property
    def stiffness(self) -> float:
        return self._schemes[self._active].stiffness

    @property
    def tank(self) -> float:
        return self._balance.level if self._active == NONE else self._schemes[self._active].tank

    @property
    def credit(self) -> int:
        return self._tdpa.credit

    def use(self, scheme: str) -> None:
        active = ORDER.index(scheme)
        if active == TDPA != self._active:
            self._tdpa.begin(self._balance.left)
        self._active = self._wanted = active

    def fall_back(self) -> None:
        self._choice.fall_back()

    def reset(self) -> None:
        for scheme in self._schemes:
            scheme.reset()
        self._choice.reset()
        self._balance.reset()
        self._begin()

    def resume(self, peer_credit: int) -> None:
        for scheme in self._schemes:
            scheme.resume(peer_credit)
        self._balance.resume()

    def grip(self, stored: float, share: float) -> None:
        for scheme in self._schemes:
            scheme.grip(stored, share)
        self._balance.grip(stored, share)
        self._grip_changes = True

    def refute(self) -> None:
        for scheme in self._schemes:
            scheme.refute()

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None:
        for scheme in self._schemes:
            scheme.learn(surface, force, position)

    def observe(self, position: Vector, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality) -> None:
        balance, shares = self._balance, self._shares
        balance.book(position, elapsed, touches=self._touches, stiffness=self.stiffness)
        if shares[TDPA] > 0.0 or self._active == TDPA:
            self._tdpa.observe(position, elapsed, tick, peer_credit, quality)
        else:
            self._tdpa.stand_by(position, elapsed, tick, peer_credit)
        self._mmt.observe(position, elapsed, tick, peer_credit, quality)
        if shares[MMT] == 0.0:
            self._mmt.forgive()
        if shares[NONE] == 0.0:
            balance.forgive()
        self._fade(elapsed)
        # A hand that lets go is pushed out by the force of the last sample: a debt, but of no active loop.
        in_debt = balance.in_debt and not self._grip_changes
        self._grip_changes = False
        self._wanted = self._choice.follow(self._active, quality, elapsed, touches=self._touches, in_debt=in_debt)

    def _fade(self, elapsed: float) -> None:
        """Give the active scheme a larger share of the displayed force."""
        share = self._shares[self._active]
        if share < 1.0:
            larger = min(1.0, share + elapsed / HANDOVER)
            rest = (1.0 - larger) / (1.0 - share)
            self._shares = [rest * other for other in self._shares]
            self._shares[self._active] = larger

    def command(self, position: Vector) -> Vector:
        return self._schemes[self._active].command(position)

    def render(self, force: Vector) -> Vector:
        self._touches = hypot(force[0], force[1], force[2]) > LEAST_CONTACT
        if self._shares[self._active] == 1.0:
            return self._rendered(self._active, force)
        x = y = z = 0.0
        for scheme, share in enumerate(self._shares):
            if share > 0.0:
                part = self._rendered(scheme, force)
                x, y, z = x + share * part[0], y + share * part[1], z + share * part[2]
        return self._balance.guarded((x, y, z)) if self._active == NONE else (x, y, z)

    def _rendered(self, scheme: int, force: Vector) -> Vector:
        wanted = self._schemes[scheme].render(force)
        return self._balance.guarded(wanted) if scheme == NONE else wanted

    def displayed(self, force: Vector) -> None:
        for scheme in self._schemes:
            scheme.displayed(force)
        self._balance.displayed(force)


class AutoSlave:
    """The teleoperator's end: passivity control acts at the robot's port while `tdpa` is active."""

    __slots__ = ("_is_controlled", "_tdpa", "active")

    def __init__(self, settings: SchemeParameters) -> None:
        self._tdpa = TdpaSlave(settings)
        self._take(TDPA)

    def _take(self, scheme: int) -> None:
        self.active = ORDER[scheme]
        self._is_controlled = scheme == TDPA

    @property
    def tank(self) -> float:
        return self._tdpa.tank

    @property
    def credit(self) -> int:
        return self._tdpa.credit

    def use(self, scheme: str) -> None:
        if scheme == ORDER[TDPA] and not self._is_controlled:
            self._tdpa.begin()
        self._take(ORDER.index(scheme))

    def reset(self) -> None:
        self._tdpa.reset()
        self._take(TDPA)

    def resume(self, peer_credit: int) -> None:
        self._tdpa.resume(peer_credit)

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> Vector:
        if self._is_controlled:
            return self._tdpa.follow(target, here, elapsed, peer_credit, quality)
        return self._tdpa.follow_freely(target, here, elapsed, peer_credit)

    def observe(self, position: Vector, force: Vector) -> None:
        if self._is_controlled:
            self._tdpa.observe(position, force)
        else:
            self._tdpa.stand_by(position, force)
