"""The coding loop: a signal through an encoder and a decoder, tick by tick, as the two daemons would run them."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from weberlink.codec.channel import Channel
from weberlink.codec.decoder import Decoder
from weberlink.codec.encoder import Encoder
from weberlink.codec.predictors import Model
from weberlink.geometry.vector import ZERO, Vector, distance
from weberlink.update import Update


class CodedTick(NamedTuple):
    """What happened in one tick.

    Args:
        update: sent in this tick; None where the prediction was good enough.
        predicted: what the other end held of the sample before any update of it [N or m]; zero while it held nothing.
        displayed: what it holds after the updates that arrived in this tick.
        error: distance of `displayed` from the sample. `channel.deadband.error` may measure otherwise.
        bound: the deadband, in the measure of the deadband.
        selected: index in the bank of the predictor in use at the decoder.
        model: in use at the decoder; None before the first update.
        seconds: run time of encode plus decode by the stopwatch.
    """

    update: Update | None
    predicted: Vector
    displayed: Vector
    error: float
    bound: float
    selected: int
    model: Model | None
    seconds: float


def code(
    channel: Channel,
    samples: Iterable[tuple[Vector, Vector]],
    *,
    delay_ticks: int = 0,
    stopwatch: Callable[[], float] = lambda: 0.0,
    encoder: Encoder | None = None,
    decoder: Decoder | None = None,
) -> Iterator[CodedTick]:
    """Code a signal over a link without loss.

    Args:
        channel: as both ends build it.
        samples: value and position of each tick, from tick 0; on a position channel the second is not read.
        delay_ticks: after which an update arrives.
        stopwatch: seconds from any origin, to measure the run time; nothing is measured by default.
        encoder: a fresh one of the channel by default; likewise `decoder`. Both may be read between ticks.
    """
    encoder, decoder = encoder or Encoder(channel), decoder or Decoder(channel)
    encode, apply, value = encoder.encode, decoder.apply, decoder.value
    under_way: deque[tuple[int, Update]] = deque()
    for tick, ((fx, fy, fz), (px, py, pz)) in enumerate(samples):
        # Made here, as a daemon has just made them: a vector from elsewhere in memory would have to be fetched first.
        sample, position = (fx, fy, fz), (px, py, pz)
        began = stopwatch()
        update = encode(tick, sample, position)
        if update is not None:
            if delay_ticks:
                under_way.append((tick + delay_ticks, update))
            else:
                apply(update)
        while under_way and under_way[0][0] <= tick:
            apply(under_way.popleft()[1])
        displayed = value(tick, position) or ZERO
        seconds = stopwatch() - began
        yield CodedTick(
            update,
            encoder.predicted or ZERO,
            displayed,
            distance(displayed, sample),
            encoder.bound,
            decoder.selected,
            decoder.model,
            seconds,
        )
