"""The bound of each family: how far its models can reach, and the fewest sends that this leaves."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from codec import Channel
from codec.predictors import HYBRID, PREDICTORS
from evaluation.coding.clairvoyant.demand import demand_of
from evaluation.coding.clairvoyant.linear import hold_reaches, line_reaches
from evaluation.coding.clairvoyant.stretch import Ticks
from evaluation.coding.clairvoyant.surface import surface_reaches

RESOLUTION = 16
"""Of the grid of time on which distant ticks are compared; finer is tighter, and slower: at 32 it was 1 to 3 %."""
LINE_RESOLUTION = 128
"""The same for a signal of one degree of freedom, which has fewer directions to ask."""


def clairvoyant_sends(
    trace_force: NDArray[np.float64],
    position: NDArray[np.float64],
    *,
    weber: float,
    floor: float,
    channel: Channel,
    families: Sequence[str],
) -> dict[str, int]:
    """The fewest sends that any encoder of each family could make with knowledge of the future; a lower bound.

    Args:
        trace_force: measured force at ticks 0 to n-1, shape (n, 3) [N], finite.
        position: commanded position, shape (n, 3) [m], finite.
        weber: Weber factor of the measured force.
        floor: absolute threshold [N].
        channel: a force channel, for its wire, its rest, its trusted stiffness and, if hybrid is asked for, its bank.
            Its deadband is not read.
        families: names of predictors, or "hybrid" for all in the channel's bank at once.

    Raises:
        ValueError: for a family that is no predictor.
    """
    unknown = [name for name in families if name not in (*PREDICTORS, HYBRID)]
    if unknown:
        raise ValueError(f"families must be of {', '.join((*PREDICTORS, HYBRID))}, not {', '.join(unknown)}")
    if not len(trace_force):
        return dict.fromkeys(families, 0)
    demand = demand_of(trace_force, position, weber, floor, channel)
    members = {name for family in families for name in (channel.bank if family == HYBRID else (family,))}
    resolution = LINE_RESOLUTION if demand.collinear else RESOLUTION
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        hold = hold_reaches(demand, resolution)
        reach = {"zoh": hold}
        if "linear" in members:
            reach["linear"] = np.maximum(hold, line_reaches(demand, resolution))
        if members & {"plane", "sphere"}:
            # A surface that is not trusted holds.
            plane, sphere = surface_reaches(demand, channel.trust, resolution)
            reach |= {"plane": np.maximum(hold, plane), "sphere": np.maximum(hold, sphere)}
    if HYBRID in families:
        reach[HYBRID] = np.maximum.reduce([reach[name] for name in channel.bank])
    first = demand.first_broken(channel.rest)
    return {name: _sends(reach[name], first) for name in families}


def _sends(reach: Ticks, first: int) -> int:
    """Each as late as possible: an earlier one reaches no further."""
    sends, tick, onwards = 0, first, reach.tolist()
    while tick < len(onwards):
        sends, tick = sends + 1, onwards[tick]
    return sends
