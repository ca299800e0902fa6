"""Where a surface is, for a hand that means to go along it: (u, v, above) to a point, all in metres.

u and v are lengths along the surface, `above` is the height over it; a negative one is how deep the hand means to be.
"""

from collections.abc import Callable
from math import cos, hypot, sin

from weberlink.geometry.vector import Vector

Chart = Callable[[Vector], Vector]


def level(height: float) -> Chart:
    """The horizontal plane at z = `height`."""
    return lambda place: (place[0], place[1], place[2] + height)


def ball(center: Vector, radius: float) -> Chart:
    """The outside of a ball; its top is u = v = 0, and every line through it is a great circle."""
    return lambda place: _round(center, radius, place, place[2])


def bowl(center: Vector, radius: float) -> Chart:
    """The inside of a hollow ball; its lowest point is u = v = 0."""

    def at(place: Vector) -> Vector:
        x, y, z = _round(center, radius, place, -place[2])
        return (x, y, 2.0 * center[2] - z)

    return at


def _round(center: Vector, radius: float, place: Vector, outward: float) -> Vector:
    u, v, _ = place
    arc = hypot(u, v)
    if arc == 0.0:
        return (center[0], center[1], center[2] + radius + outward)
    angle, length = arc / radius, radius + outward
    side = length * sin(angle) / arc
    return (center[0] + side * u, center[1] + side * v, center[2] + length * cos(angle))
