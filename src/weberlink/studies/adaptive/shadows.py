"""Shadow encoders whose record forgets otherwise than the live codec's. Knows no choice."""

from math import exp

from weberlink.codec.adaptive import MEMORY, Shadow
from weberlink.codec.predictors.contract import Candidate
from weberlink.geometry.vector import Vector


class Tuned(Shadow):
    """One of them.

    Args:
        selector: as of a `Shadow`; likewise candidate, rest and doubt.
        candidate: likewise.
        rest: likewise.
        doubt: likewise.
        memory: time constant of the record [ticks], which is scaled to what the live one counts at the same rate; None
            for no record.
    """

    __slots__ = ("_memory",)

    def __init__(
        self, selector: int, candidate: Candidate, rest: Vector | None, doubt: float, memory: float | None
    ) -> None:
        super().__init__(selector, candidate, rest, doubt)
        self._memory = memory

    def record(self, tick: int) -> float:
        sends = super().record(tick)
        return 0.0 if self._memory is None else sends * (MEMORY / self._memory)

    def _forget(self, tick: int) -> None:
        passed = max(0, tick - self._at)
        self._at = tick
        self._sends *= exp(-passed / (self._memory or MEMORY))
