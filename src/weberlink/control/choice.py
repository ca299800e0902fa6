"""Which scheme a link needs: by the measured round trip and its jitter, with hysteresis, and by what it does.

Knows times and energies only. Both ends measure the same round trip, so they choose alike within a moment. A loop
without delay can be active too, on a wall that is too stiff for the tick: an energy debt calls for passivity control
whatever the delay.
"""

from weberlink.control.contract import LinkQuality

NONE, TDPA, MMT = 0, 1, 2
"""In the order of `weberlink.control.table.SCHEMES`."""

RISING = (0.008, 0.2)
"""Delay (round trip and jitter) above which the next scheme is chosen [s]: from none to tdpa, from tdpa to mmt."""
FALLING = (0.005, 0.15)
"""Delay below which the one before is chosen again [s]."""
CALM = 10.0
"""How long a loop that was active stays under passivity control [s]."""
DWELL = 1.0
"""A delay must be beyond its threshold for this long, so that a spike changes nothing [s]."""


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
        """A scheme that holds whatever the link asks for; None for none."""
        self.reset()

    def reset(self) -> None:
        self.active = TDPA
        self._asked = 0
        self._beyond_for = 0.0
        self._calm_for = CALM

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
