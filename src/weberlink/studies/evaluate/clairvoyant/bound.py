"""The fewest sends of each predictor family, and how far a held force and a straight line in time can reach."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel
from weberlink.codec.predictors import HYBRID
from weberlink.studies.evaluate.clairvoyant.demand import Array, Demand, bounded, demand_of, lengths
from weberlink.studies.evaluate.clairvoyant.stretch import Index, Ticks, reaches
from weberlink.studies.evaluate.clairvoyant.surface import surface_reaches

KNOWN = {"zoh", "linear", "plane", "sphere"}
"""Families whose reach can be computed."""
RESOLUTION = 16
"""Of the time grid for distant ticks. 32 gives a bound that is 1 to 3 % tighter, and is slower."""
LINE_RESOLUTION = 128
"""The same for one degree of freedom."""
PLANAR_DIRECTIONS = 8
"""Checked for forces on two axes; with three axes it is the 13 of the edges, faces and corners of a cube."""


def clairvoyant_sends(
    trace_force: NDArray[np.float64],
    position: NDArray[np.float64],
    *,
    channel: Channel,
    families: Sequence[str],
) -> dict[str, int | None]:
    """A lower bound on the sends of any encoder of each family.

    None for families other than `KNOWN`, and for all if the deadband depends on what was sent.

    Args:
        trace_force: measured force at ticks 0 to n-1, shape (n, 3) [N], finite.
        position: commanded position, shape (n, 3) [m], finite.
        channel: a force channel with the wire, deadband, rest value and fit limits; its bank is that of "hybrid".
        families: names of predictors, or "hybrid" for all in the bank of the channel.
    """
    known = [name for name in families if set(_members(name, channel)) <= KNOWN]
    fewest: dict[str, int | None] = dict.fromkeys(families)
    return fewest | (_fewest(trace_force, position, channel, known) if bounded(channel.deadband) else {})


def _members(family: str, channel: Channel) -> tuple[str, ...]:
    return channel.bank if family == HYBRID else (family,)


def _fewest(
    trace_force: NDArray[np.float64], position: NDArray[np.float64], channel: Channel, families: Sequence[str]
) -> dict[str, int]:
    if not len(trace_force):
        return dict.fromkeys(families, 0)
    demand = demand_of(trace_force, position, channel)
    members = {name for family in families for name in _members(family, channel)}
    resolution = LINE_RESOLUTION if demand.collinear else RESOLUTION
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        hold = hold_reaches(demand, resolution)
        reach = {"zoh": hold}
        if "linear" in members:
            reach["linear"] = np.maximum(hold, line_reaches(demand, resolution))
        if members & {"plane", "sphere"}:
            # A surface outside the fit limits holds.
            plane, sphere = surface_reaches(demand, channel.fit_limits, resolution)
            reach |= {"plane": np.maximum(hold, plane), "sphere": np.maximum(hold, sphere)}
    if HYBRID in families:
        reach[HYBRID] = np.maximum.reduce([reach[name] for name in channel.bank])
    first = demand.first_broken(channel.rest)
    return {name: _sends(reach[name], first) for name in families}


def _sends(reach: Ticks, first: int) -> int:
    """Send as late as possible: an earlier send reaches no further."""
    sends, tick, onwards = 0, first, reach.tolist()
    while tick < len(onwards):
        sends, tick = sends + 1, onwards[tick]
    return sends


def hold_reaches(demand: Demand, resolution: int) -> Ticks:
    """How far one held value reaches from a send at each tick, shape (n,).

    The projection of the force on a direction w must stay within w.f plus or minus the tolerance, an interval.
    """
    low, high = _gates(demand)

    def pair(_earlier: Index, later: Index, _distance: int) -> tuple[Array, Array]:
        return low[:, later], high[:, later]

    found: Ticks = reaches(low, high, pair, jointly=True, resolution=resolution)[0]
    return found


def line_reaches(demand: Demand, resolution: int) -> Ticks:
    """How far one value and slope reach from a send at each tick, shape (n,).

    Two ticks leave the slope the interval from low' - high to high' - low over their distance. A slope in all of these
    has a line through all intervals, for the maximum of low - slope t is then below the minimum of high - slope t.
    """
    low, high = _gates(demand)
    low[:, demand.at_edge], high[:, demand.at_edge] = -np.inf, np.inf

    def pair(earlier: Index, later: Index, distance: int) -> tuple[Array, Array]:
        per_tick = 1.0 / distance
        return (low[:, later] - high[:, earlier]) * per_tick, (high[:, later] - low[:, earlier]) * per_tick

    any_slope = np.full_like(low, np.inf)
    found: Ticks = reaches(-any_slope, any_slope, pair, jointly=True, resolution=resolution)[0]
    return found


def _gates(demand: Demand) -> tuple[Array, Array]:
    """Least and largest projection that the deadband allows, each of shape (directions, n)."""
    x, y, z = demand.force.T
    directions = _directions((demand.force != 0.0).any(axis=0))
    # Not a matrix product: its last bits depend on the library.
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
