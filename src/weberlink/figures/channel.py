"""The error of each channel of a session against its deadband, for the hand and for the axes of an arm."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec.deadband.contract import Measures
from weberlink.config.joints import per_axis
from weberlink.figures.distribution import Distribution
from weberlink.figures.tree import AxisErrors, Errors
from weberlink.geometry.joints import Joints
from weberlink.protocol.states import State
from weberlink.telemetry.record import JOINTS

Records = NDArray[Any]  # structured array of telemetry records
Series = NDArray[np.float64]
GRIPPER = slice(len(JOINTS) - 1, len(JOINTS))  # place of the gripper in the vectors of a record


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
        prefix: of the record fields: "", "rotation_" or "joint_".
        counted: prefix of the counters and flags of its updates, where its direction has an earlier channel.
        bank: names of the predictors in the order of selectors; empty where the choice is not reported.
        error: of displayed and actual values, row by row, shape (n, 3) each.
        measures: of the deadband; None if it measures `error`.
        thresholds: deadbands of the axes of an arm, of which the largest error of a tick counts; None for the hand.
        axes: their places in the vectors of a record.
        names: of these axes.
    """

    name: str
    prefix: str = ""
    counted: str = ""
    bank: tuple[str, ...] = ()
    error: Callable[[Series, Series], Series] | None = None
    measures: Measures | None = None
    thresholds: Thresholds | None = None
    axes: slice = field(default_factory=lambda: slice(0, 3))
    names: tuple[str, ...] = ()

    def compare(self, displayed: Records, sender: Records, measured: str = "raw") -> Compared:
        """Compare values of shape (n, axes of a record) with those of the sender, of field `measured`."""
        actual = sender[f"{self.prefix}{measured}"]
        if self.thresholds is None:
            errors = deviations = (self.error or distances)(displayed, actual)
            if self.measures is not None:
                deviations = deviations_of(displayed, sender, self.measures)
            return Compared(errors, np.asarray(sender[f"{self.prefix}bound"], dtype=np.float64), deviations)
        actual, displayed = (each[:, self.axes].astype(np.float64) for each in (actual, displayed))
        by_axis = np.abs(displayed - actual)
        deviations = (by_axis / self.deadbands(sender)).max(axis=1)
        return Compared(by_axis.max(axis=1), np.ones(len(by_axis)), deviations, by_axis)

    def deadbands(self, sender: Records) -> Series:
        """Those of the axes of an arm at each tick, shape (n, axes)."""
        assert self.thresholds is not None
        floors, weber = self.thresholds
        factor = sender["weber"][:, None] if weber is None else weber
        actual = sender[f"{self.prefix}raw"][:, self.axes].astype(np.float64)
        return np.asarray(np.maximum(factor * np.abs(actual), np.asarray(floors)))

    def felt(self, receiver: Records, sender: Records) -> Compared:
        """Compare records of the same moments."""
        return self.compare(receiver[f"{self.prefix}output"], sender)


@dataclass(frozen=True)
class ArmLayout:
    """The axes of a session in joint space, and the channels of each direction: the joints and, where there is one, the
    gripper, which is the last.
    """

    axes: tuple[str, ...]
    from_slave: tuple[Stream, ...]
    from_master: tuple[Stream, ...]

    @property
    def has_gripper(self) -> bool:
        return len(self.from_slave) > 1

    @property
    def places(self) -> list[int]:
        """Column of each of these axes in the vectors of a record."""
        return [place for stream in self.from_slave for place in range(stream.axes.start, stream.axes.stop)]

    def torque_deadbands(self, slave: Records) -> Series:
        """What may stay unsent of the torque of each axis at each tick [N m], shape (n, axes)."""
        return np.hstack([stream.deadbands(slave) for stream in self.from_slave])


def arm_in(dump: Mapping[str, Any]) -> ArmLayout | None:
    """The layout in the dump of a `System`, as descriptions and recordings hold it; None without an arm. Raises
    ValueError if it says something else of joints than this release does.
    """

    def floors(setting: Any, names: tuple[str, ...]) -> Joints:
        return per_axis(tuple(setting) if isinstance(setting, list) else setting, len(names))

    try:
        codec = dump["codec"]
        joints, gripper = codec.get("joints"), codec.get("gripper")
        if joints is None:
            return None
        names, from_slave, from_master = tuple(joints["names"]), [], []
        parts = [("joint", "", joints, names, slice(0, len(names)), None)]
        if gripper is not None:
            parts.append(("gripper", "gripper_", gripper, JOINTS[-1:], GRIPPER, gripper["torque"]["weber"]))
        for name, counted, part, of, places, weber in parts:
            angle = Thresholds(floors(part["angle"]["bound_rad"], of), 0.0)
            torque = Thresholds(floors(part["torque"]["floor_nm"], of), weber)
            bank = () if counted else (part["torque"]["predictor"],)
            from_slave.append(Stream(f"{name}_torque", "joint_", counted, bank, None, None, torque, places, of))
            from_master.append(Stream(f"{name}_angle", "joint_", counted, (), None, None, angle, places, of))
        return ArmLayout(names + JOINTS[-1:] * (len(parts) - 1), tuple(from_slave), tuple(from_master))
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"no settings of joints ({error!r})") from None


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
        if stream.counted != "gripper_":
            widened = in_session[in_session[f"{stream.counted}widened"] > 0]
            self._widened += len(widened)
            if len(widened) and stream.thresholds is None:
                self.widest = max(self.widest or 0.0, float(widened[f"{stream.prefix}bound"].max()))
        if stream.bank and len(records):
            tally(self._selected, records[f"{stream.counted}selected"][records[f"{stream.counted}sent"] > 0])
            coded = "raw" if stream.prefix else "coded"  # of the hand alone there is a look-ahead
            self.coding.compare(stream.compare(in_session[f"{stream.prefix}decoded"], in_session, coded))

    def compare(self, sender: Records, receiver: Records) -> None:
        """Take records of the same moments."""
        if len(sender):
            compared = self.stream.felt(receiver, sender)
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
