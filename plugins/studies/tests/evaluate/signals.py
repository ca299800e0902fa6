"""Traces made by hand."""

from math import sin

import numpy as np

from weberlink.master.trace import Trace


def trace(forces: list[float], depths: list[float]) -> Trace:
    """Forces and positions along z, one a millisecond."""
    forces_n, positions_m = np.zeros((len(forces), 3)), np.zeros((len(forces), 3))
    forces_n[:, 2], positions_m[:, 2] = forces, np.negative(depths)
    return Trace(np.arange(len(forces)) * 1e-3, positions_m, forces_n)


def wall(ticks: int = 800, stiffness: float = 500.0) -> Trace:
    """Pressed and released on a flat wall."""
    depths = [4e-3 * sin(0.01 * tick) for tick in range(ticks)]
    return trace([max(0.0, stiffness * depth) for depth in depths], depths)


def walk(ticks: int, seed: int) -> Trace:
    """Forces and positions that wander on all axes."""
    chance = np.random.default_rng(seed)
    forces = np.cumsum(chance.normal(0.0, 0.02, (ticks, 3)), axis=0) + 1.0
    positions = np.cumsum(chance.normal(0.0, 1e-5, (ticks, 3)), axis=0)
    return Trace(np.arange(ticks) * 1e-3, positions, forces)
