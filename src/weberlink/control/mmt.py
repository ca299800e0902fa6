"""Model-mediated teleoperation: the operator feels a local model of the scene instead of the delayed force.

The surface that the codec fits (plane, sphere, or patch with friction and motion) is rendered at the device's own
position without delay; updates correct the model. Sources: Mitra, Niemeyer, "Model-mediated telemanipulation", Int. J.
Robotics Research 27(2), 2008; with geometry from a perceptual codec, Xu, Cizmeci, Al-Nuaimi, Steinbach, "Point
cloud-based model-mediated teleoperation with dynamic and perception-based model updating", IEEE Trans. Instrumentation
and Measurement 63(11), 2014.

A surface that moves is displayed where it is now on the other side, and the command leads it by the trip. Unforeseen
changes of the scene are felt a round trip later. A sample without a surface (the first one of a contact, a fit outside
its limits) is taken as a wall as stiff as the robot's coupling, the stiffest that the robot can feel.

The passivity controller of `ForcePort` limits the energy that sampling and changes of the model could create. A motor
of the scene supplies the work of a surface that moves: the displayed force times the displacement. The tank gains it
when a sample finds the surface where the model had moved it to, and what of the way is wrong is not gained. Until then
the work comes from the tank.
"""

from math import dist, hypot, inf
from typing import ClassVar

from weberlink.control.contract import LEAST_CONTACT, LinkQuality, SchemeParameters, WallModel
from weberlink.control.energy import EnergyTank, GripGrant, LevelDrag
from weberlink.control.extent import KnownSurface
from weberlink.control.force_port import ForcePort
from weberlink.control.matching import matched
from weberlink.control.model import SpringWall, SurfaceMixture
from weberlink.geometry.vector import ZERO, Vector, add, norm, scale, subtract

LEAD_TIME = 1.0
"""Time constant with which the trip to the other side follows the measured round trip [s]."""
MISFIT = 0.2
"""Largest difference of two forces of the same model, as a share of the larger one."""
MISFIT_FLOOR = 0.05
"""Difference that is always accepted [N]."""
UNTOUCHED_TIME = 0.05
"""Time beyond the round trip after which a displayed surface that the robot does not touch is gone [s]."""
UNTOUCHED_DEPTH = 5e-4
"""Depth of the displayed force in the surface from which the robot must touch it too [m]."""
FARTHEST = 0.02
"""Largest distance of the command from the device [m]: a fit that is much too soft would send the robot farther away
than any contact is deep, and the samples from there would not correct it."""
LONGEST_DRIFT = 0.1
"""Longest way for which a surface may be extrapolated from its newest sample [m]. A wrong motion would carry it on
without bound, and with it the work that a motor of the scene is assumed to do."""
CAP = 3.0
"""Largest energy of the tank in addition to the energy stored in the model, as a multiple of the level."""


class MmtMaster:
    """Renders the model. The tank holds the energy stored in the model and the energy for changes of the model."""

    __slots__ = (
        "_coupling",
        "_displayed",
        "_drag",
        "_elapsed",
        "_free",
        "_gained",
        "_grant",
        "_known",
        "_lead",
        "_level",
        "_mixture",
        "_port",
        "_tank",
        "_tick",
        "_tick_period",
        "_unconfirmed",
        "_untouched",
        "_wanted",
    )

    active: ClassVar[str] = "mmt"
    credit: ClassVar[int] = 0

    def __init__(self, settings: SchemeParameters) -> None:
        self._level = settings.level
        self._coupling = settings.coupling
        self._tick_period = settings.tick_period
        self._drag = LevelDrag(settings.damping, self._level, settings.free_force)
        self._port = ForcePort(settings.tick_period, self._level, inf)
        self._tank = EnergyTank()
        self._mixture = SurfaceMixture(settings.force_range)
        self._grant = GripGrant()
        self._elapsed = self._tick = self._lead = 0.0
        self._forget()

    @property
    def stiffness(self) -> float:
        newest = self._mixture.newest
        return self._coupling if newest is None else newest.surface.stiffness

    @property
    def tank(self) -> float:
        return self._tank.level

    def reset(self) -> None:
        self._tank.reset()
        self._forget()

    def resume(self, peer_credit: int) -> None:
        self._tank.renounce(peer_credit)
        self._forget()

    def _forget(self) -> None:
        self._port.reset()
        self._grant.reset()
        self._mixture.reset()
        self._known: KnownSurface | None = None
        self._free = True
        self._untouched = 0.0
        self._wanted: Vector = ZERO
        self._displayed: Vector = ZERO
        self._unconfirmed = self._gained = 0.0

    def grip(self, stored: float, share: float) -> None:
        self._tank.level = self._grant.raised(self._tank.level, stored, share)

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None:
        self._confirm(force, position)
        known, mixture = self._known, self._mixture
        touches = hypot(force[0], force[1], force[2]) > LEAST_CONTACT
        self._free = surface is None and not touches
        if surface is None:
            if known is None:
                stated = ZERO
            else:
                stated = known.surface.at(self._tick, position)
                within = known.has(position)
                if agree(stated if within else ZERO, force):
                    return  # free space in front of the wall or beyond an edge, or a point on the wall
                if touches and agree(stated, force):
                    known.reach(position)
                    return
                if not touches and known.end(position, stated):
                    return
            if not touches:
                self._lose()
                return
            surface, known = SpringWall(position, force, self._coupling), None
        if known is None:
            known = self._known = KnownSurface(surface, position)
        else:
            known.renew(surface, position)
        mixture.want(surface if known.covers else None)

    def _confirm(self, force: Vector, position: Vector) -> None:
        """Gain the work of the modelled motion, as far as a sample finds the surface where the motion has led it.

        A sample that finds it farther back takes from what was gained before: what is taken for motion may be the
        damping of a wall, which comes and goes with the motion of the hand.
        """
        gained, self._unconfirmed = self._unconfirmed, 0.0
        length = hypot(force[0], force[1], force[2])
        if gained == self._gained == 0.0 or self._known is None or length <= LEAST_CONTACT:
            return
        surface = self._known.surface
        stated = norm(surface.at(self._tick, position))
        beyond = max(0.0, stated - length) / surface.stiffness
        self._gain(gained - stated * beyond)

    def _gain(self, work: float) -> None:
        """Gain this work of a motion, or give back of what was gained [J]."""
        work = max(work, -self._gained)
        self._gained += work
        self._tank.level += work

    def _keep_within(self, position: Vector) -> None:
        """Display the known surface while the hand [m] is within its edges."""
        known = self._known
        if known is not None:
            before = known.covers
            known.follow(position)
            if known.covers != before:
                self._mixture.want(known.surface if known.covers else None)

    def observe(self, position: Vector, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality) -> None:  # noqa: ARG002
        tank, mixture = self._tank, self._mixture
        if quality.rtt is not None:
            self._lead += (0.5 * quality.rtt - self._lead) * min(1.0, elapsed / LEAD_TIME)
        self._elapsed, self._tick = elapsed, tick
        tank.level += self._port.move(position)
        work = self._displayed_share() * mixture.follow(self._present, position)
        if work > 0.0:
            self._unconfirmed += work
        else:
            tank.level += work
            self._gained = max(0.0, self._gained + work)
        self._keep_within(position)
        self._drop_unconfirmed()
        mixture.turn(elapsed, tank.level - mixture.stored)
        tank.spill(mixture.stored + CAP * self._level)

    def _drop_unconfirmed(self) -> None:
        """Lose a surface that is extrapolated too far, or displayed while the other side expects no force.

        After a sample without force the sender is silent until something touches the robot.
        """
        newest = self._mixture.newest
        if newest is not None and norm(newest.surface.displacement(self._present)) > LONGEST_DRIFT:
            self._lose()
            return
        if newest is None or not self._free or hypot(*self._displayed) < UNTOUCHED_DEPTH * newest.surface.stiffness:
            self._untouched = 0.0
            return
        self._untouched += self._elapsed
        if self._untouched > 2.0 * self._lead + UNTOUCHED_TIME:
            self._lose()

    def refute(self) -> None:
        self._lose()

    def _lose(self) -> None:
        self._known = None
        self._unconfirmed = 0.0
        self._mixture.want(None)

    @property
    def _present(self) -> float:
        """The present tick of the other side, at which the model is displayed."""
        return self._tick + self._lead / self._tick_period

    def _displayed_share(self) -> float:
        """The share of the force of the model that was displayed, 0 to 1."""
        wanted, displayed = self._wanted, self._displayed
        squared = wanted[0] * wanted[0] + wanted[1] * wanted[1] + wanted[2] * wanted[2]
        if squared == 0.0:
            return 0.0
        along = displayed[0] * wanted[0] + displayed[1] * wanted[1] + displayed[2] * wanted[2]
        return min(1.0, max(0.0, along / squared))

    def command(self, position: Vector) -> Vector:
        offset = self._offset(position)
        length = norm(offset)
        return add(position, offset if length <= FARTHEST else scale(offset, FARTHEST / length))

    def _offset(self, position: Vector) -> Vector:
        """From the device to where the robot should be: the model states the displayed force there, a trip later."""
        newest = self._mixture.newest
        if newest is None:
            return ZERO
        surface, present = newest.surface, self._present
        x, y, z = subtract(matched(position, newest.force, surface.stiffness, self._displayed, newest.force), position)
        # The command arrives a trip later. By then a surface that moves has carried the contact along.
        a, b, c = surface.displacement(present)
        u, v, w = surface.displacement(present + self._lead / self._tick_period)
        return (x + u - a, y + v - b, z + w - c)

    def render(self, force: Vector) -> Vector:  # noqa: ARG002
        port, tank, mixture = self._port, self._tank, self._mixture
        self._wanted = wanted = mixture.force
        passive = port.passive(wanted, tank.level, self._elapsed)
        dragged = self._drag.added(passive, port.way, self._elapsed, tank.level - mixture.stored, port.mobility)
        return port.secured(dragged, tank.level)

    def displayed(self, force: Vector) -> None:
        self._port.hold(force)
        self._displayed = force

    def forgive(self) -> None:
        """Forget a debt: another scheme keeps its own account."""
        self._tank.forgive()


def agree(a: Vector, b: Vector) -> bool:
    """Whether two forces [N] may be of the same model."""
    return dist(a, b) <= max(MISFIT * max(hypot(*a), hypot(*b)), MISFIT_FLOOR)
