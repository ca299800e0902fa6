"""Contacts whose truth is known, at 1 kHz: walls, domes and cavities, with friction or moving, and a hand upon them.

The friction here is a god-object in tangential coordinates, written apart from that of the codec.
"""

from collections.abc import Callable
from math import cos, pi, sin
from random import Random

import numpy as np
import numpy.typing as npt

from tests.codec.signals import Stream
from weberlink.geometry.vector import Vector

Array = npt.NDArray[np.float64]
Path = Callable[[float], tuple[float, float, float]]
"""Where the hand is at a time [s]: along two tangents and, below 0, into the surface [m]."""
NOISE = 2e-3
"""Of a force sensor, on each axis [N]."""


def stroke(t: float) -> tuple[float, float, float]:
    """A hand that strokes to and fro some millimetres deep, with its tremor."""
    depth = 3e-3 + 8e-4 * sin(2.0 * pi * 1.3 * t) + 1e-4 * sin(2.0 * pi * 9.0 * t)
    return 8e-3 * sin(2.0 * pi * 0.7 * t), 5e-3 * sin(2.0 * pi * 0.45 * t + 0.4), -depth


class GodObject:
    """Of a ball with the centre at `curvature`'s distance below the origin, or a wall through it, normal +z.

    Args:
        stiffness: [N/m].
        curvature: 1/radius [1/m]: positive convex, negative concave, 0 a wall.
        friction: coefficient.
    """

    def __init__(self, stiffness: float, curvature: float = 0.0, friction: float = 0.0) -> None:
        self.stiffness = stiffness
        self.curvature = curvature
        self.friction = friction
        self.proxy: Array | None = None

    def foot(self, probe: Array) -> tuple[Array, Array, float]:
        """Nearest place of the surface, its normal there and the depth of a probe."""
        if self.curvature == 0.0:
            return np.array([probe[0], probe[1], 0.0]), np.array([0.0, 0.0, 1.0]), -float(probe[2])
        radius = 1.0 / self.curvature
        centre = np.array([0.0, 0.0, -radius])
        normal = np.sign(radius) * (probe - centre) / np.linalg.norm(probe - centre)
        foot = centre + radius * normal
        return foot, normal, float((foot - probe) @ normal)

    def force(self, probe: Array) -> Array:
        foot, normal, depth = self.foot(probe)
        if depth <= 0.0:
            self.proxy = probe
            return np.zeros(3)
        if self.proxy is None:
            self.proxy = foot
        projector = np.eye(3) - np.outer(normal, normal)
        back = projector @ (self.proxy - foot)
        length, cone = np.linalg.norm(back), self.friction * depth
        self.proxy = foot + (back * cone / length if length > cone else back)
        return self.stiffness * (self.proxy - probe)


def turned(normal: Vector) -> Array:
    """A rotation that takes +z to a normal."""
    z = np.array(normal) / np.linalg.norm(normal)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def contact(
    god: GodObject,
    *,
    ticks: int,
    path: Path = stroke,
    normal: Vector = (0.3, -0.2, 0.93),
    lift: Callable[[float], float] = lambda t: 0.0,
    noise: float = NOISE,
    seed: int = 1,
) -> Stream:
    """Force and position a tick.

    On what is curved the tangential way runs along the surface, so that the depth is that of the path.

    Args:
        god: that makes the force.
        ticks: of 1 ms.
        path: of the hand, relative to the surface at rest.
        normal: of the surface, in the frame of the stream.
        lift: height of the surface over its place at a time [m].
        noise: of the sensor [N].
        seed: of the noise.
    """
    rotation, random, stream = turned(normal), Random(seed), []
    for tick in range(ticks):
        t = tick * 1e-3
        a, b, height = path(t)
        probe = np.array([a, b, height])
        if god.curvature != 0.0:
            centre = np.array([0.0, 0.0, -1.0 / god.curvature])
            direction = np.array([a, b, 1.0 / god.curvature]) / np.hypot(np.hypot(a, b), 1.0 / god.curvature)
            probe = centre + direction * (abs(1.0 / god.curvature) + height * np.sign(god.curvature))
        up = np.array([0.0, 0.0, lift(t)])
        force, place = rotation @ god.force(probe - up), rotation @ probe
        stream.append((_noisy(force, noise, random), _vector(place)))
    return stream


def rubbing_stream(seed: int, *, ticks: int) -> Stream:
    """A stroke over something rough that is left and touched again now and then."""
    random = Random(seed)
    god = GodObject(random.uniform(300.0, 1500.0), random.choice([0.0, 20.0, -20.0]), 0.3)

    def path(t: float) -> tuple[float, float, float]:
        a, b, height = stroke(t + seed)
        return a, b, height + 4e-3 * max(0.0, cos(2.0 * pi * 1.7 * t))

    return contact(god, ticks=ticks, path=path, seed=seed)


def _noisy(force: Array, noise: float, random: Random) -> Vector:
    if not force.any():
        return _vector(force)
    return _vector(force + np.array([random.gauss(0.0, noise) for _ in range(3)]))


def _vector(array: Array) -> Vector:
    return (float(array[0]), float(array[1]), float(array[2]))
