"""Run time of a tick's codec work, beside its limit. Exits with 1 if the limit is missed.

`python -m benchmarks.codec_tick`: hybrid of all four predictors, 3 DoF, encode plus decode, on the shipped trace.
"""

import sys
from pathlib import Path
from time import perf_counter

from weberlink.codec import Decoder, Encoder, force_channel
from weberlink.geometry.vector import Vector
from weberlink.master.trace import read_trace
from weberlink.system.environment import environment, footer

LIMIT_US = 15.0
ROUNDS = 5
TRACE = Path(__file__).parents[1] / "configs" / "traces" / "operator.csv"


def main() -> int:
    trace = read_trace(TRACE)
    samples: list[tuple[Vector, Vector]] = [
        (tuple(force), tuple(position))
        for force, position in zip(trace.force_n.tolist(), trace.position_m.tolist(), strict=True)
    ]
    out = sys.stdout
    worst = 0.0
    for predictor in ("zoh", "linear", "plane", "sphere", "hybrid"):
        times = sorted(time for _ in range(ROUNDS) for time in run(predictor, samples))
        median, p99 = times[len(times) // 2], times[int(0.99 * len(times))]
        worst = max(worst, median)
        out.write(f"{predictor:8} median {median:6.2f} us   p99 {p99:6.2f} us   max {times[-1]:7.2f} us per tick\n")
    out.write(f"limit    median {LIMIT_US:6.2f} us   {'met' if worst < LIMIT_US else 'MISSED'}\n")
    out.write(f"{len(samples)} samples x {ROUNDS}, k = 0.10; {footer(environment())}\n")
    return 0 if worst < LIMIT_US else 1


def run(predictor: str, samples: list[tuple[Vector, Vector]]) -> list[float]:
    """Microseconds of every tick."""
    channel = force_channel(predictor=predictor, position_step=2e-6)
    encoder, decoder = Encoder(channel), Decoder(channel)
    times = []
    for tick, (force, position) in enumerate(samples):
        began = perf_counter()
        update = encoder.encode(tick, force, position)
        if update is not None:
            decoder.apply(update)
        decoder.value(tick, position)
        times.append((perf_counter() - began) * 1e6)
    return times


if __name__ == "__main__":
    sys.exit(main())
