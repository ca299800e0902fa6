"""The error of one channel of a session (force, position, torque or orientation) against its deadband."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import inf, isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.deadband.contract import Measures
from weberlink.figures.distribution import Distribution
from weberlink.figures.energy import Records, Series
from weberlink.protocol.states import State


@dataclass
class ErrorStatistics:
    """Running statistics of an error against its bound."""

    count: int = 0
    violations: int = 0
    square_sum: float = 0.0
    largest: float = 0.0
    longest_run: int = 0
    deadbands: Distribution = field(default_factory=Distribution)  # in millionths, because its first bin ends at 1
    _run: int = 0

    def add(self, errors: Series, bounds: Series, deviations: Series) -> None:
        """Take the next ticks.

        Args:
            errors: in the unit of the values, shape (n,).
            bounds: of the deviations, shape (n,).
            deviations: the same errors in the measure of the deadband, shape (n,).
        """
        outside = deviations > bounds
        self.count += len(errors)
        self.violations += int(outside.sum())
        self.square_sum += float((errors * errors).sum())
        if len(errors):
            self.largest = max(self.largest, float(errors.max()))
        bounded = bounds > 0.0
        self.deadbands.add(deviations[bounded] / bounds[bounded] * 1e6)
        for value in outside.tolist():
            self._run = self._run + 1 if value else 0
            self.longest_run = max(self.longest_run, self._run)

    def summary(self, period: float) -> dict[str, float | None]:
        in_deadbands = none_for_nan({"max": self.deadbands.max * 1e-6, "p99": self.deadbands.percentile(99.0) * 1e-6})
        return {
            "error_rms": (self.square_sum / self.count) ** 0.5 if self.count else None,
            "error_max": self.largest if self.count else None,
            "violation_fraction": self.violations / self.count if self.count else None,
            "violation_longest_ticks": self.longest_run,
            "violation_longest_s": self.longest_run * period if self.count else None,
            "violation_s": self.violations * period if self.count else None,
            "error_max_deadbands": in_deadbands["max"],
            "error_p99_deadbands": in_deadbands["p99"],
        }


class ChannelScore:
    """Errors of one channel: what the receiver commanded against what the sender measured at the same time.

    The coding error is that of the sample which the sender decided on in a tick. With look-ahead this is an earlier
    one, so only the error at the same time counts the delay of the look-ahead.

    Args:
        prefix: of the record fields: "" or "rotation_".
        period: of a tick [s].
        bank: names of the predictors in the order of selectors, for a channel whose coding error is reported.
        error: of displayed and actual values row by row, shape (n, 3) each.
        measures: of the deadband; None if it measures `error`.
    """

    def __init__(
        self,
        prefix: str,
        period: float,
        bank: Sequence[str] | None = None,
        error: Callable[[Series, Series], Series] | None = None,
        measures: Measures | None = None,
    ) -> None:
        self._prefix, self._period, self._bank = prefix, period, bank
        self._coded = f"{prefix}raw" if prefix else "coded"  # the rotation has no look-ahead
        self._error = error or distances
        self._measures = measures
        self.felt, self._coding = ErrorStatistics(), ErrorStatistics()
        self._selected: dict[int, int] = {}
        self._ticks = self._widened = 0
        self._widest: float | None = None

    def add_sender(self, records: Records, in_session: Records) -> None:
        """Take the next records of the sender, and those of them that are in session and not in a ramp."""
        widened = in_session[f"{self._prefix}bound"][in_session[f"{self._prefix}widened"] > 0]
        self._ticks += len(in_session)
        self._widened += len(widened)
        if len(widened):
            self._widest = max(self._widest or 0.0, float(widened.max()))
        if self._bank is None or not len(records):
            return
        tally(self._selected, records[f"{self._prefix}selected"][records[f"{self._prefix}sent"] > 0])
        self._add(self._coding, in_session[f"{self._prefix}decoded"], in_session, self._coded)

    def compare(self, sender: Records, receiver: Records) -> None:
        """Take records of the same moments."""
        self._add(self.felt, receiver[f"{self._prefix}output"], sender, f"{self._prefix}raw")

    def summary(self) -> dict[str, Any]:
        summary: dict[str, Any] = self.felt.summary(self._period)
        summary["widened_fraction"] = self._widened / self._ticks if self._ticks else None
        summary["widened_max"] = self._widest
        if self._bank is not None:
            summary["coding"] = self._coding.summary(self._period)
            summary["selected"] = {self._bank[i]: count for i, count in sorted(self._selected.items())}
        return summary

    def _add(self, statistics: ErrorStatistics, displayed: Series, sender: Records, measured: str) -> None:
        actual = sender[measured]
        errors = deviations = self._error(displayed, actual)
        if self._measures is not None:
            deviations = deviations_of(displayed, sender, self._measures)
        statistics.add(errors, np.asarray(sender[f"{self._prefix}bound"], dtype=np.float64), deviations)


class UpdatesOnTheirWay:
    """Counts the ticks in which an update was sent that the receiver cannot display yet.

    It displays an update after the delay of that time, and at least one tick after the send.

    Args:
        period: of a tick [s].
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._sent_at = -inf  # the newest update [s]
        self._ticks = self._counted = 0

    def add(self, sender: Records, one_way_us: NDArray[Any], counts: NDArray[np.bool_]) -> None:
        """Take the next ticks of the sender.

        Args:
            sender: its records, shape (n,).
            one_way_us: delay to the receiver in these ticks [us], shape (n,); NaN while it is unknown.
            counts: whether a tick counts for the error, shape (n,).
        """
        if not len(sender):
            return
        at = np.asarray(sender["at"], dtype=np.float64)
        sent_at = np.maximum(np.maximum.accumulate(np.where(sender["sent"] > 0, at, -inf)), self._sent_at)
        self._sent_at = float(sent_at[-1])
        delay = np.fmax(np.asarray(one_way_us, dtype=np.float64) * 1e-6, self._period)
        on_its_way = at - sent_at < delay - 0.5 * self._period  # a delay of n ticks is n ticks long
        self._ticks += int((on_its_way & counts).sum())
        self._counted += int(counts.sum())

    @property
    def share(self) -> float | None:
        """Of the ticks that count; None if there are none."""
        return self._ticks / self._counted if self._counted else None


def angles_between(a: NDArray[Any], b: NDArray[Any]) -> Series:
    """Angles [rad] between rotations given as rotation vectors [rad], shape (n, 3) each, row by row."""
    return np.asarray(np.linalg.norm(turns_between(a, b), axis=1), dtype=np.float64)


def turns(rotations: NDArray[Any]) -> Series:
    """Rotation vectors [rad] from each row to the next, in the fixed frame; shape (n - 1, 3)."""
    return turns_between(rotations[:-1], rotations[1:])


def turns_between(a: NDArray[Any], b: NDArray[Any]) -> Series:
    """Rotation vectors [rad] of b after the inverse of a, at most half a turn, row by row; shape (n, 3) each."""
    (aw, av), (bw, bv) = (_quaternions(np.asarray(each, dtype=np.float64)) for each in (a, b))
    between = aw[:, None] * bv - bw[:, None] * av + np.cross(av, bv)
    scalar = aw * bw + np.einsum("ij,ij->i", av, bv)
    length = np.linalg.norm(between, axis=1)
    angle = 2.0 * np.arctan2(length, np.abs(scalar))
    # A quaternion and its negative are the same rotation.
    sign = np.where(scalar < 0.0, -1.0, 1.0)
    factor = sign * np.divide(angle, length, out=np.full_like(length, 2.0), where=length > 0.0)
    return np.asarray(between * factor[:, None], dtype=np.float64)


def _quaternions(rotations: Series) -> tuple[Series, Series]:
    """Scalar and vector parts."""
    half = 0.5 * np.linalg.norm(rotations, axis=1)
    return np.cos(half), 0.5 * np.sinc(half / np.pi)[:, None] * rotations


def deviations_of(displayed: Series, sender: Records, measures: Measures) -> Series:
    """Errors of displayed forces against those measured, shape (n,), in the measure of the deadband of each record.

    The distance where the Weber factor of a record is none.
    """
    webers = sender["weber"]
    deviations = distances(displayed, sender["raw"])
    for weber in np.unique(webers[(webers >= 0.0) & (webers <= 1.0)]).tolist():
        chosen = np.flatnonzero(webers == weber)
        measure, actual = measures(weber), sender["raw"][chosen].tolist()
        pairs = zip(displayed[chosen].tolist(), actual, strict=True)
        deviations[chosen] = [measure((a, b, c), (x, y, z)) for (a, b, c), (x, y, z) in pairs]
    return deviations


def distances(a: Series, b: Series) -> Series:
    """Distances of vectors of shape (n, 3), row by row."""
    return np.asarray(np.linalg.norm(a - b, axis=1), dtype=np.float64)


def engaged(records: Records) -> NDArray[np.bool_]:
    flags: NDArray[np.bool_] = records["state"] == State.ENGAGED.value
    return flags


def in_session(records: Records) -> NDArray[np.bool_]:
    """Engaged ticks without ramps, which count for errors."""
    flags: NDArray[np.bool_] = engaged(records) & (records["ramping"] == 0)
    return flags


def tally(counts: dict[int, int], values: NDArray[Any]) -> None:
    """Add the number of each value to `counts`."""
    for value, count in zip(*(column.tolist() for column in np.unique(values, return_counts=True)), strict=True):
        counts[value] = counts.get(value, 0) + count


def none_for_nan(figures: dict[str, float]) -> dict[str, float | None]:
    """JSON has no NaN."""
    return {name: None if isnan(value) else value for name, value in figures.items()}
