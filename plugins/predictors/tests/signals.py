"""Signals of a hand on a surface with known stiffness, curvature and friction.

The friction here is a god-object in tangential coordinates, independent of the implementation in the codec.
"""

from collections.abc import Callable
from random import Random

import numpy as np
import numpy.typing as npt

from tests.codec.signals import NOISE, Path, Stream, stroke
from weberlink.geometry.vector import Vector

Array = npt.NDArray[np.float64]


class GodObject:
    """On a ball of radius 1/`curvature` below the origin (concave if negative), or on a wall if 0; normal +z."""

    def __init__(self, stiffness: float, curvature: float = 0.0, friction: float = 0.0) -> None:
        self.stiffness = stiffness
        self.curvature = curvature
        self.friction = friction
        self.proxy: Array | None = None

    def foot(self, probe: Array) -> tuple[Array, Array, float]:
        """Nearest point of the surface, the normal there, and the depth of the probe."""
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
        back = (np.eye(3) - np.outer(normal, normal)) @ (self.proxy - foot)
        length, cone = np.linalg.norm(back), self.friction * depth
        self.proxy = foot + (back * cone / length if length > cone else back)
        return self.stiffness * (self.proxy - probe)


def contact(
    god: GodObject,
    *,
    ticks: int,
    path: Path = stroke,  # of the hand, relative to the surface at rest
    normal: Vector = (0.3, -0.2, 0.93),  # of the surface, in the frame of the stream
    lift: Callable[[float], float] = lambda t: 0.0,  # of the surface along its normal at a time [m]
    noise: float = NOISE,
    seed: int = 1,
) -> Stream:
    """The signal of a hand on a surface. On a curved one it moves along it, so that the depth is that of the path."""
    z = np.array(normal) / np.linalg.norm(normal)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    rotation, random, stream = np.stack([x, np.cross(z, x), z], axis=1), Random(seed), []
    for tick in range(ticks):
        t = tick * 1e-3
        a, b, height = path(t)
        probe = np.array([a, b, height])
        if god.curvature != 0.0:
            radius = 1.0 / god.curvature
            direction = np.array([a, b, radius]) / np.hypot(np.hypot(a, b), radius)
            probe = np.array([0.0, 0.0, -radius]) + direction * (abs(radius) + height * np.sign(radius))
        force = rotation @ god.force(probe - np.array([0.0, 0.0, lift(t)]))
        if force.any():
            force = force + np.array([random.gauss(0.0, noise) for _ in range(3)])
        stream.append((_vector(force), _vector(rotation @ probe)))
    return stream


def _vector(array: Array) -> Vector:
    return (float(array[0]), float(array[1]), float(array[2]))
