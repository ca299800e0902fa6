"""Which scheme a link needs: by the measured round trip and its jitter, with hysteresis.

Knows names and times only. Both ends measure the same round trip, so they choose alike within a moment; no scheme of
one end needs a particular scheme at the other to be passive.
"""

from control.contract import LinkQuality

NONE, TDPA, MMT = 0, 1, 2
"""In the order of `control.table.SCHEMES`."""

RISING = (0.008, 0.2)
"""Delay (round trip and jitter) above which the next scheme is chosen [s]: from none to tdpa, from tdpa to mmt."""
FALLING = (0.005, 0.15)
"""Delay below which the one before is chosen again [s]."""
DWELL = 1.0
"""A delay must be beyond its threshold for this long, so that a spike changes nothing [s]."""


class SchemeChoice:
    """The scheme that the link asks for. Starts with `TDPA`, which is passive whatever the delay turns out to be."""

    __slots__ = ("_asked", "_beyond_for", "active")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.active = TDPA
        self._asked = 0
        self._beyond_for = 0.0

    def follow(self, quality: LinkQuality, elapsed: float) -> int:
        """The scheme after `elapsed` [s] more of a link of this quality."""
        if quality.rtt is None:
            return self.active
        delay = quality.rtt + quality.jitter
        step = 0
        if self.active < MMT and delay > RISING[self.active]:
            step = 1
        elif self.active > NONE and delay < FALLING[self.active - 1]:
            step = -1
        if step != self._asked:  # time beyond one threshold is none beyond the other
            self._asked, self._beyond_for = step, 0.0
        if step:
            self._beyond_for += elapsed
        if self._beyond_for >= DWELL:
            self.active += step
            self._beyond_for = 0.0
        return self.active
