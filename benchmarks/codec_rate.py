"""How many samples a second are coded and decoded: by the live encoder and decoder, and by the same source compiled."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from time import perf_counter_ns, thread_time_ns
from typing import Any

import numpy as np

from benchmarks.percentiles import Series, summary
from weberlink.codec import Channel, Decoder, Encoder, force_channel
from weberlink.geometry.vector import Vector
from weberlink.master.trace import Trace, read_trace
from weberlink.studies.evaluate.replay import Signal

ROUNDS, QUICK_ROUNDS = 5, 1
REPEATS = 50
"""Of the recording, for the compiled engine: it is done with one in no time."""
POSITION_STEP_M = 2e-6
"""Of the shipped configuration, as the recording is."""
MISSING = 'not installed; install it with: pip install "weberlink[compiled]"'

Rate = Callable[[Channel, Trace], float]
"""Samples per second of one core, without what is done once."""


@dataclass(frozen=True)
class CodecRate:
    """Samples per second of one core, force channel, hybrid of four, three axes.

    Args:
        live_samples_per_s: encoder and decoder as the daemons have them.
        live_us: of every sample [us].
        compiled_samples_per_s: the offline engine; None where it is not installed.
        note: why there is no compiled figure.
    """

    live_samples_per_s: float
    live_us: Series
    compiled_samples_per_s: float | None
    note: str | None

    def as_json(self) -> dict[str, Any]:
        compiled = self.compiled_samples_per_s
        return {
            "samples": len(self.live_us),
            "live_samples_per_s": self.live_samples_per_s,
            "live_us": summary(self.live_us),
            "compiled_samples_per_s": compiled,
            "compiled_note": self.note,
            "compiled_with": _numba(),
            "compiled_over_live": None if compiled is None else compiled / self.live_samples_per_s,
        }


def find_engine() -> Rate | None:
    """The compiled engine of the offline evaluation; None where it is not installed."""
    return None if find_spec("numba") is None else compiled_rate


def measure(*, quick: bool, find: Callable[[], Rate | None] = find_engine) -> CodecRate:
    """Code the shipped recording.

    Args:
        quick: once instead of several times.
        find: the rate of the offline engine, if there is one.
    """
    trace = read_trace(Path(str(files("weberlink.configs") / "traces" / "operator.csv")))
    channel = force_channel(position_step=POSITION_STEP_M)
    samples = Signal(trace.force_n, trace.position_m, trace.period_s).samples
    rates, each_us = [], []
    for _ in range(QUICK_ROUNDS if quick else ROUNDS):
        began = thread_time_ns()
        each_us.append(code(channel, samples))
        rates.append(len(samples) / (thread_time_ns() - began) * 1e9)
    engine = find()
    rate = None if engine is None else engine(channel, trace)
    return CodecRate(median(rates), np.concatenate(each_us), rate, None if engine is not None else f"numba: {MISSING}")


def _numba() -> str | None:
    try:
        return f"numba {version('numba')}"
    except PackageNotFoundError:
        return None


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


def compiled_rate(channel: Channel, trace: Trace) -> float:
    """Of the recording again and again, once it is compiled: encoding, decoding and the error of every sample."""
    from weberlink.studies.evaluate.compiled.replay import run  # noqa: PLC0415 - heavy, an extra

    force, position = (np.tile(each, (REPEATS, 1)) for each in (trace.force_n, trace.position_m))
    signal = Signal(force, position, trace.period_s)
    run(signal, channel)
    rates = []
    for _ in range(ROUNDS):
        began = thread_time_ns()
        run(signal, channel)
        rates.append(len(signal) / (thread_time_ns() - began) * 1e9)
    return median(rates)
