"""The coding loop: a signal runs through an encoder and a decoder, tick by tick, as in the two daemons."""

from collections.abc import Callable, Iterable

from weberlink.codec.channel import Channel
from weberlink.codec.coder import Decoder, Encoder
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector
from weberlink.update import Update


class Coded:
    """What happened to each sample of a signal, in the tick in which it was coded: with look-ahead, that much later."""

    def __init__(self) -> None:
        self.updates: list[Update | None] = []  # None if the prediction was good enough
        self.predicted: list[Joints] = []  # at the other end before any update of the sample [N or m]; zero for nothing
        self.displayed: list[Joints] = []  # at the other end after the updates that arrived in this tick [N or m]
        self.bounds: list[float] = []  # the deadband, to compare with `channel.deadband.error`
        self.selected: list[int] = []  # index in the bank of the predictor in use at the decoder
        self.widened: list[bool] = []  # whether the bounded rate of updates widened the deadband
        self.seconds: list[float] = []  # run time of encode and decode by the stopwatch [s]; empty without one


def code(
    channel: Channel, samples: Iterable[tuple[Vector, Vector]], *, stopwatch: Callable[[], float] | None = None
) -> Coded:
    """Code a signal over a link without loss and delay.

    There the decoder is the encoder's mirror of it. One of its own runs beside it only where run time is measured.

    Args:
        channel: the channel of both ends.
        samples: value and position of each tick, from tick 0; the position is not read on a position channel. With
            look-ahead the ticks go on after the last sample until all are coded.
        stopwatch: returns the time from any origin [s], to measure run time; None to measure none.
    """
    encoder, coded = Encoder(channel), Coded()
    decoder = encoder.mirror if stopwatch is None else Decoder(channel)
    given, late = [*samples], channel.lookahead
    began = 0.0
    for tick in range(len(given) + late):
        rejected = encoder.rejected
        if stopwatch is not None:
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
            decoder.apply(update)
        displayed: Joints | None
        if update is None and stopwatch is None and late == 0 and encoder.rejected == rejected:
            displayed = encoder.predicted  # by the same model, in this tick
        else:
            displayed = decoder.value(tick, given[tick - late][1])
        if stopwatch is not None:
            coded.seconds.append(stopwatch() - began)
        coded.updates.append(update)
        coded.predicted.append(encoder.predicted or ZERO)
        coded.displayed.append(displayed or ZERO)
        coded.bounds.append(encoder.bound)
        coded.selected.append(decoder.selected)
        coded.widened.append(encoder.widened)
    return coded
