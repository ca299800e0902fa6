"""The law of closed-loop coding, asserted tick by tick for any channel and any finite samples."""

from collections.abc import Iterator, Sequence
from math import sqrt
from typing import NamedTuple

from weberlink.codec import Channel, Decoder, Encoder, Update
from weberlink.codec.predictors import PARAMETRIC
from weberlink.geometry.vector import Vector, distance

FORCE_PREDICTORS = ("zoh", "linear", "plane", "sphere", "hybrid", *PARAMETRIC, "adaptive")
POSITION_PREDICTORS = ("zoh", "linear", "hybrid", "trend", "adaptive")
POSITION_BANKS = {"hybrid": ("zoh", "linear"), "adaptive": ("zoh", "linear", "trend")}


class Tick(NamedTuple):
    """What became of a sample.

    Args:
        update: that was sent.
        shown: what the other end displays then.
        bound: the deadband.
        error: distance of what is displayed from the sample, within the range of the wire.
    """

    update: Update | None
    shown: Vector
    bound: float
    error: float


def half_step(channel: Channel) -> float:
    """The farthest that a sample can be from what the wire says of it."""
    quantizer = channel.value_quantizer
    return 0.5 * quantizer.step * sqrt(quantizer.size) * (1.0 + 1e-9)


def coded(
    channel: Channel, samples: Sequence[tuple[Vector, Vector]], encoder: Encoder | None = None, start: int = 0
) -> Iterator[Tick]:
    """Code finite samples, one a tick, with what must hold of each asserted.

    The sample that is sent is displayed as near as the wire can say it. A line of `trend` begins within the deadband
    of it instead, or as near as the wire can say it where that is further.
    """
    encoder, decoder = encoder or Encoder(channel), Decoder(channel)
    near = half_step(channel)
    for tick, (value, position) in enumerate(samples, start):
        update = encoder.encode(tick, value, position)
        if update is not None:
            decoder.apply(Update(*update))
        shown = decoder.value(tick, position)
        assert shown is not None
        assert decoder.state == encoder.mirror.state
        # Asked once a tick, as a loop does: a surface with friction takes note of the way.
        assert shown == (encoder.predicted if update is None else encoder.mirror.value(tick, position))
        error = distance(shown, channel.value_quantizer.confine(value))
        begins_aside = update is not None and channel.bank[update.selector] == "trend" and update.previous
        allowed = max(encoder.bound * (1.0 + 1e-12), near) if update is None or begins_aside else near
        assert error <= allowed
        yield Tick(update, shown, encoder.bound, error)


def sends(channel: Channel, samples: Sequence[tuple[Vector, Vector]]) -> int:
    return sum(tick.update is not None for tick in coded(channel, samples))
