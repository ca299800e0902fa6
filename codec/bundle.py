"""A bundle: the joints of an arm as one coded signal, of which every update carries all axes.

The axes are cut into parts of three (`weberlink.geometry.joints`), each an ordinary channel. One decision is made for
all of them: where one axis leaves its deadband, all are sent. So an update restores the whole decoder, and the joints
of an arm are always of the same moment.
"""

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from weberlink.codec.channel import Channel
from weberlink.codec.deadband.per_axis import PerAxisDeadband
from weberlink.codec.decoder import Decoded, Decoder
from weberlink.codec.encoder import Encoder
from weberlink.codec.predictors import PREDICTORS
from weberlink.codec.predictors.model import ModelRecord
from weberlink.codec.rate import TokenBucket, UpdateRate
from weberlink.codec.sample import Quantizer, Sample
from weberlink.geometry.joints import Joints, is_finite, joined, parts, widths
from weberlink.geometry.vector import Vector
from weberlink.update import Payload, PreviousSample, Update, UpdateForm

ROUNDING = 0.5 * (1.0 + 1e-9)
"""Largest rounding error of the wire [steps], with that of the arithmetic."""


class BundleChannel(NamedTuple):
    """One coded direction of a bundle: what its two ends must agree on. `joint_channel` makes one.

    Args:
        parts: channels of three axes, the last one of 1 to 3, which differ in axes and thresholds only.
        deadbands: of the parts.
        rest: values at both ends before the first update; None if nothing can be assumed.
        rate: largest rate of updates of the whole bundle; None for no limit. The receiver does not need it.
    """

    parts: tuple[Channel, ...]
    deadbands: tuple[PerAxisDeadband, ...]
    rest: Joints | None
    rate: UpdateRate | None

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of axes of each part."""
        return tuple([part.value_quantizer.size for part in self.parts])

    @property
    def forms(self) -> tuple[UpdateForm, ...]:
        """What updates carry: a group of levels for each part."""
        return (UpdateForm(self.sizes, self.sizes),)

    @property
    def limit(self) -> float:
        """Largest magnitude on an axis that the wire can carry."""
        return self.parts[0].value_quantizer.limit


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
        rest: as of `BundleChannel`; `rate` likewise.

    Raises:
        ValueError: as `Channel`; for a predictor that does not suit a bundle, or a number out of its range.
    """
    if rest is not None and len(rest) != len(bounds):
        raise ValueError(f"rest has {len(rest)} axes, bounds {len(bounds)}")
    rests: list[Vector | None] = [None] * len(bounds)
    if rest is not None:
        rests = [*parts(rest)]
    made: list[Channel] = []
    deadbands: list[PerAxisDeadband] = []
    for index, width in enumerate(widths(len(bounds))):
        x, y, z = (*bounds[3 * index :], inf, inf)[:3]  # an axis that the part does not have is never beyond
        deadband = PerAxisDeadband(weber, (x, y, z), ROUNDING * step)
        quantizer = Quantizer(step, "xyz"[:width])
        made.append(Channel((predictor,), deadband, quantizer, rest=rests[index], tick_period=tick_period))
        deadbands.append(deadband)
    if PREDICTORS[predictor].estimated:
        raise ValueError(f"{predictor}: sends parameters; a bundle of joints needs one such as zoh or linear")
    return BundleChannel(tuple(made), tuple(deadbands), rest, rate)


class BundleDecoder:
    """The receiving end of a bundle; the laws and the members of `Decoder`.

    Args:
        channel: of both ends.
        decoders: of the parts; by default new ones.
    """

    selected = 0
    surface = None

    def __init__(self, channel: BundleChannel, decoders: Sequence[Decoder] | None = None) -> None:
        self._count = sum(channel.sizes)
        self._rest = channel.rest or (0.0,) * self._count
        ends = [3 * (index + 1) for index in range(len(channel.sizes))]
        self._slices = [slice(end - 3, end if end < self._count else None) for end in ends]
        self._decoders = list(decoders) if decoders is not None else [Decoder(part) for part in channel.parts]

    def reset(self) -> None:
        """Forget the signal: `value` returns the channel's `rest` until the first update."""
        for decoder in self._decoders:
            decoder.reset()

    @property
    def state(self) -> tuple[object, ...]:
        """All that a prediction depends on."""
        return tuple([decoder.state for decoder in self._decoders])

    @property
    def newest(self) -> Sample | None:
        """The newest sample received, of the first part; None before the first."""
        return self._decoders[0].newest

    @property
    def first(self) -> Joints:
        """The newest values received; before the first, the channel's `rest`, or zeros."""
        if self.newest is None:
            return self._rest
        return joined([decoder.first for decoder in self._decoders], self._count)

    @property
    def record(self) -> ModelRecord:
        """The model in use, as telemetry records it."""
        return self._decoders[0].record

    def apply(self, update: Update) -> None:
        """Replace the state by that of an update.

        Raises:
            ValueError: if selector, number of levels or payload do not fit the channel; the state is unchanged then.
        """
        payload = update.payload
        read: list[tuple[Decoder, Update, Decoded]] = []
        for decoder, own in zip(self._decoders, self._slices, strict=True):
            if isinstance(update.payload, PreviousSample):
                payload = PreviousSample(update.payload.gap, update.payload.levels[own])
            part = Update(update.tick, update.selector, update.newest[own], payload)
            read.append((decoder, part, decoder.read(part)))
        for decoder, part, decoded in read:
            decoder.take(part, decoded)

    def value(self, tick: float, position: object = None) -> Joints | None:  # noqa: ARG002 - no part reads it
        """As `Decoder.value`, of all axes [rad or N m]."""
        values = self.parts(tick)
        return None if values is None else joined(values, self._count)

    def parts(self, tick: float) -> list[Vector] | None:
        """As `value`, three axes to a part."""
        values: list[Vector] = []
        for decoder in self._decoders:
            value = decoder.value(tick)
            if value is None:
                return None
            values.append(value)
        return values


class BundleEncoder:
    """The sending end of a bundle; the law of `Encoder` holds on each axis, and its members are those of `Encoder`.

    `bound` is the share of each axis' deadband that stays unsent: 1, less where the caller asks for less, more where a
    bounded rate of updates widens it.
    """

    def __init__(self, channel: BundleChannel) -> None:
        self._parts = [Encoder(part) for part in channel.parts]
        self._grids = [part.grid for part in channel.parts]
        self._deadbands = list(channel.deadbands)
        self._count = sum(channel.sizes)
        self._bucket = TokenBucket(channel.rate, 1.0) if channel.rate is not None else None
        self.mirror = BundleDecoder(channel, [part.mirror for part in self._parts])
        self.rejected = 0
        self.reset()

    def reset(self) -> None:
        """Forget the signal, because the other end started anew. Deadband and tokens stay."""
        for part in self._parts:
            part.reset()
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

    def retune(self, weber: float) -> None:
        """Change the Weber factor (>= 0) from the next sample on; the other end need not know.

        Raises:
            ValueError: for a factor out of its range; nothing is changed then.
        """
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
        actual = [grid.value.confine(each) for grid, each in zip(self._grids, parts(value), strict=True)]
        displayed = self.mirror.parts(tick)
        self.predicted = None if displayed is None else joined(displayed, self._count)
        allowed, bucket = min(1.0, most), self._bucket
        self.bound = share = allowed if bucket is None else bucket.widened(tick, allowed)
        self.widened = share > allowed
        forced = displayed is None or self._forced
        if displayed is not None and not forced and self._excess(displayed, actual, share) <= 1.0:
            return None
        if bucket is not None and not bucket.take(forced=forced):
            assert displayed is not None  # otherwise it was forced
            self.bound = max(share, self._excess(displayed, actual, 1.0))
            return None
        levels: tuple[int, ...] = ()
        payload: Payload = None
        for part, grid, each in zip(self._parts, self._grids, actual, strict=True):
            own = grid.value.levels(each)
            update = part.send(grid.sample(tick, own), own, each)
            levels += own
            if isinstance(update.payload, PreviousSample):  # where one part reads it, it travels for all
                payload = PreviousSample(update.payload.gap, self._levels)
        self._levels, self._forced = levels, False
        return Update(tick, 0, levels, payload)

    def _excess(self, displayed: Sequence[Vector], actual: Sequence[Vector], share: float) -> float:
        """The largest error on an axis, in multiples of its deadband."""
        largest = 0.0
        for deadband, shown, value in zip(self._deadbands, displayed, actual, strict=True):
            largest = max(largest, deadband.excess(shown, value, share))
        return largest
