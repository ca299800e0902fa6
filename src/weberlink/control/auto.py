"""The scheme that the measured delay asks for, changed without a jump.

Without delay nothing is controlled, with some the time-domain passivity approach is at work, and with a long one the
local model: passivity control degrades with delay and needs no assumption on the scene, a model does not degrade and
needs a scene at rest (Xu, Liu, Steinbach, "Toward QoE-driven dynamic control scheme switching for time-delayed
teleoperation systems: a dedicated case study", arXiv:1705.05613, 2017). Where the change happens is in
`weberlink.control.choice`.

All schemes observe the port all the time, so that the one that takes over knows what was done; the force goes over
from one to the other within `HANDOVER`, which is the lag of a change. What is owed without passivity control is
forgotten slowly, so that a loop which is active all the same shows, and is taken under control.
"""

from weberlink.control.choice import MMT, TDPA, SchemeChoice
from weberlink.control.contract import LinkQuality, MasterControl, Settings, Surface, Vector
from weberlink.control.direct import DirectMaster
from weberlink.control.mmt import MmtMaster
from weberlink.control.tdpa import TdpaMaster, TdpaSlave

HANDOVER = 0.2
"""Time in which the displayed force goes over from one scheme to the next [s]."""


class AutoMaster:
    """The operator's side of all schemes, of which one is displayed."""

    __slots__ = ("_choice", "_leaving", "_mmt", "_schemes", "_share", "_tdpa")

    def __init__(self, settings: Settings) -> None:
        self._tdpa, self._mmt = TdpaMaster(settings), MmtMaster(settings)
        self._schemes: tuple[MasterControl, ...] = (DirectMaster(settings), self._tdpa, self._mmt)
        self._choice = SchemeChoice(settings.level)
        self._leaving = self._choice.active
        self._share = 1.0

    @property
    def active(self) -> int:
        return self._choice.active

    @property
    def tank(self) -> float:
        return self._schemes[self.active].tank

    @property
    def credit(self) -> int:
        return self._tdpa.credit

    def impose(self, scheme: int | None) -> None:
        """Hold one scheme from now on, whatever the delay; None to choose by the delay again."""
        self._choice.imposed = scheme

    def reset(self) -> None:
        for scheme in self._schemes:
            scheme.reset()
        self._choice.reset()
        self._leaving = self._choice.active
        self._share = 1.0

    def resume(self, peer_credit: int) -> None:
        for scheme in self._schemes:
            scheme.resume(peer_credit)

    def learn(self, surface: Surface | None, force: Vector, position: Vector) -> None:
        for scheme in self._schemes:
            scheme.learn(surface, force, position)

    def observe(self, position: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> None:
        for scheme in self._schemes:
            scheme.observe(position, elapsed, peer_credit, quality)
        before = self._choice.active
        if self._choice.follow(quality, self._tdpa.tank, elapsed) != before:
            self._leaving = before
            self._share = 0.0
        if self.active != TDPA:
            self._tdpa.forgive(elapsed)
        if self.active != MMT:
            self._mmt.forgive(elapsed)
        self._share = min(1.0, self._share + elapsed / HANDOVER)

    def render(self, force: Vector) -> Vector:
        wanted = self._schemes[self.active].render(force)
        share = self._share
        if share == 1.0:
            return wanted
        left = self._schemes[self._leaving].render(force)
        return (
            left[0] + share * (wanted[0] - left[0]),
            left[1] + share * (wanted[1] - left[1]),
            left[2] + share * (wanted[2] - left[2]),
        )

    def displayed(self, force: Vector) -> None:
        for scheme in self._schemes:
            scheme.displayed(force)


class AutoSlave:
    """The teleoperator's side: the robot's port is controlled while the operator's is."""

    __slots__ = ("_choice", "_tdpa")

    def __init__(self, settings: Settings) -> None:
        self._tdpa = TdpaSlave(settings)
        self._choice = SchemeChoice(settings.level)

    @property
    def active(self) -> int:
        return self._choice.active

    @property
    def tank(self) -> float:
        return self._tdpa.tank

    @property
    def credit(self) -> int:
        return self._tdpa.credit

    def impose(self, scheme: int | None) -> None:
        """Hold one scheme from now on, whatever the delay; None to choose by the delay again."""
        self._choice.imposed = scheme

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
