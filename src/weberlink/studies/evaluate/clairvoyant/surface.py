"""How far a plane and a sphere can reach, asked pair by pair of ticks.

In contact the decoded force is v u with v = s (depth) > 0 and a unit vector u. The law leaves v the interval |f| - e to
|f| + e and u the cone of half-angle asin(e / |f|) about f; a deadband that keeps the two apart says both itself. The
gradient of v over the position p is -s u; v is linear for a plane, a concave function for a convex sphere and a convex
one for a concave sphere. So for two ticks, with D = u.(p' - p):

- convex and plane: v' <= v - s D, whence s D <= high(v) - low(v'), in both orders of the two;
- concave and plane: v' >= v - s D, whence -s D <= high(v') - low(v); here the later may be without contact, where v' is
  at most what the law leaves unsent;
- a convex depth turns its force along the motion, (u' - u).(p' - p) >= 0, a concave one against it, a plane not at all;
- plane: the two cones share a direction.

Each is asked with that D of the cone which is easiest to meet. What is left out: the stiffness has no least value, a
sphere no centre and no radius, and every pair of ticks may choose its own directions within the cones. At the very
centre of a sphere, where it has no direction, the decoder says its newest force: that one point is not considered.
"""

from dataclasses import dataclass

import numpy as np

from weberlink.codec.predictors import FitLimits
from weberlink.studies.evaluate.clairvoyant.demand import Array, Demand, Flags, lengths
from weberlink.studies.evaluate.clairvoyant.sector import ROUNDING
from weberlink.studies.evaluate.clairvoyant.stretch import Index, Ticks, reaches

EPSILON = float(np.finfo(np.float64).eps)
NO_WAY = 1e-30
"""Added to a displacement [m], so that none is 0; its force is far below what rounding is given."""
CONVEX, CONCAVE, PLANE = range(3)


@dataclass(frozen=True)
class _Contact:
    """What the law says of depth and direction at every tick.

    Args:
        place: position on the axes in use, shape (axes, n) [m].
        touches: whether there must be a force, shape (n,).
        direction: of the measured force where it touches, else 0, shape (axes, n).
        sine: of the half-angle of the cone, shape (n,); `cosine` likewise.
        low: least v [N], minus infinity where there may be no force, shape (n,).
        high: largest v [N], shape (n,).
        high_from: largest v to start from; infinite where nothing is known of the direction.
    """

    place: Array
    touches: Flags
    direction: Array
    sine: Array
    cosine: Array
    low: Array
    high: Array
    high_from: Array


def surface_reaches(demand: Demand, trust: FitLimits, resolution: int) -> tuple[Ticks, Ticks]:
    """A plane's and a sphere's, from the tick after a send at each tick, shape (n,) each."""
    contact = _contact(demand, trust)
    stiffness = _stiffness_on_a_line if demand.collinear else _stiffness

    def pair(earlier: Index, later: Index, _distance: int) -> tuple[Array, Array]:
        return stiffness(contact, earlier, later)

    least = np.zeros((3, demand.ticks))
    most = np.full_like(least, trust.stiffness[1] * (1.0 + ROUNDING))
    found = reaches(least, most, pair, jointly=False, resolution=resolution)
    # At its own tick a sample stands for itself: the model begins at the tick after.
    found = np.column_stack((found[:, 1:], np.full(3, demand.ticks)))
    return found[PLANE], np.maximum(found[CONVEX], found[CONCAVE])


def _contact(demand: Demand, trust: FitLimits) -> _Contact:
    size = lengths(demand.force)
    extent = trust.radius[1] + float(np.abs(demand.position).max(initial=0.0))
    # A stiff surface far from its centre rounds its depth.
    slack = 16.0 * EPSILON * trust.stiffness[1] * extent
    least, most = demand.magnitudes
    least, most = least - slack, most + slack
    touches = (least > 0.0) & ~demand.at_edge
    known = np.where(touches, size, 1.0)
    if demand.sector is None:
        sine = np.where(touches, (demand.tolerance + slack) / known, 0.0)
    else:
        angle = demand.sector.directions(size, slack)
        # What may come from more than half of all directions says nothing of where the surface is.
        touches &= angle < 0.5 * np.pi
        sine = np.where(touches, np.sin(angle), 0.0)
    axes = demand.used
    return _Contact(
        place=np.ascontiguousarray(demand.position.T[axes]),
        touches=touches,
        direction=np.where(touches, demand.force.T[axes] / known, 0.0),
        sine=sine,
        cosine=np.sqrt((1.0 - sine) * (1.0 + sine)),
        low=np.where(touches, least, -np.inf),
        high=np.where(demand.at_edge, np.inf, most),
        high_from=np.where(touches, most, np.inf),
    )


def _stiffness(contact: _Contact, earlier: Index, later: Index) -> tuple[Array, Array]:
    """The stiffness that pairs of ticks leave to a convex sphere, a concave one and a plane, shape (3, pairs) each."""
    moved = contact.place[:, later] - contact.place[:, earlier]
    # Inequalities factor * s <= room; rows: convex and concave seen from the earlier tick, then from the later.
    factor, room = np.empty((4, moved.shape[1])), np.empty((4, moved.shape[1]))
    factor[0], factor[1] = _along(contact, earlier, moved)
    factor[2], factor[3] = _along(contact, later, -moved)
    low, high, high_from = contact.low, contact.high, contact.high_from
    np.subtract(high_from[earlier], low[later], out=room[0])
    np.subtract(high[later], low[earlier], out=room[1])
    np.subtract(high_from[later], low[earlier], out=room[2])
    np.subtract(high[earlier], low[later], out=room[3])
    lows, highs = np.empty((3, moved.shape[1])), np.empty((3, moved.shape[1]))
    _solve(factor + NO_WAY, room, lows[:PLANE], highs[:PLANE])
    np.maximum(lows[CONVEX], lows[CONCAVE], out=lows[PLANE])
    np.minimum(highs[CONVEX], highs[CONCAVE], out=highs[PLANE])
    # Directions, whatever the stiffness.
    both = contact.touches[earlier] & contact.touches[later]
    turned = factor[:2] + factor[2:]
    impossible = np.empty((3, moved.shape[1]), dtype=bool)
    np.greater(turned, ROUNDING * np.abs(moved).max(axis=0), out=impossible[:PLANE])
    np.logical_or(impossible[CONVEX], impossible[CONCAVE], out=impossible[PLANE])
    impossible[PLANE] |= _apart(contact, earlier, later)
    impossible &= both
    np.copyto(lows, np.inf, where=impossible)
    return lows, highs


def _stiffness_on_a_line(contact: _Contact, earlier: Index, later: Index) -> tuple[Array, Array]:
    """The same where all cones are one line.

    In the direction u of the contact the force is b - s u.p, and its interval at each tick a gate. Of a sphere the two
    directions are two lines of one slope.
    """
    direction, place = contact.direction[0], contact.place[0]
    one, other = direction[earlier], direction[later]
    facing = np.where(one != 0.0, one, other) * (place[later] - place[earlier]) + NO_WAY
    first = (contact.low[earlier] - contact.high[later]) / facing
    second = (contact.high[earlier] - contact.low[later]) / facing
    together = one * other
    opposed, alike = together < 0.0, together > 0.0
    low, high = np.minimum(first, second), np.maximum(first, second)
    apart = np.where(opposed, -np.inf, low), np.where(opposed, np.inf, high)
    lows = np.array((np.where(alike, low, -np.inf), apart[0], low))
    highs = np.array((np.where(alike, high, np.inf), apart[1], high))
    np.copyto(lows[CONVEX], np.inf, where=opposed & (facing > 2.0 * NO_WAY))
    np.copyto(lows[CONCAVE], np.inf, where=opposed & (facing < 0.0))
    np.copyto(lows[PLANE], np.inf, where=opposed)
    return lows, highs


def _along(contact: _Contact, at: Index, moved: Array) -> tuple[Array, Array]:
    """Least u.moved and least -u.moved over the cone of a tick, each of shape (pairs,)."""
    along: Array = (contact.direction[:, at] * moved).sum(axis=0)
    way = (moved * moved).sum(axis=0)
    length, middle = np.sqrt(way), along * contact.cosine[at]
    # What the square root makes of the rounding of a difference may widen a cone, never narrow it.
    across = np.sqrt(np.maximum(way - along * along, 0.0) + 4.0 * EPSILON * way) * contact.sine[at]
    inside = length * contact.cosine[at]
    return np.where(along <= -inside, -length, middle - across), np.where(along >= inside, -length, -middle - across)


def _solve(factor: Array, room: Array, low: Array, high: Array) -> None:
    """Where s * factor <= room for the first half of the rows and for the second."""
    half = len(factor) // 2
    negative, bound = factor < 0.0, room / factor
    lows, highs = np.where(negative, bound, -np.inf), np.where(negative, np.inf, bound)
    np.maximum(lows[:half], lows[half:], out=low)
    np.minimum(highs[:half], highs[half:], out=high)


def _apart(contact: _Contact, earlier: Index, later: Index) -> Flags:
    """Whether two cones do not meet: the angle between their axes is more than the sum of the half-angles."""
    between: Array = (contact.direction[:, earlier] * contact.direction[:, later]).sum(axis=0)
    sine, cosine = contact.sine, contact.cosine
    return between < cosine[earlier] * cosine[later] - sine[earlier] * sine[later] - ROUNDING
