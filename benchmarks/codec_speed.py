"""Run time of the codec: encode plus decode of every sample of the shipped recording, 3 axes, k = 0.10.

`python -m benchmarks.codec_speed` prints it for each predictor and exits with 1 if a median misses the limit.
"""

import sys
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.percentiles import Series, summary
from weberlink.codec import Channel, force_channel
from weberlink.codec.replay import code
from weberlink.geometry.vector import Vector
from weberlink.master.trace import read_trace
from weberlink_figures.environment import environment, footer
from weberlink_studies.evaluate.replay import signal_of
from weberlink_studies.evaluate.traces import SHIPPED
from weberlink_studies.paper.claims import PREDICTORS

ROUNDS, QUICK_ROUNDS = 5, 1
POSITION_STEP_M = 2e-6  # position step of the shipped configuration
LIMIT_US = 15.0


@dataclass(frozen=True)
class CodecSpeed:
    """Samples per second of one core, and the run time of every sample [us]: force channel, hybrid of four."""

    live_samples_per_s: float
    live_us: Series

    def as_json(self) -> dict[str, Any]:
        return {
            "samples": len(self.live_us),
            "live_samples_per_s": self.live_samples_per_s,
            "live_us": summary(self.live_us),
        }


def measure(*, quick: bool, predictor: str = "hybrid") -> CodecSpeed:
    """Code the shipped recording, once if `quick`."""
    channel = force_channel(predictor=predictor, position_step=POSITION_STEP_M)
    samples = signal_of(read_trace(SHIPPED)).samples
    rounds = [run_times(channel, samples) for _ in range(QUICK_ROUNDS if quick else ROUNDS)]
    return CodecSpeed(median(1e6 / float(each.mean()) for each in rounds), np.concatenate(rounds))


def run_times(channel: Channel, samples: list[tuple[Vector, Vector]]) -> Series:
    """Run time of encode plus decode of every sample [us], over a link without loss."""
    coded: Any = code(channel, samples, stopwatch=perf_counter)
    if not hasattr(coded, "seconds"):  # a program that gave an object per tick, beside the present one in `pairs`
        return 1e6 * np.array([tick.seconds for tick in coded])
    return 1e6 * np.array(coded.seconds)


def main() -> int:
    medians = []
    for predictor in PREDICTORS:
        found = summary(measure(quick=False, predictor=predictor).live_us)
        medians.append(found["p50"] or 0.0)
        sys.stdout.write(
            f"{predictor:8} median {found['p50']:6.2f} us   p99 {found['p99']:6.2f} us   max {found['max']:7.2f} us\n"
        )
    met = max(medians) < LIMIT_US
    sys.stdout.write(f"limit    median {LIMIT_US:6.2f} us   {'met' if met else 'MISSED'}\n{footer(environment())}\n")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
