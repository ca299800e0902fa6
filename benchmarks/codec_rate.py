"""Samples per second that the live encoder and decoder code."""

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from statistics import median
from time import perf_counter_ns, thread_time_ns
from typing import Any

import numpy as np

from benchmarks.percentiles import Series, summary
from weberlink.codec import Channel, Decoder, Encoder, force_channel
from weberlink.geometry.vector import Vector
from weberlink.master.trace import read_trace
from weberlink.studies.evaluate.replay import Signal

ROUNDS, QUICK_ROUNDS = 5, 1
POSITION_STEP_M = 2e-6
"""Of the shipped configuration, as the recording is."""


@dataclass(frozen=True)
class CodecRate:
    """Samples per second of one core, force channel, hybrid of four, three axes.

    Args:
        live_samples_per_s: encoder and decoder as the daemons have them.
        live_us: of every sample [us].
    """

    live_samples_per_s: float
    live_us: Series

    def as_json(self) -> dict[str, Any]:
        return {
            "samples": len(self.live_us),
            "live_samples_per_s": self.live_samples_per_s,
            "live_us": summary(self.live_us),
        }


def measure(*, quick: bool) -> CodecRate:
    """Code the shipped recording, once if `quick`."""
    trace = read_trace(Path(str(files("weberlink.configs") / "traces" / "operator.csv")))
    channel = force_channel(position_step=POSITION_STEP_M)
    samples = Signal(trace.force_n, trace.position_m, trace.period_s).samples
    rates, each_us = [], []
    for _ in range(QUICK_ROUNDS if quick else ROUNDS):
        began = thread_time_ns()
        each_us.append(code(channel, samples))
        rates.append(len(samples) / (thread_time_ns() - began) * 1e9)
    return CodecRate(median(rates), np.concatenate(each_us))


def code(channel: Channel, samples: list[tuple[Vector, Vector]]) -> Series:
    """Encode and decode in turn, over a link that loses nothing; microseconds of every sample."""
    encoder, decoder = Encoder(channel), Decoder(channel)
    times = []
    for tick, (force, position) in enumerate(samples):
        began = perf_counter_ns()
        update = encoder.encode(tick, force, position)
        if update is not None:
            decoder.apply(update)
        decoder.value(tick, position)
        times.append(perf_counter_ns() - began)
    return np.array(times, dtype=np.float64) * 1e-3
