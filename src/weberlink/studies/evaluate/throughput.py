"""How fast offline coding is: samples per second of the hybrid at k = 0.10 on one processor.

Owns the signal and what is timed. Compilation is not: it is done once, and kept.
"""

from collections.abc import Callable
from time import perf_counter

import numpy as np

from weberlink.codec import force_channel
from weberlink.studies.evaluate.engine import Engine
from weberlink.studies.evaluate.replay import Array, Signal, replay

PERIOD_S = 1e-3
STIFFNESS_N_M = 800.0
RADIUS_M = 0.05
STIFFENING_M = 5e-3
"""Depth at which the ball is three times as stiff as at its surface: no predictor's model of it holds for long."""
NOISE_N = 2e-3
ROUNDS = 5


def throughput(engine: Engine, samples: int = 200_000) -> float:
    """Samples per second, the best of `ROUNDS` runs of a signal: what else the machine does only takes away.

    Args:
        engine: "python" for the live encoder and decoder, "compiled" for the same compiled.
        samples: length of the signal, at least 1.

    Raises:
        ImportError: numba is missing, and asked for.
    """
    signal, code = contact(samples), _code(engine)
    code(signal.middle(10))
    return samples / min(_elapsed(code, signal) for _ in range(ROUNDS))


def contact(samples: int, seed: int = 1) -> Signal:
    """A hand that wanders over a ball and presses it, lets go and comes back; with the noise of a force sensor."""
    chance = np.random.default_rng(seed)
    time_s = np.arange(samples) * PERIOD_S
    frequencies, phases = chance.uniform(0.2, 1.5, (3, 3)), chance.uniform(0.0, 2.0 * np.pi, (3, 3))
    swing: Array = np.sin(2.0 * np.pi * time_s[:, None, None] * frequencies + phases).sum(axis=2)
    position = swing * np.array([8e-3, 8e-3, 3e-3]) + np.array([0.0, 0.0, RADIUS_M - 2e-3])
    length = np.linalg.norm(position, axis=1)
    depth = np.maximum(0.0, RADIUS_M - length)
    noise = chance.normal(0.0, NOISE_N, (samples, 3)) * (depth > 0.0)[:, None]
    pressing = STIFFNESS_N_M * depth * (1.0 + depth / STIFFENING_M)
    return Signal((pressing / length)[:, None] * position + noise, position, PERIOD_S)


def _code(engine: Engine) -> Callable[[Signal], object]:
    """The coding alone, without the run times that a replay measures beside it."""
    channel = force_channel(weber=0.10)
    if engine == "python":
        return lambda signal: replay(signal, channel)
    from weberlink.studies.evaluate.compiled.replay import run  # noqa: PLC0415 - heavy, an extra

    return lambda signal: run(signal, channel)


def _elapsed(code: Callable[[Signal], object], signal: Signal) -> float:
    began = perf_counter()
    code(signal)
    return perf_counter() - began
