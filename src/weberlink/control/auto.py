"""The control scheme that the measured delay asks for, changed without a jump.

Without delay nothing is controlled, with some the time-domain passivity approach (TDPA) is at work, and with a long one
the local model (MMT): passivity control degrades with delay and assumes nothing of the scene; a model does not degrade
and needs a scene at rest (Xu, Liu, Steinbach, "Toward QoE-driven dynamic control scheme switching for time-delayed
teleoperation systems: a dedicated case study", arXiv:1705.05613, 2017).

All schemes observe the port all the time, so that the one that takes over knows the energy. Both ends measure the same
round trip, so they choose alike within a moment. A loop without delay can be active too, on a wall that is too stiff
for the tick: an energy debt calls for passivity control whatever the delay. What is owed without passivity control is
forgotten slowly, so that an active loop shows.
"""

from weberlink.control.contract import LinkQuality, MasterControl, SchemeParameters, WallModel
from weberlink.control.direct import DirectMaster
from weberlink.control.mmt import MmtMaster
from weberlink.control.tdpa import TdpaMaster, TdpaSlave
from weberlink.geometry.vector import Vector, interpolate

ORDER = ("none", "tdpa", "mmt")
"""The schemes by rising delay."""
NONE, TDPA, MMT = range(3)

RISING = (0.008, 0.2)
"""Delay (round trip and jitter) above which the next scheme is chosen [s]: from none to tdpa, from tdpa to mmt."""
FALLING = (0.005, 0.15)
"""Delay below which the one before is chosen again [s]."""
CALM = 10.0
"""How long a loop that was active stays under passivity control [s]."""
DWELL = 1.0
"""A delay must be beyond its threshold for this long, so that a spike changes nothing [s]."""
HANDOVER = 0.2
"""Time in which the displayed force changes from one scheme to the next [s]."""


class SchemeChoice:
    """The scheme that the link asks for. Starts with `TDPA`, which is passive whatever the delay turns out to be."""

    __slots__ = ("_asked", "_beyond_for", "_calm_for", "_debt_limit", "active", "imposed")

    def __init__(self, debt_limit: float) -> None:
        """Make the choice.

        Args:
            debt_limit: energy that may be owed without control before the loop counts as active [J].
        """
        self._debt_limit = debt_limit
        self.imposed: int | None = None
        """A place in `ORDER` that holds whatever the link asks for; None for none."""
        self.reset()

    def reset(self) -> None:
        self.active = TDPA
        self._asked = 0
        self._beyond_for = 0.0
        self._calm_for = CALM

    def impose(self, scheme: str | None) -> None:
        self.imposed = None if scheme is None else ORDER.index(scheme)

    def follow(self, quality: LinkQuality, tank: float, elapsed: float) -> int:
        """The scheme after `elapsed` [s] more of a link of this quality, with this much in the tank [J]."""
        self._calm_for += elapsed
        if self.imposed is not None:
            self.active = self.imposed
            return self.active
        if self.active == NONE and tank < -self._debt_limit:
            self.active = TDPA
            self._calm_for = self._beyond_for = 0.0
        if quality.rtt is None:
            return self.active
        step = self._step(quality.rtt + quality.jitter)
        if step != self._asked:  # time beyond one threshold is none beyond the other
            self._asked, self._beyond_for = step, 0.0
        if step:
            self._beyond_for += elapsed
        if self._beyond_for >= DWELL:
            self.active += step
            self._beyond_for = 0.0
        return self.active

    def _step(self, delay: float) -> int:
        if self.active < MMT and delay > RISING[self.active]:
            return 1
        if self.active > NONE and delay < FALLING[self.active - 1]:
            return 0 if self.active == TDPA and self._calm_for < CALM else -1
        return 0


class AutoMaster:
    """The operator's side of all schemes, of which one is displayed."""

    __slots__ = ("_choice", "_leaving", "_mmt", "_schemes", "_share", "_tdpa")

    def __init__(self, settings: SchemeParameters) -> None:
        self._tdpa, self._mmt = TdpaMaster(settings), MmtMaster(settings)
        self._schemes: tuple[MasterControl, ...] = (DirectMaster(settings), self._tdpa, self._mmt)
        self._choice = SchemeChoice(settings.level)
        self._leaving = self._choice.active
        self._share = 1.0

    @property
    def active(self) -> str:
        return ORDER[self._choice.active]

    @property
    def tank(self) -> float:
        return self._schemes[self._choice.active].tank

    @property
    def credit(self) -> int:
        return self._tdpa.credit

    def impose(self, scheme: str | None) -> None:
        self._choice.impose(scheme)

    def reset(self) -> None:
        for scheme in self._schemes:
            scheme.reset()
        self._choice.reset()
        self._leaving = self._choice.active
        self._share = 1.0

    def resume(self, peer_credit: int) -> None:
        for scheme in self._schemes:
            scheme.resume(peer_credit)

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None:
        for scheme in self._schemes:
            scheme.learn(surface, force, position)

    def observe(self, position: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> None:
        for scheme in self._schemes:
            scheme.observe(position, elapsed, peer_credit, quality)
        before = self._choice.active
        if self._choice.follow(quality, self._tdpa.tank, elapsed) != before:
            self._leaving = before
            self._share = 0.0
        if self._choice.active != TDPA:
            self._tdpa.forgive(elapsed)
        if self._choice.active != MMT:
            self._mmt.forgive(elapsed)
        self._share = min(1.0, self._share + elapsed / HANDOVER)

    def render(self, force: Vector) -> Vector:
        wanted = self._schemes[self._choice.active].render(force)
        share = self._share
        if share == 1.0:
            return wanted
        left = self._schemes[self._leaving].render(force)
        return interpolate(left, wanted, share)

    def displayed(self, force: Vector) -> None:
        for scheme in self._schemes:
            scheme.displayed(force)


class AutoSlave:
    """The teleoperator's side: the robot's port is controlled while the operator's is."""

    __slots__ = ("_choice", "_tdpa")

    def __init__(self, settings: SchemeParameters) -> None:
        self._tdpa = TdpaSlave(settings)
        self._choice = SchemeChoice(settings.level)

    @property
    def active(self) -> str:
        return ORDER[self._choice.active]

    @property
    def tank(self) -> float:
        return self._tdpa.tank

    @property
    def credit(self) -> int:
        return self._tdpa.credit

    def impose(self, scheme: str | None) -> None:
        self._choice.impose(scheme)

    def reset(self) -> None:
        self._tdpa.reset()
        self._choice.reset()

    def resume(self, peer_credit: int) -> None:
        self._tdpa.resume(peer_credit)

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> Vector:
        if self._choice.follow(quality, self._tdpa.tank, elapsed) == TDPA:
            return self._tdpa.follow(target, here, elapsed, peer_credit, quality)
        return self._tdpa.follow_freely(target, here, elapsed, peer_credit)

    def observe(self, position: Vector, force: Vector) -> None:
        self._tdpa.observe(position, force)
