"""A low-pass of first order."""

from math import expm1, pi


class LowPass:
    """Of values that come at irregular times, with a cutoff [Hz] or 0 for none.

    It lags by 1 / (2 pi cutoff) [s] at frequencies well below the cutoff.
    """

    def __init__(self, cutoff: float) -> None:
        self._rate = 2.0 * pi * cutoff
        self._values: tuple[float, ...] = ()
        self._at = 0.0

    @property
    def lag(self) -> float:
        return 1.0 / self._rate if self._rate > 0.0 else 0.0

    def restart(self) -> None:
        """Take the next values as they are."""
        self._values = ()

    def next(self, values: tuple[float, ...], at: float) -> tuple[float, ...]:
        """The filtered values at the time of these [s]."""
        if self._values and self._rate > 0.0:
            share = -expm1(-self._rate * max(0.0, at - self._at))
            values = tuple([old + share * (new - old) for old, new in zip(self._values, values, strict=True)])
        self._values, self._at = values, at
        return values
