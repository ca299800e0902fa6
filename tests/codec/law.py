"""The law of closed-loop coding, asserted tick by tick for any channel and any samples; the table of channels."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields, replace
from itertools import chain, repeat
from math import inf, sqrt
from operator import eq
from typing import Any, NamedTuple

from tests.codec.signals import contact_stream, rubbing_stream
from weberlink.codec import Channel, Decoder, Encoder, Update, force_channel, position_channel
from weberlink.codec.channel import joint_channel
from weberlink.codec.choice import CHOICES
from weberlink.codec.coder import RAMP
from weberlink.codec.deadband import DEADBANDS, Deadband, DeadbandSetup, Reference
from weberlink.codec.predictors import PREDICTORS, suits
from weberlink.geometry.vector import ZERO, Vector, distance, is_finite, scale
from weberlink.protocol.wire import UpdateLayout

FITTED = tuple(name for name, predictor in PREDICTORS.items() if not predictor.estimated)
ESTIMATED = tuple(name for name, predictor in PREDICTORS.items() if predictor.estimated)
FORCE_PREDICTORS = (*PREDICTORS, *CHOICES)
POSITION_PREDICTORS = (*(name for name in PREDICTORS if suits(name, "position")), *CHOICES)
AXIS_BOUNDS = (0.01, 0.02, 0.03, 0.005, 0.0004, 0.1, 0.05)
"""Deadbands of the joints [rad]; one of them is finer than the wire."""
ROUNDED = 1.0 + 1e-9
OF_ANY = {each.name for each in fields(Channel)} - {"bank", "deadband"}
"""Fields of a channel that no function sets by that name."""


class Kind(NamedTuple):
    """A kind of channel: what it carries (force, position or joints), and its predictor."""

    of: str
    predictor: str

    def channel(self, **options: Any) -> Any:
        if self.of == "joints":
            axes = options.pop("axes", 5)
            return joint_channel(**{"predictor": self.predictor, "bounds": AXIS_BOUNDS[:axes], "step": 1e-3} | options)
        return make_channel(self.predictor, position=self.of == "position", **options)

    def stream(self, seed: int, *, ticks: int, axes: Any = None, rubbing: bool = False) -> list[tuple[Any, Vector]]:
        """Per tick: value and commanded position."""
        kept = axes if isinstance(axes, str) else "xyz"
        force = rubbing_stream(seed, ticks=ticks) if rubbing else contact_stream(seed, ticks=ticks, axes=kept)
        if self.of == "force":
            return list(force)
        if self.of == "position":
            return [(place, ZERO) for _, place in force]
        return [((0.1 * f[0], 0.1 * f[2], *scale(p, 3.0), f[1], p[0])[: axes or 5], ZERO) for f, p in force]


KINDS = [
    *(Kind("force", name) for name in FORCE_PREDICTORS),
    *(Kind("position", name) for name in POSITION_PREDICTORS),
    *(Kind("joints", name) for name in ("zoh", "linear")),
]


def make_channel(predictor: str, *, position: bool = False, **options: Any) -> Channel:
    """With options of its function, and of the channel."""
    own = {name: options.pop(name) for name in sorted(OF_ANY & options.keys())}
    return replace((position_channel if position else force_channel)(predictor=predictor, **options), **own)


def shaped(name: str, weber: float, floor: float, reference: Reference = "actual") -> Deadband:
    """A deadband of a force, with the floor that it needs at least."""
    kind = DEADBANDS[name]
    least = max(floor, 1e-3) if kind.needs_floor else floor
    return kind.configured(DeadbandSetup(weber, least, reference, 1e-3, kind.Options()))


def shown_by(decoder: Decoder, tick: float, place: Vector = ZERO) -> Any:
    return decoder.joints(tick) if decoder.is_arm else decoder.value(tick, place)


def half_step(channel: Channel) -> float:
    """The largest rounding error of a sample on the wire."""
    quantizer = channel.value_quantizer
    return 0.5 * quantizer.step * sqrt(quantizer.size) * ROUNDED


class Tick(NamedTuple):
    """One coded sample: the update sent, the value displayed then, the deadband, and the distance of the two values."""

    update: Update | None
    shown: Any
    bound: float
    error: float


class Law:
    """Both ends of a channel on a lossless link, which assert the law at every tick.

    `beyond`: the most updates beyond the bounded rate, over all stretches of ticks; forced ones left out.
    """

    def __init__(self, channel: Any, *, encoder: Any = None) -> None:
        self.channel = channel
        self.encoder, self.decoder = encoder or Encoder(channel), Decoder(channel)
        self.late, self.rate, self.smoothing = channel.lookahead, channel.rate, channel.smoothing
        self.step, self.limit = channel.value_quantizer.step, channel.value_quantizer.limit
        self.layout = UpdateLayout(channel.forms) if self.limit < 1e6 else None
        self.deadband = channel.deadband
        self.weber = channel.deadband.weber if channel.joints else 0.0
        self.waiting: dict[int, tuple[Any, Vector, float]] = {}
        self.last: Vector | None = None
        self.forced = False
        self.beyond = self.excess = 0.0
        self.counted: int | None = None

    def restart(self) -> None:
        """The other end begins anew, and the next sample is sent in any case."""
        self.encoder.restart()
        self.decoder.reset()
        self.forced, self.last = True, None

    def reset(self) -> None:
        """Both ends begin anew."""
        self.encoder.reset()
        self.decoder.reset()
        self.waiting.clear()
        self.forced, self.last = False, None

    def retune(self, deadband: Deadband, selectors: Sequence[int], tick: int = 0, more: Sequence[Any] = ()) -> None:
        self.encoder.retune(deadband, selectors, more)
        self.decoder.retune(deadband, tick)
        self.deadband = deadband
        self.weber = deadband.weber if self.channel.joints else 0.0  # type: ignore[attr-defined]
        self.last = self.last if deadband.reads_motion else None
        if self.decoder.newest is not None:
            self.forced = self.decoder.selected not in selectors

    def tick(self, tick: int, sample: tuple[Any, Vector] | None, most: float = inf) -> Tick | None:
        """Code a sample, or none; returns None if no sample is due in this tick."""
        before, rejected = self.encoder.mirror.newest, self.encoder.rejected
        if sample is None:
            update = self.encoder.decide(tick) if self.late else None
        else:
            update = self.encoder.encode(tick, *sample, most)
            good = is_finite(sample[1]) and all(each - each == 0.0 for each in sample[0])
            assert self.encoder.rejected == rejected + (not good)
            if good:
                self.waiting[tick] = (*sample, most)
        due = self.waiting.pop(tick - self.late, None)
        if due is None:
            assert update is None
            return None
        if update is not None:
            assert update.tick == tick - self.late
            if self.layout is not None:
                self.layout.check(update)
                shortest, longest = self.layout.lengths
                assert shortest <= self.layout.length(update) <= longest
            self.decoder.apply(update)
            if tick % 3 == 0:
                self.decoder.apply(update)  # one that is repeated changes nothing
        value, place, most = due
        shown = shown_by(self.decoder, tick, place)
        # Evaluated once per tick, as in a session: a surface with friction remembers the position.
        assert shown == (self.encoder.predicted if update is None else shown_by(self.encoder.mirror, tick, place))
        if update is not None:
            assert repr(self.decoder.state) == repr(self.encoder.mirror.state)  # an unknown position is unlike itself
        self._check_decision(tick, update, value, place, most, before)
        self.forced = self.forced and update is None
        if shown is None:
            return Tick(update, shown, self.encoder.bound, inf)
        return Tick(update, shown, self.encoder.bound, self._check_error(update, shown, value))

    def _check_decision(
        self, tick: int, update: Update | None, value: Any, place: Vector, most: float, before: Any
    ) -> None:
        """The bound is that of the deadband, and a sample is sent exactly if its prediction is beyond it."""
        encoder, predicted = self.encoder, self.encoder.predicted
        assert encoder.coded == value
        forced = self.forced or predicted is None
        if self.channel.joints:
            allowed, least = min(1.0, most), 0.0
            missed = inf if predicted is None else self.axes_beyond(predicted, value, encoder.bound) * encoder.bound
        else:
            actual = self.channel.value_quantizer.confine(value)
            compared = actual if predicted is None else predicted
            moving = actual if self.channel.position_quantizer is None else place
            moved = 0.0 if self.last is None or not self.deadband.reads_motion else distance(moving, self.last)
            self.last = moving
            allowed = min(
                self.deadband.bound(actual, compared, compared if before is None else before.value, moved), most
            )
            least = self.deadband.error(self.channel.value_quantizer.quantize(actual)[1], actual)
            missed = inf if predicted is None else self.deadband.error(predicted, actual)
        needed = forced or (missed > encoder.bound and missed > least)
        if self.rate is None:
            assert (encoder.bound, encoder.widened) == (allowed, False)
            assert (update is not None) == needed
            return
        assert encoder.bound >= allowed
        assert update is None or needed
        passed = tick - self.counted if self.counted is not None else 0
        self.counted = tick
        self.excess = max(0.0, self.excess - passed * self.rate.per_tick) + (update is not None and not forced)
        self.beyond = max(self.beyond, self.excess)

    def _check_error(self, update: Update | None, shown: Any, value: Any) -> float:
        """The value displayed is within the deadband of the measured one, or within the rounding of the wire."""
        if self.channel.joints:
            bound = self.encoder.bound
            # Where a token was missing, the share is of a deadband that is no finer than the wire.
            assert self.axes_beyond(shown, value, bound, max(1.0, bound) if self.rate else 1.0) <= ROUNDED
            limit = self.limit
            error = max(abs(one - max(-limit, min(limit, each))) for one, each in zip(shown, value, strict=True))
            assert update is None or error <= 0.5 * self.step * (1.0 + 1e-8)
            return error
        channel, band, bound = self.channel, self.deadband, self.encoder.bound
        actual = channel.value_quantizer.confine(value)
        assert all(map(eq, channel.value_quantizer.confine(shown), shown))  # NaN is not equal to itself
        near = max(half_step(channel), band.error(channel.value_quantizer.quantize(actual)[1], actual))
        if update is not None:
            if self.smoothing:
                # The ramp takes a share of the deadband at the sample, which is rounded.
                newest = self.encoder.mirror.newest.value
                ramp = RAMP * band.bound(newest, newest, newest, 0.0) + near
                bound = max(band.bound(actual, shown, newest, 0.0), bound, ramp)
            elif self.decoder.first == self.decoder.newest.value:  # a model may begin elsewhere in the deadband
                bound = near
        assert band.error(shown, actual) <= max(bound * ROUNDED, near)
        return distance(shown, actual)

    def axes_beyond(self, shown: Sequence[float], value: Sequence[float], share: float, finest: float = 1.0) -> float:
        """The largest error on an axis in shares of its deadband; none is finer than `finest` times half a step."""
        limit, finest = self.limit, finest * 0.5 * self.step * ROUNDED
        within = [max(-limit, min(limit, each)) for each in value]
        return max(
            abs(one - each) / max(share * max(self.weber * abs(each), bound), finest)
            for one, each, bound in zip(shown, within, AXIS_BOUNDS, strict=False)
        )


def coded(
    channel: Channel, samples: Sequence[tuple[Vector, Vector]], limits: Iterable[float] = (), start: int = 0
) -> Iterator[Tick]:
    """Code finite samples, one per tick, under the law; after the last one until all are coded.

    `limits` are of the errors that may stay unsent, one per tick; infinite where there are none left.
    """
    law = Law(channel)
    for tick, (sample, most) in enumerate(zip(samples, chain(limits, repeat(inf)), strict=False), start):
        found = law.tick(tick, sample, most)
        if found is not None:
            yield found
    for tick in range(start + len(samples), start + len(samples) + law.late):
        found = law.tick(tick, None)
        if found is not None:
            yield found


def sends(channel: Channel, samples: Sequence[tuple[Vector, Vector]]) -> int:
    return sum(tick.update is not None for tick in coded(channel, samples))
