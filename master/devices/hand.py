"""A model of the operator's hand on the handle: impedance and physiological tremor."""

from collections.abc import Callable
from math import cos, cosh, exp, hypot, pi, sin, sinh, sqrt
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from weberlink.geometry.vector import ZERO, Vector


class Oscillator(NamedTuple):
    """A mass [kg] or an inertia [kg m^2], its damper and its spring, per metre or per radian."""

    inertia: float
    damping: float
    stiffness: float


class HandOptions(BaseModel):
    """Impedance of hand and handle.

    The defaults are those of a firm, posture-keeping arm. The order of magnitude is that of van Beek, Bergmann Tiest,
    Mugge and Kappers, "Haptic perception of force magnitude and its relation to postural arm dynamics in 3D", Sci. Rep.
    5:18004 (2015), where one trial gave 0.55 kg, 6.5 N s/m and 135 N/m.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    mass_kg: float = Field(default=0.3, ge=1e-6, le=1e3, description="hand and handle")
    damping_n_s_m: float = Field(default=8.0, ge=0.0, le=1e6)
    stiffness_n_m: float = Field(
        default=300.0, ge=1e-3, le=1e9, description="how hard it holds on to where it wants to be"
    )

    @property
    def oscillator(self) -> Oscillator:
        return Oscillator(self.mass_kg, self.damping_n_s_m, self.stiffness_n_m)


class Hand:
    """m a = k (intended - x) - b v + felt, per axis.

    Integrated by the exact solution for an intention and a force that are constant over the step, so it is stable at
    any step. Held against a constant force it yields by force / stiffness.
    """

    __slots__ = ("_damping", "_mass", "_stiffness", "_transition", "position", "velocity")

    def __init__(self, options: HandOptions, position: Vector) -> None:
        self._mass = options.mass_kg
        self._damping = options.damping_n_s_m
        self._stiffness = options.stiffness_n_m
        self._transition = (0.0, 1.0, 0.0, 0.0, 1.0)
        self.position = position
        self.velocity = ZERO

    def advance(self, intended: Vector, felt: Vector, step: float) -> None:
        """Moves on by `step` [s] toward `intended` [m] under the force `felt` [N]."""
        if step != self._transition[0]:
            self._transition = (step, *transition(self._mass, self._damping, self._stiffness, step))
        _, a, b, c, d = self._transition
        compliance = 1.0 / self._stiffness
        p, v = self.position, self.velocity
        # Around the resting point that this intention and this force would lead to, the motion is a free oscillation.
        rest_x, rest_y, rest_z = (
            intended[0] + felt[0] * compliance,
            intended[1] + felt[1] * compliance,
            intended[2] + felt[2] * compliance,
        )
        x, y, z = p[0] - rest_x, p[1] - rest_y, p[2] - rest_z
        self.position = (rest_x + a * x + b * v[0], rest_y + a * y + b * v[1], rest_z + a * z + b * v[2])
        self.velocity = (c * x + d * v[0], c * y + d * v[1], c * z + d * v[2])


def transition(mass: float, damping: float, stiffness: float, step: float) -> tuple[float, float, float, float]:
    """exp(A h) of m a = -k x - b v, row by row, in closed form.

    With s = b / 2m and w^2 = k/m - s^2: exp(-s h) [[C + s S, S], [-k/m S, C - s S]] where C = cos(w h), S = sin(w h)
    / w; hyperbolic for w^2 < 0, and C = 1, S = h at w = 0.
    """
    decay = damping / (2.0 * mass)
    squared = stiffness / mass - decay * decay
    angle = sqrt(abs(squared)) * step
    if angle == 0.0:
        even, odd = exp(-decay * step), exp(-decay * step) * step
    elif squared > 0.0:
        even, odd = exp(-decay * step) * cos(angle), exp(-decay * step) * sin(angle) / angle * step
    elif angle < 1.0:
        even, odd = exp(-decay * step) * cosh(angle), exp(-decay * step) * sinh(angle) / angle * step
    else:  # both exponents are negative; multiplied out, so that neither factor overflows
        slow, fast = exp(angle - decay * step), exp(-angle - decay * step)
        even, odd = (slow + fast) / 2.0, (slow - fast) / (2.0 * angle) * step
    return even + decay * odd, odd, -stiffness / mass * odd, even - decay * odd


LOWEST_HZ, HIGHEST_HZ = 8.0, 12.0
COMPONENTS = 4


class Tremor:
    """Displacement of the intended position that makes the free hand tremble by `rms` along each axis.

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
    """Written out for speed: it runs three times a tick."""
    (a, w, p), (b, x, q), (c, y, r), (d, z, s) = waves
    return a * sin(w * time + p) + b * sin(x * time + q) + c * sin(y * time + r) + d * sin(z * time + s)


def gain(hand: Oscillator, omega: float) -> float:
    """|x / intended| of the free hand at `omega` [rad/s]: k / |k - m omega^2 + j b omega|."""
    real = hand.stiffness - hand.inertia * omega * omega
    return hand.stiffness / hypot(real, hand.damping * omega)


class WristOptions(BaseModel):
    """Rotational impedance of hand and handle about the tip, the same about every axis, with tremor and wobble.

    The defaults are an assumption, not a measurement: natural frequency (5 Hz) and damping ratio (0.42) are those of
    the hand that moves, and 2 N m/rad is meant for a hand that holds on. A real wrist is stiffer in some directions
    than in others, and relaxed it is softer (Formica, Charles, Zollo, Guglielmelli, Hogan and Krebs, "The passive
    stiffness of the wrist and forearm", J. Neurophysiol. 108, 2012).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    inertia_kg_m2: float = Field(default=0.002, ge=1e-9, le=1e3, description="hand and handle")
    damping_n_m_s_rad: float = Field(default=0.053, ge=0.0, le=1e6)
    stiffness_n_m_rad: float = Field(
        default=2.0, ge=1e-6, le=1e9, description="how hard it holds on to how it wants to be"
    )
    tremor_rad: float = Field(
        default=0.0005, ge=0.0, le=0.1, description="RMS about each axis of the free hand, 8 to 12 Hz; 0 for none"
    )
    wobble_deg: Vector = Field(
        default=ZERO, description="amplitude of a slow turning about x, y, z on top of the script, as one who explores"
    )
    wobble_hz: float = Field(default=0.3, gt=0.0, le=5.0)

    @property
    def oscillator(self) -> Oscillator:
        return Oscillator(self.inertia_kg_m2, self.damping_n_m_s_rad, self.stiffness_n_m_rad)
