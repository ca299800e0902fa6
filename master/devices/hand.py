"""A model of the operator's arm and hand on the handle; knows nothing of scripts, traces or time of day."""

from math import cos, cosh, exp, sin, sinh, sqrt
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

    mass_kg: float = Field(default=0.3, gt=0.0, description="hand and handle")
    damping_n_s_m: float = Field(default=8.0, ge=0.0)
    stiffness_n_m: float = Field(default=300.0, gt=0.0, description="how hard it holds on to where it wants to be")

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
