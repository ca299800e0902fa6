"""A bounded rate of updates: the deadband widens smoothly as a token bucket runs out.

Every update takes a token out of the bucket, and every tick puts a part of one back. Below half of the bucket the
deadband is wider by an amount that grows by the same factor with each missing token, up to `WIDEST` times the deadband
at rest when less than one token is left. So a signal that would send too often, such as the noise of a sensor above the
floor, settles where it sends at the given rate. A larger force needs no larger amount, so a contact in that noise is
still sent.

In any n ticks there are at most `per_tick * n + burst` updates, beside those that were forced: by a restart, a retuned
bank or a decoder that holds nothing. A forced update takes a token too, on credit if there is none.
"""

from dataclasses import dataclass
from math import exp, log
from typing import Self

BURST_S = 0.5  # The bucket holds the updates of this time
LEAST_BURST = 16.0  # Smallest bucket, for low rates
WIDEST = 1000.0  # What an empty bucket adds to the deadband, in deadbands at rest
_GROWTH = log(WIDEST + 1.0)


@dataclass(frozen=True, slots=True)
class UpdateRate:
    """Largest rate of the updates of a channel; ValueError for a number out of range."""

    per_tick: float  # updates per tick in the long run, > 0
    burst: float  # largest number of updates beyond that, >= 4

    def __post_init__(self) -> None:
        if not 0.0 < self.per_tick < float("inf"):
            raise ValueError(f"per_tick must be above 0 and finite, not {self.per_tick!r}")
        if not 4.0 <= self.burst < float("inf"):
            raise ValueError(f"burst must be at least 4 and finite, not {self.burst!r}")

    @classmethod
    def limited_to(cls, per_s: float, tick_period: float) -> Self:
        """The rate of so many updates per second (> 0), at a time between ticks [s]."""
        return cls(per_s * tick_period, max(BURST_S * per_s, LEAST_BURST))


class TokenBucket:
    """The tokens of one encoder; `tokens` updates may be sent now, fewer than 0 after forced ones.

    Args:
        rate: at which they come back.
        at_rest: deadband at rest, in the unit of the values, > 0.
    """

    def __init__(self, rate: UpdateRate, at_rest: float) -> None:
        self._per_tick, self._burst, self._at_rest = rate.per_tick, rate.burst, at_rest
        self._half = 0.5 * rate.burst - 1.0
        self._tick: int | None = None
        self.tokens = rate.burst

    def widened(self, tick: int, bound: float) -> float:
        """The deadband to use in a tick instead of `bound`; no tokens come back if the ticks began anew."""
        passed = tick - self._tick if self._tick is not None else 0
        self._tick = tick
        if passed > 0:
            self.tokens = min(self._burst, self.tokens + passed * self._per_tick)
        full = (self.tokens - 1.0) / self._half
        if full >= 1.0:
            return bound
        return bound + self._at_rest * (exp(_GROWTH * min(1.0, 1.0 - full)) - 1.0)

    def take(self, *, forced: bool) -> bool:
        """Take a token for an update, a forced one also on credit; returns False if there is none for it."""
        if self.tokens < 1.0 and not forced:
            return False
        self.tokens -= 1.0
        return True
