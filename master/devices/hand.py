"""A model of the operator's hand on the handle: impedance and physiological tremor."""

from collections.abc import Callable, Sequence
from math import ceil, cos, cosh, exp, log2, pi, sin, sinh, sqrt
from typing import Any

from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.hand_options import GraspOptions, HandOptions, Oscillator


class FirmHand:
    """m a = k (intended - x) - b v + felt: hand and handle move as one mass, per axis.

    Integrated by the exact solution for an intention and a force that are constant over the step, so it is stable at
    any step. Held against a constant force it yields by force / k.
    """

    def __init__(self, options: HandOptions, position: Vector) -> None:
        self._oscillator = options.oscillator
        self._compliance = 1.0 / options.stiffness_n_m
        self._transition = (0.0, 1.0, 0.0, 0.0, 1.0)
        self.position = position
        self.velocity = ZERO

    def advance(self, intended: Vector, felt: Vector, step: float) -> None:
        """Moves on by `step` [s] toward `intended` [m] under the force `felt` [N] on the handle."""
        if step != self._transition[0]:
            self._transition = (step, *transition(*self._oscillator, step))
        _, a, b, c, d = self._transition
        compliance, p, v = self._compliance, self.position, self.velocity
        # Around the resting point that this intention and this force would lead to, the motion is a free oscillation.
        rest_x, rest_y, rest_z = (
            intended[0] + felt[0] * compliance,
            intended[1] + felt[1] * compliance,
            intended[2] + felt[2] * compliance,
        )
        x, y, z = p[0] - rest_x, p[1] - rest_y, p[2] - rest_z
        self.position = (rest_x + a * x + b * v[0], rest_y + a * y + b * v[1], rest_z + a * z + b * v[2])
        self.velocity = (c * x + d * v[0], c * y + d * v[1], c * z + d * v[2])


class GraspingHand:
    """Arm (x', v', m') and handle (x, v, m), coupled by the spring k and the damper b of the grasp:

    m' a' = k' (intended - x') - b' v' + k (x - x') + b (v - v')
    m a = k (x' - x) + b (v' - v) - c v + felt

    The intention acts on the arm, the force on the handle, which alone has the damping c of the device. Exact at any
    step, as `FirmHand` is.
    """

    def __init__(self, options: HandOptions, grasp: GraspOptions, position: Vector) -> None:
        self._options, self._grasp = options, grasp
        self._step = 0.0
        self._steps: Sequence[Sequence[float]] = ()
        self.position = self.arm = position
        self.velocity = self.arm_velocity = ZERO

    def advance(self, intended: Vector, felt: Vector, step: float) -> None:
        if step != self._step:
            self._step, self._steps = step, handle_and_arm(self._options, self._grasp, step)
        axes = zip(self.position, self.velocity, self.arm, self.arm_velocity, intended, felt, strict=True)
        (a, b, c, d, e), (f, g, h, i, j), (k, m, n, o, p), (q, r, s, t, u) = self._steps
        after = [
            (
                to + a * (x - to) + b * v + c * (y - to) + d * w + e * force,
                f * (x - to) + g * v + h * (y - to) + i * w + j * force,
                to + k * (x - to) + m * v + n * (y - to) + o * w + p * force,
                q * (x - to) + r * v + s * (y - to) + t * w + u * force,
            )
            for x, v, y, w, to, force in axes
        ]
        self.position, self.velocity, self.arm, self.arm_velocity = zip(*after, strict=True)


Hand = FirmHand | GraspingHand  # with the position [m] and velocity [m/s] of the handle


def modelled_hand(options: HandOptions, position: Vector) -> Hand:
    """A hand at rest at a position [m], as its own intention."""
    held = options.held
    return FirmHand(options, position) if held is None else GraspingHand(options, held, position)


def handle_and_arm(options: HandOptions, grasp: GraspOptions, step: float) -> list[list[float]]:
    """The exact step of `GraspingHand` about an intention at 0.

    Returns:
        Position and velocity of the handle, then of the arm, after a step [s]; columns: the same before it, and the
        response to 1 N held on the handle. Shape (4, 5).
    """
    arm, (handle, damping, stiffness), own = options.oscillator, grasp.oscillator, grasp.handle_damping_n_s_m
    rates = [
        [0.0, 1.0, 0.0, 0.0, 0.0],
        [-stiffness / handle, -(damping + own) / handle, stiffness / handle, damping / handle, 1.0 / handle],
        [0.0, 0.0, 0.0, 1.0, 0.0],
        [
            stiffness / arm.inertia, damping / arm.inertia,
            -(stiffness + arm.stiffness) / arm.inertia, -(damping + arm.damping) / arm.inertia, 0.0,
        ],
        [0.0, 0.0, 0.0, 0.0, 0.0],
    ]  # fmt: skip
    return exponential([[rate * step for rate in row] for row in rates])[:4]


def exponential(matrix: Sequence[Sequence[float]]) -> list[list[float]]:
    """exp(A) of a small square matrix, by scaling, the Taylor series and squaring.

    The identity is kept apart until the end, (1 + E)^2 - 1 = 2 E + E^2: else a tick that changes little would be lost
    in the rounding of ones.
    """
    import numpy as np  # noqa: PLC0415 - with a grasp only

    given: Any = np.asarray(matrix)
    largest = float(abs(given).sum(axis=1).max())
    halvings = max(0, ceil(log2(largest)) + 3) if largest > 0.0 else 0
    scaled = given / 2.0**halvings
    change = term = scaled
    for order in range(2, TERMS + 1):
        term = term @ scaled / order
        change = change + term
    for _ in range(halvings):
        change = 2.0 * change + change @ change
    result: list[list[float]] = (change + np.eye(len(matrix))).tolist()
    return result


TERMS = 12  # of the Taylor series; the norm of its matrix is at most 1/8, so the remainder is below 1e-21


def transition(mass: float, damping: float, stiffness: float, step: float) -> tuple[float, float, float, float]:
    """exp(A h) of m a = -k x - b v, row by row, in closed form.

    With s = b / 2m and w^2 = k/m - s^2: exp(-s h) [[C + s S, S], [-k/m S, C - s S]] where C = cos(w h), S = sin(w h)
    / w; hyperbolic for w^2 < 0, and C = 1, S = h at w = 0.
    """
    decay = damping / (2.0 * mass)
    squared = stiffness / mass - decay * decay
    angle, faded = sqrt(abs(squared)) * step, exp(-decay * step)
    if angle == 0.0:
        even, odd = faded, faded * step
    elif squared > 0.0:
        even, odd = faded * cos(angle), faded * sin(angle) / angle * step
    elif angle < 1.0:
        even, odd = faded * cosh(angle), faded * sinh(angle) / angle * step
    else:  # both exponents are negative; multiplied out, so that neither factor overflows
        slow, fast = exp(angle - decay * step), exp(-angle - decay * step)
        even, odd = (slow + fast) / 2.0, (slow - fast) / (2.0 * angle) * step
    return even + decay * odd, odd, -stiffness / mass * odd, even - decay * odd


LOWEST_HZ, HIGHEST_HZ = 8.0, 12.0
COMPONENTS = 4
Waves = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
"""Amplitude, angular frequency [rad/s] and phase [rad] of each component."""


class Tremor:
    """Displacement of the intended position that makes the free hand tremble by `rms` [m] or [rad] along each axis.

    A few sinusoids between 8 and 12 Hz (the band of the neural component; Elble, "Physiologic and enhanced physiologic
    tremor", Handbook of Clinical Neurophysiology 1, 2003) with drawn frequencies and phases: a pure function of time,
    and reproducible. Each is divided by the gain of the hand at its frequency, so that it is the hand that trembles by
    the stated amount, some tens of micrometres in a healthy adult; against a wall it yields like any other intention.
    Of an orientation it is the rotation vector. `uniform` draws from [0, 1).
    """

    def __init__(self, rms: float, hand: Oscillator | HandOptions, uniform: Callable[[], float]) -> None:
        self._axes = [_drawn(rms, hand, uniform) for _ in range(3)]

    def at(self, time: float) -> Vector:
        """Displacement [m] or [rad] of the intention at `time` [s]."""
        x, y, z = [  # written out for speed
            a * sin(w * time + p) + b * sin(x * time + q) + c * sin(y * time + r) + d * sin(z * time + s)
            for a, w, p, b, x, q, c, y, r, d, z, s in self._axes
        ]
        return (x, y, z)


def _drawn(rms: float, hand: Oscillator | HandOptions, uniform: Callable[[], float]) -> Waves:
    waves: list[float] = []
    for _ in range(COMPONENTS):
        omega = 2.0 * pi * (LOWEST_HZ + (HIGHEST_HZ - LOWEST_HZ) * uniform())
        waves += (rms * sqrt(2.0 / COMPONENTS) / hand.gain(omega), omega, 2.0 * pi * uniform())
    a, w, p, b, x, q, c, y, r, d, z, s = waves
    return a, w, p, b, x, q, c, y, r, d, z, s
