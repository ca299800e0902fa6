"""Energy between two updates: what the other side has handed over since the last word of it.

With a deadband in the loop most ticks bring no datagram, and energy that was handed over meanwhile is known only with
the next one. Holding the last sum is safe and conservative; predicting it lets the port go on (Xu, Cizmeci, Schuwerk,
Steinbach, "Energy prediction for teleoperation systems that combine the time domain passivity approach with perceptual
deadband-based haptic data reduction", IEEE Trans. Haptics 9(4), 2016). The prediction here goes on at the rate between
the last two sums and is bounded: what it can be wrong by is stated, and taken back by the next sum.
"""

from weberlink.control.contract import CREDIT_STEP

LONGEST = 0.05
"""Nothing is predicted beyond this time after the last news [s]: a heartbeat is due by then."""


class CreditPrediction:
    """Extrapolates the sum of the other side's credit.

    Args:
        most: the largest prediction ahead of what is known, and so the most that it can be wrong by [J].
    """

    __slots__ = ("_age", "_credit", "_gained", "_most", "_over")

    def __init__(self, most: float) -> None:
        self._most = most
        self.reset()

    def reset(self, credit: int = 0) -> None:
        """Begin anew at a sum, in units of `CREDIT_STEP`."""
        self._credit = credit
        self._age = 0.0
        self._gained = 0.0
        self._over = 0.0

    def ahead(self, credit: int, elapsed: float) -> float:
        """Energy beyond the sum that is known [J].

        Args:
            credit: the sum that is known now, in units of `CREDIT_STEP`.
            elapsed: since the last call [s].
        """
        self._age += elapsed
        if credit > self._credit:
            self._gained, self._over = (credit - self._credit) * CREDIT_STEP, self._age
            self._credit = credit
            self._age = 0.0
            return 0.0
        if self._age > LONGEST or self._over == 0.0:
            return 0.0
        # Divided last: of two sums almost at once the rate would be infinite, and no number at all after no time.
        return min(self._gained * self._age / self._over, self._most)
