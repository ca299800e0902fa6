"""Targets for a pointer device in virtual time: a path that is sampled at the rate of a pointer, with its jitter."""

from collections.abc import Callable
from random import Random

from weberlink.geometry.vector import Vector
from weberlink.testing.time import TICK
from weberlink_pointer.target_link import PointerTarget

Way = Callable[[float], tuple[Vector, bool] | None]
"""Target [m] at a time [s], and whether it is held; None where nothing is sent."""


class Targets:
    """A source that is asked once a tick, of what a visitor does; each target may come early or late by the jitter."""

    def __init__(self, path: Way, rate_hz: float = 60.0, jitter: float = 0.0) -> None:
        self._path, self._period, self._jitter = path, 1.0 / rate_hz, jitter
        self._uniform = Random(1).uniform
        self.opened = self._number = 0
        self.time = self._due = 0.0

    def open(self) -> None:
        self.opened += 1

    def close(self) -> None:
        self.opened = 0

    def newest(self) -> PointerTarget | None:
        self.time += TICK
        if self.time < self._due:
            return None
        self._due += self._period * (1.0 + self._uniform(-self._jitter, self._jitter))
        sent = self._path(self.time)
        self._number += 1
        return None if sent is None else PointerTarget(*sent, self._number)
