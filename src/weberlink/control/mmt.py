"""Model-mediated teleoperation: the operator feels a local model of the scene instead of the delayed force.

The geometry that the codec fits (plane, sphere) is rendered at the device's own position without delay; updates
correct the model. Sources: Mitra, Niemeyer, "Model-mediated telemanipulation", Int. J. Robotics Research 27(2),
2008; with geometry from a perceptual codec, Xu, Cizmeci, Al-Nuaimi, Steinbach, "Point cloud-based model-mediated
teleoperation with dynamic and perception-based model updating", IEEE Trans. Instrumentation and Measurement 63(11),
2014.

It assumes a passive scene at rest that is a plane or a sphere at the point of contact; changes of the scene are felt a
round trip later. If there is no model (the first sample of a contact, a fit outside its limits, a force field), the
newest received force is held. The passivity controller of `ForcePort` also limits the energy that sampling and changes
of the model could create.
"""

from math import dist, hypot

from weberlink.control.contract import LinkQuality, SchemeParameters, WallModel
from weberlink.control.energy import EnergyTank, LevelDrag
from weberlink.control.force_port import ForcePort
from weberlink.control.matching import ForceMatching
from weberlink.control.model import SurfaceMixture
from weberlink.geometry.vector import ZERO, Vector, interpolate

TURN = 0.05
"""Time in which a new model replaces the old one, if energy allows it [s]."""
MISFIT = 0.2
"""Largest difference of two forces of the same model, as a share of the larger one."""
MISFIT_FLOOR = 0.05
"""Difference that is always accepted [N]."""
CAP = 3.0
"""Largest energy of the tank in addition to the energy stored in the model, as a multiple of the level."""


class MmtMaster:
    """Renders the model. The tank holds the energy stored in the model and the energy for changes of the model."""

    __slots__ = (
        "_drag",
        "_elapsed",
        "_fallback",
        "_held",
        "_level",
        "_matching",
        "_mixture",
        "_port",
        "_tank",
        "_tick",
    )

    active = "mmt"
    credit = 0

    def __init__(self, settings: SchemeParameters) -> None:
        self._level = settings.level
        self._drag = LevelDrag(settings.damping, self._level)
        self._port = ForcePort(settings.tick_period, self._level)
        self._tank = EnergyTank()
        self._mixture = SurfaceMixture()
        self._fallback: Vector = ZERO
        self._held: Vector = ZERO
        self._matching = ForceMatching(settings.coupling)
        self._elapsed = 0.0
        self._tick = 0.0

    @property
    def stiffness(self) -> float:
        return self._matching.stiffness

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
        self._matching.reset()
        self._mixture.reset()
        self._fallback = self._held = ZERO

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None:
        self._matching.learn(surface)
        if surface is not None:
            self._mixture.want(surface, self._port.position)
            self._fallback = ZERO
            return
        wanted = self._mixture.wanted
        if wanted is not None and agree(wanted.at(0.0, position), force):
            return  # the sample agrees with the model: free space in front of the wall, or a point on it
        self._mixture.want(None, self._port.position)
        self._fallback = force

    def observe(self, position: Vector, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality) -> None:  # noqa: ARG002
        tank, mixture = self._tank, self._mixture
        tank.level += self._port.move(position)
        _, stored = mixture.at(position)
        share = min(1.0, elapsed / TURN)
        mixture.turn(share, position, elapsed, tank.level - stored)
        self._held = interpolate(self._held, self._fallback, share)
        tank.spill(stored + CAP * self._level)
        self._elapsed, self._tick = elapsed, tick

    def command(self, position: Vector) -> Vector:
        return self._matching.command(position, self._tick)

    def render(self, force: Vector) -> Vector:  # noqa: ARG002
        port, tank = self._port, self._tank
        modelled, stored = self._mixture.at(port.position)
        held = self._held
        wanted = (modelled[0] + held[0], modelled[1] + held[1], modelled[2] + held[2])
        passive = port.passive(wanted, tank.level, self._elapsed)
        return self._drag.added(passive, port.way, self._elapsed, tank.level - stored, port.mobility)

    def displayed(self, force: Vector) -> None:
        self._port.hold(force)
        self._matching.displayed = force

    def forgive(self, elapsed: float) -> None:
        """Forget a debt slowly while another scheme is active; `elapsed` since the last call [s]."""
        self._tank.forgive(elapsed)


def agree(a: Vector, b: Vector) -> bool:
    """Whether two forces [N] may be of the same model."""
    return dist(a, b) <= max(MISFIT * max(hypot(*a), hypot(*b)), MISFIT_FLOOR)
