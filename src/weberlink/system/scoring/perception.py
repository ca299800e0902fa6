"""Perceptual error metrics: errors in units of a just noticeable difference (JND), and runs of noticeable ticks.

The threshold does not depend on the codec, unlike its deadband. The perceptual indices of the literature (HSSIM and
others) are not implemented: their formulas could not be verified.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.system.scoring.channel import in_session
from weberlink.system.scoring.energy import Records

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Threshold:
    """A just noticeable difference of force: `max(jnd |f|, floor)`.

    Pang, Tan and Durlach 1991 found 7 to 10 % from 2 to 10 N. Weber's law fails below about 1 N, hence the floor.

    Args:
        jnd: as a share of the force, > 0.
        floor_n: absolute threshold [N], >= 0.

    Raises:
        ValueError: for a number out of range.
    """

    jnd: float = 0.10
    floor_n: float = 0.02

    def __post_init__(self) -> None:
        if not (0.0 < self.jnd < np.inf and 0.0 <= self.floor_n < np.inf):
            raise ValueError(f"jnd must be > 0 and floor_n >= 0, both finite, not {self.jnd!r} and {self.floor_n!r}")

    def of(self, force_n: Array) -> Array:
        """The threshold [N], shape (n,), at measured forces [N], shape (n, 3)."""
        relative: Array = self.jnd * np.linalg.norm(force_n, axis=1)
        return np.maximum(relative, self.floor_n)


class Noticed(NamedTuple):
    """Errors in units of the threshold."""

    error_rms_jnd: float
    error_max_jnd: float
    noticeable_fraction: float
    """Share of ticks whose error exceeds the threshold."""
    noticeable_longest_s: float


def noticed(error_n: Array, threshold_n: Array, period_s: float) -> Noticed:
    """Compare errors [N] with thresholds [N], each of shape (n,).

    Ticks with a threshold of 0 (no force and no floor) count in the share and the longest run, not in RMS and maximum.
    """
    in_jnd = in_units(error_n, threshold_n)
    beyond = error_n > threshold_n
    return Noticed(
        error_rms_jnd=rms(in_jnd),
        error_max_jnd=float(in_jnd.max(initial=0.0)),
        noticeable_fraction=float(beyond.mean()),
        noticeable_longest_s=longest_run(beyond) * period_s,
    )


def in_units(error_n: Array, bound_n: Array) -> Array:
    """Errors in units of bounds, without the ticks whose bound is 0."""
    known = bound_n > 0.0
    units: Array = error_n[known] / bound_n[known]
    return units


def rms(values: Array) -> float:
    """0 of no values."""
    return float(np.sqrt(np.mean(values * values))) if len(values) else 0.0


def longest_run(flags: Flags) -> int:
    """Most True in a row."""
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False))
    return int((edges[1::2] - edges[::2]).max(initial=0))


class FeltError:
    """RMS error of the force felt in a simulated session, in JNDs of the force that the robot measured.

    In virtual time both sides tick together, so records of one tick belong together. The felt force is the one
    commanded to the device in the same tick. Ticks count while both sides are engaged and not in a ramp.

    Args:
        threshold: the JND; with a floor, since ticks without contact count too.
    """

    def __init__(self, threshold: Threshold) -> None:
        self._threshold = threshold
        self._square_sum = 0.0
        self._count = 0

    def add(self, master: Records, slave: Records) -> None:
        """Take the records of the same ticks of both sides."""
        counts = in_session(master) & in_session(slave)
        force = slave["raw"][counts]
        error = np.linalg.norm(master["output"][counts] - force, axis=1)
        self._square_sum += float(np.square(error / self._threshold.of(force)).sum())
        self._count += int(counts.sum())

    @property
    def rms_jnd(self) -> float | None:
        """None before the first tick that counts."""
        return (self._square_sum / self._count) ** 0.5 if self._count else None
