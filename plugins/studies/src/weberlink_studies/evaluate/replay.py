"""One recorded signal through a fresh encoder and decoder, sample by sample as in a daemon."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel, Update
from weberlink.codec.replay import code
from weberlink.geometry.vector import Vector
from weberlink.master.trace import Trace

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]
TIMED = 300
"""Samples whose coding is timed: those of the middle, where the hand is in contact."""


@dataclass(frozen=True)
class Signal:
    """Force and position over time."""

    force_n: Array  # shape (n, 3) [N]
    position_m: Array  # shape (n, 3) [m]
    period_s: float  # time between samples

    def __len__(self) -> int:
        return len(self.force_n)

    @cached_property
    def samples(self) -> list[tuple[Vector, Vector]]:
        """Force and position of each tick as tuples, which are faster than arrays."""
        return list(zip(_vectors(self.force_n), _vectors(self.position_m), strict=True))

    @property
    def duration_s(self) -> float:
        """One period for each sample."""
        return len(self) * self.period_s


@dataclass(frozen=True)
class ReplayResult:
    """The result of a coded signal."""

    error_n: Array  # distance of the decoded force from the measured one at each tick, shape (n,) [N]
    bound_n: Array  # the deadband at each tick, shape (n,) [N]
    deviation_n: Array  # the error in the measure of the deadband, to compare with the bound, shape (n,) [N]
    widened: Flags  # whether the bounded rate of updates widened the deadband at each tick, shape (n,)
    displayed_n: Array  # magnitude of the decoded force at each tick, shape (n,) [N]
    jump_n: Array  # change of the decoded force from the tick before, in each tick with an update but the first, [N]
    before_n: Array  # magnitude of the decoded force before each jump, in the same shape [N]
    updates: Sequence[Update]  # those sent
    selected: Integers  # index in the bank of the predictor of each update, shape (packets,)
    tick_us: float  # median run time of encode plus decode, of `TIMED` samples


def signal_of(trace: Trace) -> Signal:
    return Signal(trace.force_n, trace.position_m, trace.period_s)


def replay(signal: Signal, channel: Channel) -> ReplayResult:
    """Run a signal through the codec of a force channel, on a link without loss and delay."""
    samples = signal.samples
    first = max(0, len(samples) - TIMED) // 2
    coded = code(channel, samples)
    seconds = code(channel, samples[first : first + TIMED], stopwatch=perf_counter).seconds
    shown = np.fromiter(chain.from_iterable(coded.displayed), np.float64).reshape(-1, 3)
    sent = np.array([update is not None for update in coded.updates])
    errors = deviations = _lengths(shown - signal.force_n)
    if not channel.deadband.is_ball:
        measure = channel.deadband.error
        pairs = zip(coded.displayed, signal.samples, strict=True)
        deviations = np.array([measure((x, y, z), force) for (x, y, z), (force, _) in pairs])
    displayed = _lengths(shown)
    updates = [update for update in coded.updates if update is not None]
    return ReplayResult(
        errors,
        np.array(coded.bounds),
        deviations,
        np.array(coded.widened),
        displayed,
        _lengths(np.diff(shown, axis=0)[sent[1:]]),
        displayed[:-1][sent[1:]],
        updates,
        np.array([update.selector for update in updates], np.int64),
        1e6 * float(np.median(seconds)),
    )


def _lengths(vectors: Array) -> Array:
    x, y, z = vectors.T
    lengths: Array = np.sqrt(x * x + y * y + z * z)
    return lengths


def _vectors(array: Array) -> list[Vector]:
    return [(x, y, z) for x, y, z in array.tolist()]
