"""Seeded haptic signals for the codec's tests: a point that moves over and into curved, noisy, sticky surfaces."""

from math import cos, pi, sin
from random import Random

from weberlink.geometry.vector import Vector

Stream = list[tuple[Vector, Vector]]
"""Per tick: force [N], commanded position [m]."""


def contact_stream(seed: int, *, ticks: int = 400, axes: str = "xyz") -> Stream:
    """A sum of sinusoids as motion; a plane, a dome or a cavity as contact; noise, steps and rests as they come."""
    random = Random(seed)
    frequencies = [random.uniform(0.2, 8.0) for _ in range(3)]
    amplitudes = [random.uniform(0.0, 0.03) for _ in range(3)]
    stiffness = 10.0 ** random.uniform(1.0, 4.5)
    surface = random.choice([_plane, _dome, _cavity])
    noise = random.choice([0.0, 0.0, 1e-3, 0.1])
    stream: Stream = []
    for tick in range(ticks):
        at = tick * 1e-3
        p = [a * sin(2.0 * pi * f * at + i) for i, (a, f) in enumerate(zip(amplitudes, frequencies, strict=True))]
        f = [stiffness * depth + random.gauss(0.0, noise) for depth in surface(p)]
        if random.random() < 0.01:
            f = [0.0, 0.0, 0.0]
        keep = [axis in axes for axis in "xyz"]
        f = [value if kept else 0.0 for value, kept in zip(f, keep, strict=True)]
        p = [value if kept else 0.0 for value, kept in zip(p, keep, strict=True)]
        stream.append(((f[0], f[1], f[2]), (p[0], p[1], p[2])))
    return stream


def _plane(p: list[float]) -> list[float]:
    return [0.0, 0.0, max(0.0, -p[2])]


def _dome(p: list[float]) -> list[float]:
    return _sphere(p, (0.0, 0.0, -0.05), 0.05, inside=False)


def _cavity(p: list[float]) -> list[float]:
    return _sphere(p, (0.0, 0.0, 0.02), 0.03, inside=True)


def _sphere(p: list[float], centre: tuple[float, float, float], radius: float, *, inside: bool) -> list[float]:
    offset = [a - b for a, b in zip(p, centre, strict=True)]
    length = sum(x * x for x in offset) ** 0.5
    if length == 0.0:
        return [0.0, 0.0, 0.0]
    depth = max(0.0, length - radius) if inside else max(0.0, radius - length)
    return [(-depth if inside else depth) * x / length for x in offset]


def circle(ticks: int, radius: float, turns_per_s: float = 1.0) -> list[Vector]:
    """Positions on a horizontal circle [m], one per tick of 1 ms."""
    return [
        (radius * cos(2.0 * pi * turns_per_s * t * 1e-3), radius * sin(2.0 * pi * turns_per_s * t * 1e-3), 0.0)
        for t in range(ticks)
    ]
