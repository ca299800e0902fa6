"""How far a held force and a straight line in time can reach.

The projection of the force on a direction w must keep within w.f +- the tolerance: a gate at every tick. For a hold
that is an interval of the value. For a line every two ticks leave an interval of the slope, from low' - high to
high' - low over their distance; a slope that is in all of these has a line through all gates, for the highest of
low - slope t is then below the lowest of high - slope t.
"""

import numpy as np
from numpy.typing import NDArray

from weberlink.studies.evaluate.clairvoyant.demand import Demand, lengths
from weberlink.studies.evaluate.clairvoyant.stretch import Array, Index, Ticks, reaches

PLANAR_DIRECTIONS = 8
"""Of forces on two axes; on three it is the 13 of the edges, faces and corners of a cube."""


def hold_reaches(demand: Demand, resolution: int) -> Ticks:
    """One value from the tick of the send on, shape (n,)."""
    low, high = _gates(demand)

    def pair(_earlier: Index, later: Index, _distance: int) -> tuple[Array, Array]:
        return low[:, later], high[:, later]

    found: Ticks = reaches(low, high, pair, jointly=True, resolution=resolution)[0]
    return found


def line_reaches(demand: Demand, resolution: int) -> Ticks:
    """One value and slope from the tick of the send on, shape (n,)."""
    low, high = _gates(demand)
    low[:, demand.at_edge], high[:, demand.at_edge] = -np.inf, np.inf

    def pair(earlier: Index, later: Index, distance: int) -> tuple[Array, Array]:
        per_tick = 1.0 / distance
        return (low[:, later] - high[:, earlier]) * per_tick, (high[:, later] - low[:, earlier]) * per_tick

    any_slope = np.full_like(low, np.inf)
    found: Ticks = reaches(-any_slope, any_slope, pair, jointly=True, resolution=resolution)[0]
    return found


def _gates(demand: Demand) -> tuple[Array, Array]:
    """Lowest and highest projection that the law allows, each of shape (directions, n)."""
    x, y, z = demand.force.T
    directions = _directions((demand.force != 0.0).any(axis=0))
    # Not a matrix product, whose last bits depend on the library that makes it.
    along = np.array([a * x + b * y + c * z for a, b, c in directions])
    if demand.sector is not None:
        size = lengths(demand.force)
        return -demand.sector.extent(-along, size), demand.sector.extent(along, size)
    return along - demand.tolerance, along + demand.tolerance


def _directions(used: NDArray[np.bool_]) -> Array:
    """Unit vectors, evenly spread over a half of the space that the forces use, shape (directions, 3)."""
    axes = np.flatnonzero(used)
    if len(axes) == 3:
        half = [(a, b, c) for a in (0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1) if (a, b, c) > (0, 0, 0)]
        chosen = np.array(half, dtype=np.float64)
        spread: Array = chosen / np.sqrt((chosen * chosen).sum(axis=1, keepdims=True))
        return spread
    if len(axes) == 2:
        angles = np.pi / PLANAR_DIRECTIONS * np.arange(PLANAR_DIRECTIONS)
        planar = np.zeros((PLANAR_DIRECTIONS, 3))
        planar[:, axes[0]], planar[:, axes[1]] = np.cos(angles), np.sin(angles)
        return planar
    single: Array = np.eye(3)[axes if len(axes) else [0]]
    return single
