"""What encode plus decode take per tick: the whole distribution, in this process, beside a check of both states."""

from collections.abc import Sequence
from time import perf_counter

import numpy as np

from weberlink.codec import Decoder, Encoder
from weberlink.studies.adaptive.rows import Cost
from weberlink.studies.adaptive.variants import channel_of
from weberlink.studies.evaluate.replay import Signal

FIRST = 100
"""Ticks of each signal that are not counted: caches and interpreter get to know the code."""


def cost(variant: str, signals: Sequence[Signal]) -> Cost:
    """Of a predictor or a bank at the default deadband, over all ticks of some signals."""
    times: list[float] = []
    differing = 0
    for signal in signals:
        taken, different = _timed(variant, signal)
        times += taken[FIRST:]
        differing += different
    us = 1e6 * np.array(times or [0.0])
    median, p99 = (float(value) for value in np.percentile(us, [50.0, 99.0]))
    return Cost(variant, len(times), median, float(us.mean()), p99, float(us.max()), differing)


def _timed(variant: str, signal: Signal) -> tuple[list[float], int]:
    channel = channel_of(variant)
    encoder, decoder = Encoder(channel), Decoder(channel)
    encode, apply, value = encoder.encode, decoder.apply, decoder.value
    times: list[float] = []
    differing = 0
    for tick, ((fx, fy, fz), (px, py, pz)) in enumerate(signal.samples):
        force, position = (fx, fy, fz), (px, py, pz)
        began = perf_counter()
        update = encode(tick, force, position)
        if update is not None:
            apply(update)
        value(tick, position)
        times.append(perf_counter() - began)
        differing += decoder.state != encoder.mirror.state
    return times, differing
