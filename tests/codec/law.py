"""The law of closed-loop coding, asserted tick by tick for any channel and any finite samples."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, repeat
from math import inf, sqrt
from typing import Any, NamedTuple

from weberlink.codec import Channel, Decoder, Encoder, Update, force_channel, position_channel
from weberlink.codec.predictors import PREDICTORS
from weberlink.geometry.vector import Vector, distance

FITTED = tuple(name for name, predictor in PREDICTORS.items() if not predictor.estimated)
ESTIMATED = tuple(name for name, predictor in PREDICTORS.items() if predictor.estimated)
FORCE_PREDICTORS = (*FITTED, "hybrid", *ESTIMATED, "adaptive")
POSITION_PREDICTORS = ("zoh", "linear", "hybrid", "path", "adaptive")
POSITION_BANKS = {"hybrid": ("zoh", "linear"), "adaptive": ("zoh", "linear", "path")}


class Tick(NamedTuple):
    """One coded sample: the update sent, the value displayed then, the deadband, and the distance of the two values."""

    update: Update | None
    shown: Vector
    bound: float
    error: float


def make_channel(predictor: str, *, position: bool = False, **options: Any) -> Channel:
    if position:
        return position_channel(predictor=predictor, bank=POSITION_BANKS.get(predictor, ()), **options)
    return force_channel(predictor=predictor, **options)


def half_step(channel: Channel) -> float:
    """The largest rounding error of a sample on the wire."""
    quantizer = channel.value_quantizer
    return 0.5 * quantizer.step * sqrt(quantizer.size) * (1.0 + 1e-9)


def coded(
    channel: Channel,
    samples: Sequence[tuple[Vector, Vector]],
    encoder: Encoder | None = None,
    start: int = 0,
    limits: Iterable[float] = (),
) -> Iterator[Tick]:
    """Code finite samples, one per tick; assert that both ends hold the same state, and the error is in the deadband.

    `limits` are of the errors that may stay unsent, one per tick; infinite where there are none left.

    A sample that is sent is displayed within the rounding of the wire. With look-ahead a path may begin anywhere in the
    deadband around it; after the last sample the ticks go on until all are coded.
    """
    encoder, decoder = encoder or Encoder(channel), Decoder(channel)
    near, late = half_step(channel), channel.lookahead
    taken = [(*sample, most) for sample, most in zip(samples, chain(limits, repeat(inf)), strict=False)]
    for index in range(len(taken) + late):
        tick = start + index
        update = encoder.encode(tick, *taken[index]) if index < len(taken) else encoder.decide(tick)
        if not 0 <= index - late < len(taken):
            assert update is None
            continue
        value, position, _ = taken[index - late]
        if update is not None:
            assert update.tick == tick - late
            decoder.apply(update)
        shown = decoder.value(tick, position)
        assert shown is not None
        assert repr(decoder.state) == repr(encoder.mirror.state)  # an unknown position is not equal to itself
        # Evaluated once per tick, as in a session: a surface with friction remembers the position.
        assert shown == (encoder.predicted if update is None else encoder.mirror.value(tick, position))
        actual = channel.value_quantizer.confine(value)
        error, deviation = distance(shown, actual), channel.deadband.error(shown, actual)
        sent = update is not None and not (late and update.payload is not None)
        assert error <= near if sent else deviation <= max(encoder.bound * (1.0 + 1e-12), near)
        yield Tick(update, shown, encoder.bound, error)


def sends(channel: Channel, samples: Sequence[tuple[Vector, Vector]]) -> int:
    return sum(tick.update is not None for tick in coded(channel, samples))
