"""Shadow encoders whose record forgets otherwise than the live codec's. Knows no choice."""

from math import exp
from typing import NamedTuple

from codec.adaptive.candidate import Candidate
from codec.adaptive.shadow import LONG, SHORT, Shadow
from codec.vector import Vector


class Tuning(NamedTuple):
    """Time constants of the record [ticks]; None for none."""

    short: float | None
    long: float | None


class Tuned(Shadow):
    """One of them."""

    __slots__ = ("_tuning",)

    def __init__(self, selector: int, candidate: Candidate, rest: Vector | None, doubt: float, tuning: Tuning) -> None:
        super().__init__(selector, candidate, rest, doubt)
        self._tuning = tuning

    def record(self, tick: int) -> float:
        short, long = self._tuning
        self._forget(tick)
        recent = self._short if short is not None else 0.0
        return recent + (self._long * ((short or SHORT) / long) if long is not None else 0.0)

    def _forget(self, tick: int) -> None:
        short, long = self._tuning
        passed = max(0, tick - self._at)
        self._at = tick
        self._short *= exp(-passed / (short or SHORT))
        self._long *= exp(-passed / (long or LONG))
