"""The coding loop: a signal runs through an encoder and a decoder, tick by tick, as in the two daemons."""

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from weberlink.codec.channel import Channel
from weberlink.codec.decoder import Decoder
from weberlink.codec.encoder import Encoder
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector
from weberlink.update import Update


class Coded:
    """What happened to each sample of a signal, in the tick in which it was coded: with look-ahead, that much later.

    Attributes:
        updates: the update sent in this tick; None if the prediction was good enough.
        predicted: value at the other end before any update of this sample [N or m]; zero if it had none.
        displayed: value at the other end after the updates that arrived in this tick [N or m].
        bounds: the deadband of the sample, to compare with `channel.deadband.error`.
        selected: index in the bank of the predictor in use at the decoder.
        widened: whether the bounded rate of updates widened the deadband.
        seconds: run time of encode and decode by the stopwatch [s].
    """

    def __init__(self) -> None:
        self.updates: list[Update | None] = []
        self.predicted: list[Joints] = []
        self.displayed: list[Vector] = []
        self.bounds: list[float] = []
        self.selected: list[int] = []
        self.widened: list[bool] = []
        self.seconds: list[float] = []


def code(
    channel: Channel,
    samples: Iterable[Any],
    *,
    delay_ticks: int = 0,
    stopwatch: Callable[[], float] = lambda: 0.0,
) -> Coded:
    """Code a signal over a link without loss.

    Args:
        channel: the channel of both ends.
        samples: value and position of each tick, from tick 0, three numbers each; the position is not read on a
            position channel. With look-ahead the ticks go on after the last sample until all are coded.
        delay_ticks: one-way delay of an update [ticks], >= 0.
        stopwatch: returns the time from any origin [s], to measure run time; by default none is measured.
    """
    encoder, decoder, coded = Encoder(channel), Decoder(channel), Coded()
    given, late = [*samples], channel.lookahead
    under_way: deque[tuple[int, Update]] = deque()
    for tick in range(len(given) + late):
        began = stopwatch()
        if tick < len(given):
            (fx, fy, fz), (px, py, pz) = given[tick]
            # New tuples, as in a daemon, which has just made them: the measured run time includes no cache misses.
            update = encoder.encode(tick, (fx, fy, fz), (px, py, pz))
        else:
            update = encoder.decide(tick)
        if tick < late:
            continue
        if update is not None:
            under_way.append((tick + delay_ticks, update))
        while under_way and under_way[0][0] <= tick:
            decoder.apply(under_way.popleft()[1])
        x, y, z = given[tick - late][1]
        displayed = decoder.value(tick, (x, y, z)) or ZERO
        coded.seconds.append(stopwatch() - began)
        coded.updates.append(update)
        coded.predicted.append(encoder.predicted or ZERO)
        coded.displayed.append(displayed)
        coded.bounds.append(encoder.bound)
        coded.selected.append(decoder.selected)
        coded.widened.append(encoder.widened)
    return coded
