"""The coding loop: a signal runs through an encoder and a decoder, tick by tick, as in the two daemons."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from itertools import chain, repeat
from typing import NamedTuple

from weberlink.codec.channel import Channel
from weberlink.codec.decoder import Decoder
from weberlink.codec.encoder import Encoder
from weberlink.codec.predictors import Model
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector, distance
from weberlink.update import Update


class CodedTick(NamedTuple):
    """What happened in the tick in which one sample was coded: with look-ahead, that many ticks after its own.

    Args:
        update: the update sent in this tick; None if the prediction was good enough.
        predicted: value at the other end before any update of this sample [N or m]; zero if it had none.
        displayed: value at the other end after the updates that arrived in this tick [N or m].
        error: distance of `displayed` from the sample [N or m]; `channel.deadband.error` may measure otherwise.
        bound: the deadband of the sample, to compare with `channel.deadband.error`.
        selected: index in the bank of the predictor in use at the decoder.
        model: the model in use at the decoder; None before the first update.
        seconds: run time of encode and decode by the stopwatch [s].
        widened: whether the bounded rate of updates widened the deadband.
    """

    update: Update | None
    predicted: Joints
    displayed: Vector
    error: float
    bound: float
    selected: int
    model: Model | None
    seconds: float
    widened: bool = False


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
        channel: the channel of both ends.
        samples: value and position of each tick, from tick 0; the position is not read on a position channel. With
            look-ahead the ticks go on after the last sample until all are coded.
        delay_ticks: one-way delay of an update [ticks], >= 0.
        stopwatch: returns the time from any origin [s], to measure run time; by default none is measured.
        encoder: a new one of the channel by default; likewise `decoder`. Both may be read between ticks.

    Yields:
        One `CodedTick` for each sample; the models are evaluated at its position.
    """
    encoder, decoder = encoder or Encoder(channel), decoder or Decoder(channel)
    encode, decide, apply, value = encoder.encode, encoder.decide, decoder.apply, decoder.value
    under_way: deque[tuple[int, Update]] = deque()
    waiting: deque[tuple[Vector, Vector]] = deque()
    late = channel.lookahead
    coming: Iterator[tuple[Vector, Vector] | None] = chain(samples, repeat(None, late))
    for tick, new in enumerate(coming):
        if new is not None:
            (fx, fy, fz), (px, py, pz) = new
            # New tuples, as in a daemon, which has just made them: the measured run time includes no cache misses.
            waiting.append(((fx, fy, fz), (px, py, pz)))
        began = stopwatch()
        update = decide(tick) if new is None else encode(tick, *waiting[-1])
        if tick < late or not waiting:
            continue
        sample, position = waiting.popleft()
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
            encoder.widened,
        )
