"""The error of each channel of a session against its deadband, for the hand and for the axes of an arm."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.deadband import Measures
from weberlink.config.joints import per_axis
from weberlink.config.model import ForceCodecSettings
from weberlink.geometry.joints import Joints
from weberlink.protocol.states import State
from weberlink.session.composition.channels import force_deadband
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import AXES, SECOND
from weberlink_figures.distribution import Distribution
from weberlink_figures.tree import AxisErrors, Errors

Series = NDArray[np.float64]
GRIPPER = "gripper"  # name of that axis of an arm, the last one


class Thresholds(NamedTuple):
    """What may stay unsent of an axis a [rad | N m]: the larger of `weber` |a| and its floor.

    Without a Weber factor, it is that of each record, which a live change may have set.
    """

    floors: Joints
    weber: float | None


class Compared(NamedTuple):
    """Errors of some ticks, shape (n,), their bound, and the same in the measure of the bound; of an arm, by axis."""

    errors: Series
    bounds: Series
    deviations: Series
    by_axis: Series | None = None


@dataclass(frozen=True)
class Stream:
    """A channel as its records hold it: what the sender measures in `raw`, and the receiver commands in `output`.

    Args:
        name: of the channel.
        names: of its axes.
        first: place of the first of these axes in the vectors of a record; not 0 of the second stream of a direction.
        bank: names of the predictors in the order of selectors; empty where the choice is not reported.
        error: of displayed and actual values, row by row, shape (n, 3) each.
        measures: of the deadband; None if it measures `error`.
        thresholds: deadbands of the axes of an arm, of which the largest error of a tick counts; None for the hand.
    """

    name: str
    names: tuple[str, ...] = AXES
    first: int = 0
    bank: tuple[str, ...] = ()
    error: Callable[[Series, Series], Series] | None = None
    measures: Measures | None = None
    thresholds: Thresholds | None = None

    def of(self, records: Records, vector: str) -> Series:
        """The axes of this stream, shape (n, axes), of a vector of all axes."""
        values: Series = records[vector][:, self.first : self.first + len(self.names)]
        return values

    def field(self, name: str) -> str:
        """The field that tells this of the stream."""
        return f"{SECOND}{name}" if self.first else name

    def compare(self, sender: Records, receiver: Records, displayed: str = "output", measured: str = "raw") -> Compared:
        """Compare records of the same moments: a vector of the receiver with one of the sender."""
        shown, actual = self.of(receiver, displayed), self.of(sender, measured)
        if self.thresholds is None:
            errors = deviations = (self.error or distances)(shown, actual)
            if self.measures is not None:
                deviations = deviations_of(shown, actual, sender["weber"], self.measures)
            return Compared(errors, np.asarray(sender[self.field("bound")], dtype=np.float64), deviations)
        by_axis = np.abs(shown - actual)
        deviations = (by_axis / self.deadbands(sender)).max(axis=1)
        return Compared(by_axis.max(axis=1), np.ones(len(by_axis)), deviations, by_axis)

    def deadbands(self, sender: Records) -> Series:
        """Those of the axes of an arm at each tick, shape (n, axes)."""
        assert self.thresholds is not None
        floors, weber = self.thresholds
        factor = sender["weber"][:, None] if weber is None else weber
        return np.asarray(np.maximum(factor * np.abs(self.of(sender, "raw")), np.asarray(floors)))


def joints_in(dump: Mapping[str, Any]) -> tuple[str, ...]:
    """The axes of a session in joint space, from the dump of a `System` in descriptions and recordings: the joints in
    order, then the gripper where there is one; none of a hand. Raises ValueError if it says something else of joints
    than this release does.
    """
    try:
        joints, gripper = (dump["codec"].get(part) for part in ("joints", GRIPPER))
        return () if joints is None else (*joints["names"], *([] if gripper is None else [GRIPPER]))
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"no settings of joints ({error!r})") from None


def arm_streams(dump: Mapping[str, Any]) -> tuple[list[Stream], list[Stream]] | None:
    """The channels of such a session from the slave and from the master; None of a hand; raises as `joints_in`."""

    def floors(setting: Any) -> Joints:
        return per_axis(tuple(setting) if isinstance(setting, list) else setting, len(own))

    from_slave, from_master, names = list[Stream](), list[Stream](), joints_in(dump)
    if not names:
        return None
    try:
        count = len(dump["codec"]["joints"]["names"])
        for name, first, own in (("joint", 0, names[:count]), (GRIPPER, count, names[count:])):
            if own:
                part = dump["codec"]["joints" if first == 0 else GRIPPER]
                weber = None if first == 0 else part["torque"]["weber"]  # a live change sets that of the joints
                torque = Thresholds(floors(part["torque"]["floor_nm"]), weber)
                angle = Thresholds(floors(part["angle"]["bound_rad"]), 0.0)
                bank = (part["torque"]["predictor"],)
                from_slave.append(Stream(f"{name}_torque", own, first, bank, thresholds=torque))
                from_master.append(Stream(f"{name}_angle", own, first, thresholds=angle))
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"no settings of joints ({error!r})") from None
    return from_slave, from_master


def measures_in(dump: Mapping[str, Any]) -> Measures | None:
    """How the deadband of the force measures an error, from the dump of a `System` in descriptions and recordings; None
    where that is the distance, which is quicker without. Raises ValueError for a deadband that is not known here."""
    try:
        given, tick_period = dump["codec"]["force"], 1.0 / dump["rate_hz"]
        force = ForceCodecSettings(**{key: given[key] for key in ("weber", "floor_n", "reference", "deadband")})
    except (KeyError, TypeError, ZeroDivisionError) as error:
        raise ValueError(f"no settings of a deadband ({error!r})") from None
    if force.deadband.deadband.is_ball:
        return None
    return lambda weber: force_deadband(force, tick_period, weber).error


@dataclass
class Exceedances:
    """Running statistics of errors, and of the ticks in which they are beyond a bound."""

    count: int = 0
    beyond: int = 0
    square_sum: float = 0.0
    largest: float = 0.0
    longest_run: int = 0
    _run: int = 0

    def add(self, errors: Series, beyond: NDArray[np.bool_]) -> None:
        """Take the next ticks, in order, shape (n,) each."""
        if not len(errors):
            return
        self.count += len(errors)
        self.beyond += int(beyond.sum())
        self.square_sum += float(np.square(errors).sum())
        self.largest = max(self.largest, float(errors.max()))
        leading = len(beyond) if beyond.all() else int(beyond.argmin())
        self.longest_run = max(self.longest_run, self._run + leading, longest_run(beyond))
        self._run = self._run + leading if leading == len(beyond) else int(beyond[::-1].argmin())

    @property
    def rms(self) -> float:
        return float((self.square_sum / max(1, self.count)) ** 0.5)


def longest_run(flags: NDArray[np.bool_]) -> int:
    """Most True in a row."""
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False))
    return int((edges[1::2] - edges[::2]).max(initial=0))


class ErrorStatistics(Exceedances):
    """Of an error against its deadband."""

    def __init__(self) -> None:
        super().__init__()
        self._deadbands = Distribution()  # in millionths, because its first bin ends at 1

    def compare(self, compared: Compared) -> None:
        """Take the next ticks."""
        errors, bounds, deviations, _ = compared
        self.add(errors, deviations > bounds)
        bounded = bounds > 0.0
        self._deadbands.add(deviations[bounded] / bounds[bounded] * 1e6)

    def figures(self, period: float) -> Errors:
        deadbands = self._deadbands.spread()
        largest, high = (None if us is None else us * 1e-6 for us in (deadbands.max, deadbands.p99))
        if not self.count:
            return Errors(None, None, None, None, None, largest, high)
        longest_s, total_s = self.longest_run * period, self.beyond * period
        return Errors(self.rms, self.largest, self.beyond / self.count, longest_s, total_s, largest, high)


class ChannelScore:
    """Errors of one channel: what the receiver commanded against what the sender measured at the same time.

    The coding error is that of the sample which the sender decided on in a tick. With look-ahead this is an earlier
    one, so only the error at the same time counts the delay of the look-ahead.
    """

    def __init__(self, stream: Stream) -> None:
        self.stream = stream
        self.felt, self.coding = ErrorStatistics(), ErrorStatistics()
        self.widest: float | None = None
        self._selected: dict[int, int] = {}
        self._ticks = self._widened = 0
        self._squares = self._largest = np.zeros(len(stream.names))

    def add_sender(self, records: Records, in_session: Records) -> None:
        """Take the next records of the sender, and those of them that are in session and not in a ramp."""
        stream = self.stream
        self._ticks += len(in_session)
        widened = in_session[in_session[stream.field("widened")] > 0]
        self._widened += len(widened)
        if len(widened) and stream.thresholds is None:
            self.widest = max(self.widest or 0.0, float(widened[stream.field("bound")].max()))
        if stream.bank and len(records):
            tally(self._selected, records[stream.field("selected")][records[stream.field("sent")] > 0])
            self.coding.compare(stream.compare(in_session, in_session, "decoded", "coded"))

    def compare(self, sender: Records, receiver: Records) -> None:
        """Take records of the same moments."""
        if len(sender):
            compared = self.stream.compare(sender, receiver)
            self.felt.compare(compared)
            if compared.by_axis is not None:
                self._squares = self._squares + (compared.by_axis**2).sum(axis=0)
                self._largest = np.maximum(self._largest, compared.by_axis.max(axis=0))

    @property
    def widened_fraction(self) -> float | None:
        return self._widened / self._ticks if self._ticks else None

    @property
    def selected(self) -> dict[str, int] | None:
        """Updates by predictor; None where the choice is not reported."""
        bank = self.stream.bank
        return {bank[number]: count for number, count in sorted(self._selected.items())} if bank else None

    @property
    def axes(self) -> dict[str, AxisErrors | None] | None:
        """The error of each axis of an arm."""
        if self.stream.thresholds is None:
            return None
        rms = (self._squares / max(1, self.felt.count)) ** 0.5
        each = zip(self.stream.names, rms.tolist(), self._largest.tolist(), strict=True)
        return {name: AxisErrors(rms, largest) if self.felt.count else None for name, rms, largest in each}


class UpdatesOnTheirWay:
    """Counts the ticks in which an update was sent that the receiver cannot display yet.

    It displays an update after the delay of that time, and at least one tick after the send.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._sent_at = -inf  # the newest update [s]
        self._ticks = self._counted = 0

    def add(self, sender: Records, one_way_us: NDArray[Any], counts: NDArray[np.bool_]) -> None:
        """Take the next records of the sender, the delay to the receiver (NaN while unknown), and what counts."""
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
        return self._ticks / self._counted if self._counted else None


def angles_between(a: NDArray[Any], b: NDArray[Any]) -> Series:
    """Angles [rad] between rotations given as rotation vectors [rad], shape (n, 3) each, row by row."""
    return np.asarray(np.linalg.norm(turns_between(a, b), axis=1), dtype=np.float64)


def turns_between(a: NDArray[Any], b: NDArray[Any]) -> Series:
    """Rotation vectors [rad] of b after the inverse of a, at most half a turn, row by row; shape (n, 3) each."""

    def parts(rotations: Series) -> tuple[Series, Series]:
        """Scalar and vector parts of quaternions."""
        half = 0.5 * np.linalg.norm(rotations, axis=1)
        return np.cos(half), 0.5 * np.sinc(half / np.pi)[:, None] * rotations

    (aw, av), (bw, bv) = (parts(np.asarray(each, dtype=np.float64)) for each in (a, b))
    between = aw[:, None] * bv - bw[:, None] * av + np.cross(av, bv)
    scalar = aw * bw + np.einsum("ij,ij->i", av, bv)
    length = np.linalg.norm(between, axis=1)
    angle = 2.0 * np.arctan2(length, np.abs(scalar))
    # A quaternion and its negative are the same rotation.
    sign = np.where(scalar < 0.0, -1.0, 1.0)
    factor = sign * np.divide(angle, length, out=np.full_like(length, 2.0), where=length > 0.0)
    return np.asarray(between * factor[:, None], dtype=np.float64)


def deviations_of(displayed: Series, measured: Series, webers: Series, measures: Measures) -> Series:
    """Errors of displayed forces against those measured, shape (n,), in the measure of the deadband of each record, of
    its Weber factor; the distance where that is none.
    """
    deviations = distances(displayed, measured)
    for weber in np.unique(webers[(webers >= 0.0) & (webers <= 1.0)]).tolist():
        chosen = np.flatnonzero(webers == weber)
        measure, actual = measures(weber), measured[chosen].tolist()
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
