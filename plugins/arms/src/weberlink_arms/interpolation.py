"""Interpolation between samples of a robot with a rate of its own, so that values are late by a stated lag."""

from typing import NamedTuple


class TimedValues(NamedTuple):
    """Measured at `at` [s]."""

    at: float
    values: tuple[float, ...]


class Interpolation:
    """Linear between neighbouring samples; held after the newest, and before the oldest that is kept.

    Values at `now` are those of `now - lag`. With a lag of a sample period plus the transmission time, there is a
    sample on either side, so nothing is extrapolated. `add` may be called in one thread and `at` in another.

    Args:
        lag: How much older than `now` the values are [s], >= 0.
        keep: How many samples are kept, >= 2; one more than the lag covers bridges a late sample.
    """

    def __init__(self, lag: float, keep: int = 4) -> None:
        if not lag >= 0.0 or keep < 2:
            raise ValueError(f"expected a lag of 0 s or more and at least 2 samples, got {lag} s and {keep}")
        self.lag = lag
        self._keep = keep
        # An immutable tuple, replaced as a whole: a reader in another thread sees the old one or the new one.
        self._samples: tuple[TimedValues, ...] = ()

    def restart(self, sample: TimedValues) -> None:
        """Forget everything but this one sample."""
        self._samples = (sample,)

    def add(self, sample: TimedValues) -> None:
        """Add a sample; one that is not newer than the last is ignored."""
        samples = self._samples
        if not samples or sample.at > samples[-1].at:
            self._samples = (*samples[1 - self._keep :], sample)

    @property
    def newest_at(self) -> float:
        """When the newest sample was measured [s]; LookupError where there is none."""
        if not self._samples:
            raise LookupError("no sample yet")
        return self._samples[-1].at

    def at(self, now: float) -> TimedValues:
        """The values of `now - lag` with that time, held beyond either end; LookupError if there is no sample yet."""
        samples = self._samples
        if not samples:
            raise LookupError("no sample yet")
        moment = now - self.lag
        later = samples[-1]
        if moment >= later.at:
            return later
        for earlier in samples[-2::-1]:
            if moment >= earlier.at:
                return _between(earlier, later, moment)
            later = earlier
        return later


def _between(earlier: TimedValues, later: TimedValues, moment: float) -> TimedValues:
    share = (moment - earlier.at) / (later.at - earlier.at)
    rest = 1.0 - share
    return TimedValues(moment, tuple([rest * a + share * b for a, b in zip(earlier.values, later.values, strict=True)]))
