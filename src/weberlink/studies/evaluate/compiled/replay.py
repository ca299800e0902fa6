"""One signal through the compiled loop: arrays in, the same `Replay` out that the live encoder and decoder leave.

Owns which channels the loop can code, and the updates as the live codec would return them.
"""

from collections.abc import Sequence
from typing import overload

import numpy as np

from weberlink.codec import Channel, Update
from weberlink.studies.evaluate import replay as live
from weberlink.studies.evaluate.compiled.compiler import DEADBANDS, compiled, fields_of
from weberlink.studies.evaluate.compiled.loop import CODES, Array, Sends, Ticks

TIMED_SAMPLES = 1000
"""Coded by the live codec too, for the run time of a tick."""


class SentUpdates(Sequence[Update]):
    """The updates of a run, each made when it is asked for: most runs are only counted."""

    def __init__(self, sends: Sends, levels: Array) -> None:
        self._sends = sends
        self._levels = levels

    def __len__(self) -> int:
        return len(self._sends.tick)

    @overload
    def __getitem__(self, place: int) -> Update: ...
    @overload
    def __getitem__(self, place: slice) -> list[Update]: ...
    def __getitem__(self, place: int | slice) -> Update | list[Update]:
        if isinstance(place, slice):
            return [self._update(each) for each in range(len(self))[place]]
        return self._update(range(len(self))[place])

    def _update(self, place: int) -> Update:
        sends = self._sends
        gap = int(sends.gap[place])
        previous = self._at(place - 1) if gap else ()
        return Update(int(sends.tick[place]), int(sends.selector[place]), self._at(place), gap, previous)

    def _at(self, place: int) -> tuple[int, ...]:
        return tuple(int(level) for level in self._levels[place].tolist())


def replay(signal: live.Signal, channel: Channel) -> live.Replay:
    """As `evaluation.coding.replay.replay`, to the last bit.

    `tick_us` alone is measured on a part: `TIMED_SAMPLES` from the middle of the signal, through the live codec.

    Raises:
        ValueError: for a channel that is not one of forces, or with a predictor that the loop does not know.
    """
    ticks, sends = run(signal, channel)
    axes = [axis for axis in range(3) if channel.value_quantizer.highest[axis] > 0.0]
    levels = np.hstack((sends.value_levels[:, axes], sends.position_levels[:, axes]))
    return live.Replay(
        ticks.error_n,
        ticks.bound_n,
        ticks.deviation_n,
        SentUpdates(sends, levels),
        sends.selector,
        int(np.count_nonzero(sends.gap)),
        live.replay(signal.middle(TIMED_SAMPLES), channel).tick_us,
    )


def knows(channel: Channel) -> bool:
    """Whether the loop can code a channel: forces, predicted and chosen as in the paper."""
    if any(name not in CODES for name in channel.bank) or channel.adaptive or channel.smoothing is not None:
        return False
    return channel.position_quantizer is not None and type(channel.deadband) in DEADBANDS


def run(signal: live.Signal, channel: Channel) -> tuple[Ticks, Sends]:
    """The compiled loop alone. Raises as `replay` does."""
    if not knows(channel):
        raise ValueError(f"the compiled codec is for forces predicted by {', '.join(CODES)}, not by {channel.bank!r}")
    count = len(signal)
    whole, levels = np.empty((3, count), np.int64), np.empty((2, count, 3))
    noted = np.empty((3, count))
    ticks = Ticks(noted[0], noted[1], noted[2])
    sends = Sends(whole[0], whole[1], whole[2], levels[0], levels[1])
    bank = np.array([CODES[name] for name in channel.bank], np.int64)
    force, position = (np.ascontiguousarray(each, np.float64) for each in (signal.force_n, signal.position_m))
    packets = compiled()(fields_of(channel), bank, force, position, ticks, sends)
    tick, selector, gap = whole[:, :packets].copy()
    force_levels, position_levels = levels[:, :packets].copy()
    return ticks, Sends(tick, selector, gap, force_levels, position_levels)
