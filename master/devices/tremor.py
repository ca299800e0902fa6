"""Physiological tremor: the small oscillation of a hand that means to keep still."""

from collections.abc import Callable
from math import hypot, pi, sin, sqrt

from weberlink.geometry.vector import Vector
from weberlink.master.devices.hand import Oscillator

LOWEST_HZ, HIGHEST_HZ = 8.0, 12.0
COMPONENTS = 4


class Tremor:
    """What is added to the intended position so that the free hand trembles by `rms` along each axis.

    A few sinusoids between 8 and 12 Hz (the band of the neural component; Elble, "Physiologic and enhanced
    physiologic tremor", Handbook of Clinical Neurophysiology 1, 2003) with drawn frequencies and phases: a pure
    function of time, and reproducible. Each is divided by the gain of the hand at its frequency, so that it is the
    hand that trembles by the stated amount; against a wall it yields like any other intention. The same holds for the
    orientation, with a rotation vector in place of the position.

    Args:
        rms: Root mean square per axis of the free hand [m] or [rad]; some tens of micrometres in a healthy adult.
        hand: The impedance that the tremor passes through.
        uniform: Draws from [0, 1).
    """

    __slots__ = ("_axes",)

    def __init__(self, rms: float, hand: Oscillator, uniform: Callable[[], float]) -> None:
        self._axes: list[list[Vector]] = []
        for _ in range(3):
            waves: list[Vector] = []
            for _ in range(COMPONENTS):
                omega = 2.0 * pi * (LOWEST_HZ + (HIGHEST_HZ - LOWEST_HZ) * uniform())
                amplitude = rms * sqrt(2.0 / COMPONENTS) / gain(hand, omega)
                waves.append((amplitude, omega, 2.0 * pi * uniform()))
            self._axes.append(waves)

    def at(self, time: float) -> Vector:
        """Displacement [m] or [rad] of the intention at `time` [s]."""
        x, y, z = self._axes
        return (_sum(x, time), _sum(y, time), _sum(z, time))


def _sum(waves: list[Vector], time: float) -> float:
    """Written out, since this is done three times a tick."""
    (a, w, p), (b, x, q), (c, y, r), (d, z, s) = waves
    return a * sin(w * time + p) + b * sin(x * time + q) + c * sin(y * time + r) + d * sin(z * time + s)


def gain(hand: Oscillator, omega: float) -> float:
    """|x / intended| of the free hand at `omega` [rad/s]: k / |k - m omega^2 + j b omega|."""
    real = hand.stiffness - hand.inertia * omega * omega
    return hand.stiffness / hypot(real, hand.damping * omega)
