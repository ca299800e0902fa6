"""How far a plane and a sphere can reach, checked for pairs of ticks.

In contact the decoded force is v u with v = s (depth) > 0 and a unit vector u. The deadband allows v from |f| - e to
|f| + e and u in the cone of half-angle asin(e / |f|) about f, unless it limits the two separately. The gradient of v
over the position p is -s u; v is linear for a plane, a concave function for a convex sphere and a convex one for a
concave sphere. So for two ticks, with D = u.(p' - p):

- convex and plane: v' <= v - s D, whence s D <= high(v) - low(v'), in both orders of the two;
- concave and plane: v' >= v - s D, whence -s D <= high(v') - low(v); the later may be without contact, where v' is at
  most the deadband;
- a convex depth turns its force along the motion, (u' - u).(p' - p) >= 0, a concave one against it, a plane not at all;
- plane: the two cones share a direction.

Each uses that D of the cone which is easiest to satisfy. Not checked: a least stiffness, centre and radius of a sphere,
and that all pairs of ticks use the same direction at a tick. The centre of a sphere itself, where the decoder outputs
its newest force, is not considered.
"""

from dataclasses import dataclass

import numpy as np

from weberlink.codec.predictors import FitLimits
from weberlink.studies.evaluate.clairvoyant.demand import ROUNDING, Array, Demand, Flags, lengths
from weberlink.studies.evaluate.clairvoyant.stretch import Index, Ticks, reaches

EPSILON = float(np.finfo(np.float64).eps)
NO_WAY = 1e-30
"""Added to a displacement [m] so that none is 0; its force is far below `ROUNDING`."""
CONVEX, CONCAVE, PLANE = range(3)


@dataclass(frozen=True)
class _ContactCone:
    """Allowed depth and direction of the force at every tick.

    Args:
        place: position on the axes in use, shape (axes, n) [m].
        touches: whether the force must not vanish, shape (n,).
        direction: of the measured force in contact, else 0, shape (axes, n).
        sine: of the half-angle of the cone, shape (n,); `cosine` likewise.
        low: least v [N], minus infinity where the force may vanish, shape (n,).
        high: largest v [N], shape (n,).
        high_from: largest v for the earlier tick; infinite where the direction is unknown.
    """

    place: Array
    touches: Flags
    direction: Array
    sine: Array
    cosine: Array
    low: Array
    high: Array
    high_from: Array


def surface_reaches(demand: Demand, limits: FitLimits, resolution: int) -> tuple[Ticks, Ticks]:
    """Reach of a plane and of a sphere, from the tick after a send at each tick, shape (n,) each."""
    contact = _contact(demand, limits)
    stiffness = _stiffness_on_a_line if demand.collinear else _stiffness

    def pair(earlier: Index, later: Index, _distance: int) -> tuple[Array, Array]:
        return stiffness(contact, earlier, later)

    least = np.zeros((3, demand.ticks))
    most = np.full_like(least, limits.stiffness[1] * (1.0 + ROUNDING))
    found = reaches(least, most, pair, jointly=False, resolution=resolution)
    # At the tick of a send the decoder outputs the sample: the model begins at the next tick.
    found = np.column_stack((found[:, 1:], np.full(3, demand.ticks)))
    return found[PLANE], np.maximum(found[CONVEX], found[CONCAVE])


def _contact(demand: Demand, limits: FitLimits) -> _ContactCone:
    size = lengths(demand.force)
    extent = limits.radius[1] + float(np.abs(demand.position).max(initial=0.0))
    # Rounding of the depth of a stiff surface far from its centre.
    slack = 16.0 * EPSILON * limits.stiffness[1] * extent
    least, most = demand.magnitudes
    least, most = least - slack, most + slack
    touches = (least > 0.0) & ~demand.at_edge
    known = np.where(touches, size, 1.0)
    if demand.sector is None:
        sine = np.where(touches, (demand.tolerance + slack) / known, 0.0)
    else:
        angle = demand.sector.directions(size, slack)
        # A cone of more than half of all directions does not confine the surface.
        touches &= angle < 0.5 * np.pi
        sine = np.where(touches, np.sin(angle), 0.0)
    axes = demand.used
    return _ContactCone(
        place=np.ascontiguousarray(demand.position.T[axes]),
        touches=touches,
        direction=np.where(touches, demand.force.T[axes] / known, 0.0),
        sine=sine,
        cosine=np.sqrt((1.0 - sine) * (1.0 + sine)),
        low=np.where(touches, least, -np.inf),
        high=np.where(demand.at_edge, np.inf, most),
        high_from=np.where(touches, most, np.inf),
    )


def _stiffness(contact: _ContactCone, earlier: Index, later: Index) -> tuple[Array, Array]:
    """The stiffness that pairs of ticks allow a convex sphere, a concave one and a plane, shape (3, pairs) each."""
    moved = contact.place[:, later] - contact.place[:, earlier]
    # Inequalities factor * s <= room; rows: convex and concave from the earlier tick, then from the later.
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
    # Conditions on the directions, for any stiffness.
    both = contact.touches[earlier] & contact.touches[later]
    turned = factor[:2] + factor[2:]
    impossible = np.empty((3, moved.shape[1]), dtype=bool)
    np.greater(turned, ROUNDING * np.abs(moved).max(axis=0), out=impossible[:PLANE])
    np.logical_or(impossible[CONVEX], impossible[CONCAVE], out=impossible[PLANE])
    impossible[PLANE] |= _apart(contact, earlier, later)
    impossible &= both
    np.copyto(lows, np.inf, where=impossible)
    return lows, highs


def _stiffness_on_a_line(contact: _ContactCone, earlier: Index, later: Index) -> tuple[Array, Array]:
    """The same where all cones are one line.

    Along the direction u of the contact the force is b - s u.p, within an interval at each tick. The two directions of
    a sphere are two lines with one slope.
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


def _along(contact: _ContactCone, at: Index, moved: Array) -> tuple[Array, Array]:
    """Least u.moved and least -u.moved over the cone of a tick, each of shape (pairs,)."""
    along: Array = (contact.direction[:, at] * moved).sum(axis=0)
    way = (moved * moved).sum(axis=0)
    length, middle = np.sqrt(way), along * contact.cosine[at]
    # The rounding of the difference under the root may widen a cone, never narrow it.
    across = np.sqrt(np.maximum(way - along * along, 0.0) + 4.0 * EPSILON * way) * contact.sine[at]
    inside = length * contact.cosine[at]
    return np.where(along <= -inside, -length, middle - across), np.where(along >= inside, -length, -middle - across)


def _solve(factor: Array, room: Array, low: Array, high: Array) -> None:
    """The interval of s with s * factor <= room in the first half of the rows and in the second."""
    half = len(factor) // 2
    negative, bound = factor < 0.0, room / factor
    lows, highs = np.where(negative, bound, -np.inf), np.where(negative, np.inf, bound)
    np.maximum(lows[:half], lows[half:], out=low)
    np.minimum(highs[:half], highs[half:], out=high)


def _apart(contact: _ContactCone, earlier: Index, later: Index) -> Flags:
    """Whether two cones do not intersect: the angle between their axes exceeds the sum of the half-angles."""
    between: Array = (contact.direction[:, earlier] * contact.direction[:, later]).sum(axis=0)
    sine, cosine = contact.sine, contact.cosine
    return between < cosine[earlier] * cosine[later] - sine[earlier] * sine[later] - ROUNDING
