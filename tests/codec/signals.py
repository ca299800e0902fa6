"""Seeded haptic signals at 1 kHz: points that move over surfaces, and contacts with known parameters.

The friction here is a god-object in tangential coordinates, independent of the implementation in the codec.
"""

from collections.abc import Callable
from math import cos, pi, sin
from random import Random

import numpy as np
import numpy.typing as npt

from weberlink.geometry.vector import ZERO, Vector, norm, scale, subtract

Array = npt.NDArray[np.float64]
Stream = list[tuple[Vector, Vector]]  # Per tick: force [N], commanded position [m]
Path = Callable[[float], tuple[float, float, float]]
"""Position of the hand at a time [s]: along two tangents and along the normal, below 0 inside the surface [m]."""
NOISE = 2e-3  # Noise of a force sensor on each axis, rms [N]


def up(force: float) -> Vector:
    """Along z."""
    return (0.0, 0.0, force)


def contact_stream(seed: int, *, ticks: int = 400, axes: str = "xyz") -> Stream:
    """A sum of sinusoids over a plane, a dome or a cavity, with random noise and dropouts of the force."""
    random = Random(seed)
    frequencies = [random.uniform(0.2, 8.0) for _ in range(3)]
    amplitudes = [random.uniform(0.0, 0.03) for _ in range(3)]
    stiffness = 10.0 ** random.uniform(1.0, 4.5)
    surface = random.choice([_plane, _dome, _cavity])
    noise = random.choice([0.0, 0.0, 1e-3, 0.1])
    keep = [float(axis in axes) for axis in "xyz"]
    stream: Stream = []
    for tick in range(ticks):
        at = tick * 1e-3
        x, y, z = (a * sin(2.0 * pi * f * at + i) for i, (a, f) in enumerate(zip(amplitudes, frequencies, strict=True)))
        u, v, w = (stiffness * depth + random.gauss(0.0, noise) for depth in surface((x, y, z)))
        if random.random() < 0.01:
            u = v = w = 0.0
        a, b, c = keep
        stream.append(((a * u, b * v, c * w), (a * x, b * y, c * z)))
    return stream


def _plane(p: Vector) -> Vector:
    return (0.0, 0.0, max(0.0, -p[2]))


def _dome(p: Vector) -> Vector:
    return _ball(subtract(p, (0.0, 0.0, -0.05)), 0.05, 1.0)


def _cavity(p: Vector) -> Vector:
    return _ball(subtract(p, (0.0, 0.0, 0.02)), 0.03, -1.0)


def _ball(offset: Vector, radius: float, sign: float) -> Vector:
    length = norm(offset)
    return ZERO if length == 0.0 else scale(offset, sign * max(0.0, sign * (radius - length)) / length)


def stroke(t: float) -> tuple[float, float, float]:
    """A hand that strokes to and fro, some millimetres deep and with tremor."""
    depth = 3e-3 + 8e-4 * sin(2.0 * pi * 1.3 * t) + 1e-4 * sin(2.0 * pi * 9.0 * t)
    return 8e-3 * sin(2.0 * pi * 0.7 * t), 5e-3 * sin(2.0 * pi * 0.45 * t + 0.4), -depth


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


def rubbing_stream(seed: int, *, ticks: int) -> Stream:
    """Strokes over a surface with friction, with breaks of contact."""
    random = Random(seed)
    god = GodObject(random.uniform(300.0, 1500.0), random.choice([0.0, 20.0, -20.0]), 0.3)

    def path(t: float) -> tuple[float, float, float]:
        a, b, height = stroke(t + seed)
        return a, b, height + 4e-3 * max(0.0, cos(2.0 * pi * 1.7 * t))

    return contact(god, ticks=ticks, path=path, seed=seed)


def _vector(array: Array) -> Vector:
    return (float(array[0]), float(array[1]), float(array[2]))
