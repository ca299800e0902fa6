"""Coding of one signal: packets, displayed force and its error; equal packet rates; run time of a tick."""

from collections.abc import Callable, Sequence
from math import exp, log, sqrt
from time import perf_counter
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from weberlink.codec import Channel, Decoder, Encoder
from weberlink.codec.replay import code
from weberlink.studies.adaptive.comparison import CostRow
from weberlink.studies.adaptive.variants import channel_of
from weberlink.studies.evaluate.replay import Array, Signal
from weberlink.system.scoring.perception import Threshold, in_units, rms

HIGH = 99.9
"""Percentile of the force steps."""
TOLERANCE = 0.02
"""Relative difference at which two packet counts are equal."""
RUNS = 8
"""Most runs of a search, unless the caller says otherwise."""
UNFAIR = 2.0
"""Weight of a packet too many against one too few: the compared encoder must not send more."""
LEAST, MOST = 1e-3, 0.8
"""Range of the Weber factors that are tried."""
FIRST = 100
"""Ticks of each signal whose run time does not count, while caches warm up."""


class FeltFigures(NamedTuple):
    """Perceptual error metrics of a displayed force; steps are changes from tick to tick."""

    error_rms_n: float
    error_rms_jnd: float
    largest_step_n: float
    step_jnd: float
    """99.9th percentile of the steps, each in units of the threshold at its tick."""


class CodedSignal(NamedTuple):
    """Result of coding a signal of n ticks.

    Args:
        packets: updates sent.
        displayed_n: shape (n, 3) [N].
        outside: ticks whose error exceeded the deadband.
        error_n: shape (n,) [N].
    """

    packets: int
    displayed_n: Array
    outside: int
    error_n: Array

    def felt(self, signal: Signal, threshold: Threshold) -> FeltFigures:
        """Perceptual error metrics for a person with this threshold."""
        least = threshold.of(signal.force_n)
        steps = np.linalg.norm(np.diff(self.displayed_n, axis=0), axis=1)
        in_jnd = in_units(steps, least[1:])
        return FeltFigures(
            rms(self.error_n),
            rms(in_units(self.error_n, least)),
            float(steps.max(initial=0.0)),
            float(np.percentile(in_jnd, HIGH)) if len(in_jnd) else 0.0,
        )


def coded(signal: Signal, channel: Channel, encoder: Encoder | None = None) -> CodedSignal:
    """Code a signal over a link without loss or delay.

    Args:
        signal: at least one sample.
        channel: its deadband measures distances.
        encoder: fresh, of the channel; the live one by default.
    """
    ticks = list(code(channel, signal.samples, encoder=encoder))
    return CodedSignal(
        sum(tick.update is not None for tick in ticks),
        np.array([tick.displayed for tick in ticks]),
        sum(tick.error > tick.bound for tick in ticks),
        np.array([tick.error for tick in ticks]),
    )


def cost(variant: str, signals: Sequence[Signal]) -> CostRow:
    """Run time of encode plus decode at the default deadband, over all ticks of some signals."""
    times: list[float] = []
    differing = 0
    for signal in signals:
        taken, different = _timed(variant, signal)
        times += taken[FIRST:]
        differing += different
    us = 1e6 * np.array(times or [0.0])
    median, p99 = (float(value) for value in np.percentile(us, [50.0, 99.0]))
    return CostRow(variant, len(times), median, float(us.mean()), p99, float(us.max()), differing)


def _timed(variant: str, signal: Signal) -> tuple[list[float], int]:
    """Run time of each tick [s], and the number of ticks after which the two states differ."""
    channel = channel_of(variant)
    encoder, decoder = Encoder(channel), Decoder(channel)
    times: list[float] = []
    differing = 0
    for tick in code(channel, signal.samples, stopwatch=perf_counter, encoder=encoder, decoder=decoder):
        times.append(tick.seconds)
        differing += decoder.state != encoder.mirror.state
    return times, differing


class Counted(Protocol):
    """A run with a packet count."""

    @property
    def packets(self) -> int: ...


Run = TypeVar("Run", bound=Counted)
TriedFactor = tuple[float, int]
"""A Weber factor and its packets."""


def equal_packets(target: int, run: Callable[[float], Run], first: float, runs: int = RUNS) -> tuple[float, Run]:
    """Search for the Weber factor whose run sends `target` packets.

    Regula falsi in the logarithms of both, alternating with bisection: packets fall with the Weber factor in steps, and
    not everywhere. After `runs` runs the nearest one is taken, in doubt the one that sends less.

    Args:
        target: packets, at least 0.
        run: codes the signal with a Weber factor.
        first: Weber factor to begin with.
        runs: at most.

    Returns:
        The Weber factor and its run.
    """
    more: TriedFactor | None = None
    fewer: TriedFactor | None = None
    weber = first
    best: tuple[float, float, Run] | None = None
    for count in range(runs):
        found = run(weber)
        away = abs(found.packets - target)
        penalty = UNFAIR * away if found.packets > target else away
        if best is None or penalty < best[0]:
            best = penalty, weber, found
        if away <= TOLERANCE * target:
            break
        if found.packets > target:
            more = weber, found.packets
        else:
            fewer = weber, found.packets
        tried, weber = weber, _next(more, fewer, target, bisect=count % 2 == 1)
        if weber == tried:
            break
    assert best is not None
    return best[1], best[2]


def _next(more: TriedFactor | None, fewer: TriedFactor | None, target: int, *, bisect: bool) -> float:
    if more is None or fewer is None:
        near = more or fewer
        assert near is not None
        # Packets fall about as 1 / weber; the exponent overshoots, so that the next run is on the other side.
        ratio = float((max(near[1], 1) / max(target, 1)) ** 1.2)
        return min(MOST, max(LEAST, near[0] * min(3.0, max(1.0 / 3.0, ratio))))
    if bisect or fewer[1] < 1 or target < 1 or more[1] <= fewer[1]:
        return sqrt(more[0] * fewer[0])
    share = (log(more[1]) - log(target)) / (log(more[1]) - log(fewer[1]))
    return exp(log(more[0]) + min(0.9, max(0.1, share)) * (log(fewer[0]) - log(more[0])))
