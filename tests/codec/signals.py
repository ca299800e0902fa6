"""Seeded haptic signals at 1 kHz: points that move over surfaces, and contacts with known parameters."""

from collections.abc import Callable
from math import cos, pi, sin
from random import Random

from weberlink.geometry.vector import ZERO, Vector, norm, scale, subtract

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


def rubbing_stream(seed: int, *, ticks: int) -> Stream:
    """Strokes over a plane with friction, with breaks of contact."""
    random, stream = Random(seed), []
    stiffness, (before, aside, _) = random.uniform(300.0, 1500.0), stroke(seed - 1e-3)
    for tick in range(ticks):
        t = tick * 1e-3
        x, y, height = stroke(t + seed)
        height += 4e-3 * max(0.0, cos(2.0 * pi * 1.7 * t))
        push, way = stiffness * max(0.0, -height), (x - before, y - aside, 0.0)
        before, aside = x, y
        u, v, _ = scale(way, -0.3 * push / norm(way))
        force = (u + random.gauss(0.0, NOISE), v + random.gauss(0.0, NOISE), push + random.gauss(0.0, NOISE))
        stream.append((force if push else ZERO, (x, y, height)))
    return stream
