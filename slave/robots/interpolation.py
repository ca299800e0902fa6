"""Samples that come at a robot's own rate, made into values at any moment: late by a stated lag, never made up.

Owns the few newest samples. Knows no robot and no clock; `add` may be called in one thread and `at` in another.
"""

from typing import NamedTuple

Values = tuple[float, ...]


class Sample(NamedTuple):
    """What was measured at `at` [s]."""

    at: float
    values: Values


class Interpolation:
    """Linear between neighbouring samples; held after the newest, and before the oldest that is kept.

    Values asked for at `now` are those of `now - lag`. With a lag of a sample period and the time that a sample is
    under way, there is a sample on either side of that moment, so nothing has to be extrapolated.

    Args:
        lag: how much older than `now` the values are [s], >= 0.
        keep: how many samples are kept, >= 2; one more than the lag covers bridges a sample that comes late.
    """

    def __init__(self, lag: float, keep: int = 4) -> None:
        if not lag >= 0.0 or keep < 2:
            raise ValueError(f"expected a lag of 0 s or more and at least 2 samples, got {lag} s and {keep}")
        self.lag = lag
        self._keep = keep
        # Replaced as a whole, never changed: a reader in another thread sees the old one or the new one.
        self._samples: tuple[Sample, ...] = ()

    def restart(self, sample: Sample) -> None:
        """Forget everything but this one sample."""
        self._samples = (sample,)

    def add(self, sample: Sample) -> None:
        """One more sample; one that is not newer than the last is ignored, so that time never goes back."""
        samples = self._samples
        if not samples or sample.at > samples[-1].at:
            self._samples = (*samples[1 - self._keep :], sample)

    @property
    def newest_at(self) -> float:
        """When the newest sample was measured [s]; LookupError where there is none."""
        if not self._samples:
            raise LookupError("no sample yet")
        return self._samples[-1].at

    def at(self, now: float) -> Sample:
        """The values of `now - lag` with that moment, or a sample as it is where that is beyond either end.

        Raises:
            LookupError: there is no sample yet.
        """
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


def _between(earlier: Sample, later: Sample, moment: float) -> Sample:
    share = (moment - earlier.at) / (later.at - earlier.at)
    rest = 1.0 - share
    return Sample(moment, tuple([rest * a + share * b for a, b in zip(earlier.values, later.values, strict=True)]))
