"""A bundle: the joints of an arm as one coded signal, of which every update carries all axes.

The axes are cut into parts of three (`weberlink.geometry.joints`), each an ordinary channel. One decision is made for
all of them: where one axis leaves its deadband, all are sent. So an update restores the whole decoder, and the joints
of an arm are always of the same moment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from weberlink.codec.channel import Channel
from weberlink.codec.deadband.per_axis import PerAxisDeadband
from weberlink.codec.decoder import Decoder
from weberlink.codec.predictors import PREDICTORS, ContactSurface
from weberlink.codec.predictors.model import UNFITTED, ModelRecord
from weberlink.codec.rate import TokenBucket, UpdateRate
from weberlink.codec.sample import Quantizer, Sample
from weberlink.geometry.joints import Joints, is_finite, joined, parts, widths
from weberlink.geometry.vector import Vector
from weberlink.update import MAX_GAP, Payload, PreviousSample, Update, UpdateForm

AXES = "xyz"
ROUNDING = 0.5 * (1.0 + 1e-9)
"""Largest rounding error of the wire [steps], with that of the arithmetic."""


@dataclass(frozen=True)
class BundleChannel:
    """One coded direction of a bundle: what its two ends must agree on.

    Args:
        parts: channels of three axes, the last one of 1 to 3, with a `PerAxisDeadband` and the same single predictor.
        count: number of axes, >= 1.

    Raises:
        ValueError: for parts that do not fit the number of axes, or a predictor that does not suit a bundle.
    """

    parts: tuple[Channel, ...]
    count: int

    def __post_init__(self) -> None:
        if not self.parts or [part.value_quantizer.size for part in self.parts] != widths(self.count):
            raise ValueError(f"the parts do not have {self.count!r} axes, three to a part")
        for part in self.parts:
            if not isinstance(part.deadband, PerAxisDeadband):
                raise ValueError(f"the deadband of a bundle must be a PerAxisDeadband, not {part.deadband.name}")  # noqa: TRY004
        predictor = PREDICTORS[self.parts[0].bank[0]]
        if predictor.geometric or predictor.estimated or any(part.bank != (predictor.name,) for part in self.parts):
            raise ValueError(
                f"{', '.join(self.parts[0].bank)}: a bundle of joints needs one predictor that reads no position and "
                "sends no parameters, such as zoh or linear"
            )

    @property
    def bank(self) -> tuple[str, ...]:
        return self.parts[0].bank

    @property
    def forms(self) -> tuple[UpdateForm, ...]:
        """What updates carry: a group of levels for each part."""
        groups = tuple(widths(self.count))
        return (UpdateForm(groups, groups),)

    @property
    def deadbands(self) -> list[PerAxisDeadband]:
        return [part.deadband for part in self.parts if isinstance(part.deadband, PerAxisDeadband)]

    @property
    def limit(self) -> float:
        """Largest magnitude on an axis that the wire can carry."""
        return self.parts[0].value_quantizer.limit

    @property
    def rest(self) -> Joints | None:
        """Values at both ends before the first update; None if nothing can be assumed."""
        rests = [part.rest for part in self.parts if part.rest is not None]
        return joined(rests, self.count) if rests else None


def joint_channel(
    *,
    bounds: Joints,
    step: float,
    predictor: str = "linear",
    weber: float = 0.0,
    tick_period: float = 1e-3,
    rest: Joints | None = None,
    rate: UpdateRate | None = None,
) -> BundleChannel:
    """Make the channel of a vector of joint values.

    Args:
        bounds: absolute threshold of each axis, > 0: the deadband of an angle [rad], the floor of a torque [N m].
        step: wire step, > 0 [rad or N m].
        predictor: a name of `PREDICTORS` that reads no position and sends no parameters.
        weber: Weber factor of the value on its own axis, >= 0; 0 for angles.
        tick_period: time between ticks [s], > 0.
        rest: values at both ends before the first update; None if nothing can be assumed.
        rate: largest rate of updates of the whole bundle; None for no limit.

    Raises:
        ValueError: as `BundleChannel` and `Channel`, or for a number out of its range.
    """
    if rest is not None and len(rest) != len(bounds):
        raise ValueError(f"rest has {len(rest)} axes, bounds {len(bounds)}")
    made: list[Channel] = []
    rests: Sequence[Vector | None] = [None] * len(bounds) if rest is None else parts(rest)
    for index, width in enumerate(widths(len(bounds))):
        made.append(
            Channel(
                bank=(predictor,),
                deadband=_deadband(bounds[3 * index : 3 * index + width], weber, step),
                value_quantizer=Quantizer(step, AXES[:width]),
                rest=rests[index],
                rate=rate,
                tick_period=tick_period,
            )
        )
    return BundleChannel(tuple(made), len(bounds))


def _deadband(bounds: Joints, weber: float, step: float) -> PerAxisDeadband:
    """The deadband of a part; axes that it does not have are not coded."""
    x, y, z = (*bounds, inf, inf)[:3]
    return PerAxisDeadband(weber, (x, y, z), ROUNDING * step)


class BundleSample(NamedTuple):
    """A transmitted sample of all axes, as both ends hold it.

    Args:
        tick: sender's tick number.
        value: of all axes [rad or N m].
    """

    tick: int
    value: Joints


class BundleDecoder:
    """The receiving end of a bundle; the laws of `Decoder` hold.

    Attributes:
        newest: the newest sample received; None before the first.
        first: its value; before the first, the channel's `rest`, or zeros.
        selected: index in the bank of the predictor in use, always 0.
    """

    selected = 0

    def __init__(self, channel: BundleChannel) -> None:
        self._count = channel.count
        self._rest = channel.rest
        self._decoders = [Decoder(part) for part in channel.parts]
        self._spans = _spans(channel)
        self.reset()

    def reset(self) -> None:
        """Forget the signal: `value` returns the channel's `rest` until the first update."""
        self.newest: BundleSample | None = None
        self.first: Joints = self._rest or (0.0,) * self._count
        for decoder in self._decoders:
            decoder.reset()

    @property
    def state(self) -> tuple[object, ...]:
        """All that a prediction depends on."""
        return tuple([decoder.state for decoder in self._decoders])

    @property
    def surface(self) -> ContactSurface | None:
        return None

    @property
    def record(self) -> ModelRecord:
        """The model in use, as telemetry records it."""
        return UNFITTED if self.newest is None else self._decoders[0].record

    def retune(self, weber: float, since: float = -inf) -> None:
        """As of `Decoder`: nothing changes, because updates of a bundle are not smoothed."""

    def apply(self, update: Update) -> None:
        """Replace the state by that of an update; one that was applied already, and is repeated, changes nothing.

        Raises:
            ValueError: if selector, number of levels or payload do not fit the channel; the state is unchanged then.
        """
        count, payload = self._count, update.payload
        if update.selector != 0:
            raise ValueError(f"update selects predictor {update.selector} of a bank of 1")
        if len(update.newest) != count:
            raise ValueError(f"update has {len(update.newest)} levels, expected {count}")
        if isinstance(payload, PreviousSample):
            if len(payload.levels) != count:
                raise ValueError(f"update carries {len(payload.levels)} levels of the previous sample, not {count}")
        elif payload is not None:
            raise ValueError("update carries model parameters, expected a previous sample")
        values: list[Vector] = []
        for decoder, (start, end) in zip(self._decoders, self._spans, strict=True):
            earlier: Payload = None
            if isinstance(payload, PreviousSample):
                earlier = PreviousSample(payload.gap, payload.levels[start:end])
            decoder.apply(Update(update.tick, 0, update.newest[start:end], earlier))
            values.append(decoder.first)
        self.first = joined(values, count)
        self.newest = BundleSample(update.tick, self.first)

    def value(self, tick: float, position: object = None) -> Joints | None:  # noqa: ARG002 - predictors of a bundle read none
        """The values to display, finite and within the range of the wire; the `rest` before the first update.

        Args:
            tick: the present time on the sender's tick clock; fractional between its ticks.
            position: not read.
        """
        values = self.parts(tick)
        return self._rest if values is None else joined(values, self._count)

    def parts(self, tick: float) -> list[Vector] | None:
        """As `value`, three axes to a part; None before the first update."""
        if self.newest is None:
            return None
        values: list[Vector] = []
        for decoder in self._decoders:
            value = decoder.value(tick)
            assert value is not None
            values.append(value)
        return values


class BundleEncoder:
    """The sending end of a bundle.

    The law of `Encoder`, axis by axis: on a lossless link, at every tick, each value of the mirror is within the
    deadband of its axis, or within half a wire step if that is more.

    Attributes:
        mirror: the state of the other end if no update was lost.
        coded: the last coded sample as measured; before the first, what the other end starts from.
        bound: the share of each axis' deadband that stayed unsent at the last coded sample: 1, less where the caller
            asked for less, more as a bounded rate of updates widened it.
        widened: whether the rate of updates widened it.
        predicted: the values at the other end for that sample, before any update; None if it had none.
        rejected: number of samples that were not finite, and so were not coded.
    """

    def __init__(self, channel: BundleChannel) -> None:
        self._channel = channel
        self._count = channel.count
        self._rest = parts(channel.rest) if channel.rest is not None else None
        self._predictors = [part.predictors[0] for part in channel.parts]
        self._grids = [part.grid for part in channel.parts]
        self._quantizers = [part.value_quantizer for part in channel.parts]
        self._deadbands = channel.deadbands
        self._spans = _spans(channel)
        rate = channel.parts[0].rate
        self._bucket = TokenBucket(rate, 1.0) if rate is not None else None
        self.mirror = BundleDecoder(channel)
        self.rejected = 0
        self.reset()

    def reset(self) -> None:
        """Forget the signal, because the other end started anew. Deadband and tokens stay."""
        self.mirror.reset()
        self._newest: list[Sample] = []
        self._levels: tuple[int, ...] = ()
        self._forced = False
        self.bound = 0.0
        self.widened = False
        self.coded: Joints = self.mirror.first
        self.predicted: Joints | None = None

    def restart(self) -> None:
        """Forget what was sent and send the next sample unconditionally: the other end's state is unknown."""
        self.reset()
        self._forced = True

    def retune(self, weber: float, selectors: Sequence[int] = (0,)) -> None:
        """Change the Weber factor from the next sample on; the other end need not know.

        Args:
            weber: Weber factor of the value on its own axis, >= 0.
            selectors: as of `Encoder`; a bundle has one predictor, 0.

        Raises:
            ValueError: for a factor out of its range or another selector; nothing is changed then.
        """
        if list(selectors) != [0]:
            raise ValueError(f"selectors must name some of a bank of 1 predictors, not {list(selectors)!r}")
        self._deadbands = [PerAxisDeadband(weber, each.floors, each.resolution) for each in self._deadbands]

    def encode(self, tick: int, value: Joints, position: object = None, most: float = inf) -> Update | None:  # noqa: ARG002
        """Code the sample of one tick.

        Args:
            tick: the sender's tick number, higher in every call.
            value: measured values of all axes [rad or N m]; saturated at the range of the wire.
            position: not read.
            most: largest share of each deadband that may stay unsent, >= 0; a bounded rate widens this too.

        Returns:
            The update to send; None if the prediction is good enough or the sample not finite (counted in `rejected`).

        Raises:
            ValueError: the sample has another number of axes.
        """
        if len(value) != self._count:
            raise ValueError(f"a sample has {len(value)} axes, expected {self._count}")
        if not is_finite(value):
            self.rejected += 1
            return None
        self.coded = value
        actual = [grid.confine(each) for grid, each in zip(self._quantizers, parts(value), strict=True)]
        displayed = self.mirror.parts(tick) or self._rest
        self.predicted = None if displayed is None else joined(displayed, self._count)
        allowed, bucket = min(1.0, most), self._bucket
        self.bound = share = allowed if bucket is None else bucket.widened(tick, allowed)
        self.widened = share > allowed
        forced = displayed is None or self._forced
        if not forced and displayed is not None and self._excess(displayed, actual, share) <= 1.0:
            return None
        if bucket is not None and not bucket.take(forced=forced):
            assert displayed is not None
            self.bound = max(share, self._excess(displayed, actual, 1.0))
            return None
        return self._send(tick, actual)

    def _excess(self, displayed: Sequence[Vector], actual: Sequence[Vector], share: float) -> float:
        """The largest error on an axis, in multiples of its deadband."""
        largest = 0.0
        for deadband, shown, value in zip(self._deadbands, displayed, actual, strict=True):
            largest = max(largest, deadband.excess(shown, value, share))
        return largest

    def _send(self, tick: int, actual: Sequence[Vector]) -> Update:
        """The update of a sample, which the mirror takes too."""
        levels: tuple[int, ...] = ()
        for quantizer, each in zip(self._quantizers, actual, strict=True):
            levels += quantizer.levels(each)
        samples = [
            grid.sample(tick, levels[start:end]) for grid, (start, end) in zip(self._grids, self._spans, strict=True)
        ]
        update = Update(tick, 0, levels, self._payload(tick, samples))
        self._newest, self._levels, self._forced = samples, levels, False
        self.mirror.apply(update)
        return update

    def _payload(self, tick: int, samples: Sequence[Sample]) -> PreviousSample | None:
        """The sample sent before, if a predictor reads it and it is at most `MAX_GAP` ticks old."""
        earlier = self._newest
        if not earlier or not 0 < tick - earlier[0].tick <= MAX_GAP:
            return None
        for predictor, newest, before in zip(self._predictors, samples, earlier, strict=True):
            if predictor.needs_previous(newest, before):
                return PreviousSample(tick - before.tick, self._levels)
        return None


def _spans(channel: BundleChannel) -> list[tuple[int, int]]:
    """Where the levels of each part begin and end."""
    spans, start = [], 0
    for part in channel.parts:
        end = start + part.value_quantizer.size
        spans.append((start, end))
        start = end
    return spans
