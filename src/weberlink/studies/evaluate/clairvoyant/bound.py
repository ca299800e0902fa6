"""The bound of each family: how far its models can reach, and the fewest sends that this leaves."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel
from weberlink.codec.predictors import HYBRID
from weberlink.studies.evaluate.clairvoyant.demand import bounded, demand_of
from weberlink.studies.evaluate.clairvoyant.linear import hold_reaches, line_reaches
from weberlink.studies.evaluate.clairvoyant.stretch import Ticks
from weberlink.studies.evaluate.clairvoyant.surface import surface_reaches

KNOWN = {"zoh", "linear", "plane", "sphere"}
"""The families whose reach is known."""
RESOLUTION = 16
"""Of the grid of time on which distant ticks are compared; finer is tighter, and slower: at 32 it was 1 to 3 %."""
LINE_RESOLUTION = 128
"""The same for a signal of one degree of freedom, which has fewer directions to ask."""


def clairvoyant_sends(
    trace_force: NDArray[np.float64],
    position: NDArray[np.float64],
    *,
    channel: Channel,
    families: Sequence[str],
) -> dict[str, int | None]:
    """The fewest sends that any encoder of each family could make with knowledge of the future; a lower bound.

    None for a family of which nothing is known here, as one whose predictor is newer than this, and for all where what
    the deadband asks depends on what was sent.

    Args:
        trace_force: measured force at ticks 0 to n-1, shape (n, 3) [N], finite.
        position: commanded position, shape (n, 3) [m], finite.
        channel: a force channel, for its wire, its deadband, its rest, its trusted stiffness and, if hybrid is asked
            for, its bank.
        families: names of predictors, or "hybrid" for all in the channel's bank at once.
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
            # A surface that is not trusted holds.
            plane, sphere = surface_reaches(demand, channel.fit_limits, resolution)
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
