"""Chooses the control scheme by the measured delay, and changes it without a jump of force.

At almost no delay there is no control, at a moderate one the time-domain passivity approach (TDPA), and at a long one
the local model (MMT). Passivity control degrades with delay and assumes nothing about the scene; a model does not
degrade but needs a scene at rest (Xu, Liu, Steinbach, "Toward QoE-driven dynamic control scheme switching for
time-delayed teleoperation systems: a dedicated case study", arXiv:1705.05613, 2017).

All schemes observe the port in every tick, so that each of them knows the energy when it becomes active. Both ends
measure the same round trip, so their choices agree after a short time. A loop without delay can be active too, at a
wall that is too stiff for the tick period: an energy debt switches to passivity control at any delay. A debt that was
made without passivity control is forgotten slowly, so that a later one can be detected.
"""

from weberlink.control.contract import LinkQuality, MasterControl, SchemeParameters, WallModel
from weberlink.control.direct import DirectMaster
from weberlink.control.mmt import MmtMaster
from weberlink.control.tdpa import TdpaMaster, TdpaSlave
from weberlink.geometry.vector import Vector, interpolate

ORDER = ("none", "tdpa", "mmt")
"""The schemes in the order of rising delay."""
NONE, TDPA, MMT = range(3)
"""Their indices in `ORDER`."""

RISING = (0.008, 0.2)
"""Delay (round trip plus jitter) above which the next scheme is chosen [s]: from none to tdpa, from tdpa to mmt."""
FALLING = (0.005, 0.15)
"""Delay below which the previous scheme is chosen again [s]: from tdpa to none, from mmt to tdpa."""
CALM = 10.0
"""Time for which passivity control stays on after an energy debt at low delay [s]."""
DWELL = 1.0
"""Time for which the delay must be beyond a threshold before the scheme changes [s]; a spike changes nothing."""
HANDOVER = 0.2
"""Time in which the displayed force fades from one scheme to the next [s]."""


class SchemeChoice:
    """The choice of a scheme by the state of the link. Starts with `TDPA`, which is passive at any delay."""

    __slots__ = ("_asked", "_beyond_for", "_calm_for", "_debt_limit", "active", "imposed")

    def __init__(self, debt_limit: float) -> None:
        """Make the choice.

        Args:
            debt_limit: energy debt without control above which the loop counts as active [J].
        """
        self._debt_limit = debt_limit
        self.imposed: int | None = None
        """Index in `ORDER` of the scheme that is used at any delay; None to choose."""
        self.reset()

    def reset(self) -> None:
        self.active = TDPA
        self._asked = 0
        self._beyond_for = 0.0
        self._calm_for = CALM

    def impose(self, scheme: str | None) -> None:
        """Use this scheme of `ORDER` at any delay; None to choose by delay again."""
        self.imposed = None if scheme is None else ORDER.index(scheme)

    def follow(self, quality: LinkQuality, tank: float, elapsed: float) -> int:
        """Update the choice; returns the index of the active scheme in `ORDER`.

        Args:
            quality: state of the link.
            tank: energy in the tank of `tdpa` [J].
            elapsed: time since the last call [s].
        """
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
        if step != self._asked:  # the dwell time starts again at a change of direction
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
    """The operator's end of all schemes, of which one is displayed."""

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
    def stiffness(self) -> float:
        return self._schemes[self._choice.active].stiffness

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

    def observe(self, position: Vector, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality) -> None:
        for scheme in self._schemes:
            scheme.observe(position, elapsed, tick, peer_credit, quality)
        before = self._choice.active
        if self._choice.follow(quality, self._tdpa.tank, elapsed) != before:
            self._leaving = before
            self._share = 0.0
        if self._choice.active != TDPA:
            self._tdpa.forgive(elapsed)
        if self._choice.active != MMT:
            self._mmt.forgive(elapsed)
        self._share = min(1.0, self._share + elapsed / HANDOVER)

    def command(self, position: Vector) -> Vector:
        return self._schemes[self._choice.active].command(position)

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
    """The teleoperator's end: passivity control acts at the robot's port while `tdpa` is active."""

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
