"""The linear model of the sampled virtual wall: when it is stable against a hand, and when it is passive against any.

In tick n the force f_n = -(K x + B (x - x_before) / T) is computed from the sampled position, applied `delay_ticks`
ticks later, and held for a tick T. Device and hand follow m a = -k x - b v + f, which `Hand` solves exactly. Without
delay this is the wall of the textbooks. One tick of delay corresponds to both daemons over a link without delay,
because the force that answers a position is applied one tick later. `measured_wall` measures the same loop.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from weberlink.control import passivity
from weberlink.master.devices.hand import transition

PRECISION = 1e-9
"""Relative precision of a limit."""

STEPS_PER_DECADE = 1000
"""Density of the frequencies of the loop gain."""


@dataclass(frozen=True)
class SampledWall:
    """The loop without the stiffness of the wall.

    Args:
        mass_kg: m, of device and hand, > 0.
        damping_n_s_m: b, of device and hand, > 0.
        hand_stiffness_n_m: k, > 0; small values approach a free device.
        tick_period: T [s].
        delay_ticks: from the sampling of a position to the force that answers it, whole ticks.
        wall_damping_n_s_m: B.
    """

    mass_kg: float
    damping_n_s_m: float
    hand_stiffness_n_m: float
    tick_period: float
    delay_ticks: int = 0
    wall_damping_n_s_m: float = 0.0

    @property
    def step(self) -> tuple[tuple[float, float, float, float], tuple[float, float]]:
        """One tick of the hand: transition matrix by rows, and response of position and velocity to 1 N held."""
        a, b, c, d = transition(self.mass_kg, self.damping_n_s_m, self.hand_stiffness_n_m, self.tick_period)
        return (a, b, c, d), ((1.0 - a) / self.hand_stiffness_n_m, -c / self.hand_stiffness_n_m)


def loop_matrix(wall: SampledWall, stiffness: float) -> NDArray[np.float64]:
    """One tick of the closed loop, while the contact lasts.

    The state is position, velocity, previous position, and the delayed forces, newest first.
    """
    (a, b, c, d), (to_position, to_velocity) = wall.step
    size = 3 + wall.delay_ticks
    law = np.zeros(size)
    rate = wall.wall_damping_n_s_m / wall.tick_period
    law[0], law[2] = -(stiffness + rate), rate
    if wall.delay_ticks == 0:
        applied = law
    else:
        applied = np.zeros(size)
        applied[-1] = 1.0
    loop = np.zeros((size, size))
    loop[0, :2], loop[1, :2] = (a, b), (c, d)
    loop[0] += to_position * applied
    loop[1] += to_velocity * applied
    loop[2, 0] = 1.0
    if wall.delay_ticks:
        loop[3] = law
        for place in range(4, size):
            loop[place, place - 1] = 1.0
    return loop


def spectral_radius(wall: SampledWall, stiffness: float) -> float:
    """Spectral radius of the closed loop; below 1 a disturbance of the pressed contact dies out."""
    return float(np.abs(np.linalg.eigvals(loop_matrix(wall, stiffness))).max())


def stability_limit(wall: SampledWall) -> float:
    """The stiffness [N/m] at which the spectral radius passes 1, from below.

    Raises:
        ValueError: if no wall is stable, however soft.
    """
    start = passivity_limit(wall) or wall.damping_n_s_m / wall.tick_period

    def grows(stiffness: float) -> bool:
        return spectral_radius(wall, stiffness) > 1.0

    low, high = bracket(grows, start)
    return bisect(grows, low, high, PRECISION)


def gain_limit(wall: SampledWall) -> float:
    """The same limit [N/m] from the frequency response, which also handles delays of thousands of ticks.

    Without a wall the hand is stable, so the first stiffness that puts a pole on the unit circle, at exp(j w), is the
    smallest that solves 1 + K L(exp(j w)) = 0 where L is real and negative: K = -1 / L. Only for walls without damping.

    Raises:
        ValueError: for a wall with damping.
    """
    if wall.wall_damping_n_s_m:
        raise ValueError("the gain at which a damped wall becomes unstable is not that of its stiffness alone")
    candidates = [-1.0 / gain for gain in _negative_gains(wall)]
    return min(candidates)


def passivity_limit(wall: SampledWall) -> float:
    """The stiffness [N/m] up to which wall and device together are passive; may be 0."""
    return passivity.passivity_limit(
        wall.damping_n_s_m,
        wall.tick_period,
        delay_ticks=wall.delay_ticks,
        wall_damping=wall.wall_damping_n_s_m,
    )


def bracket(exceeds: Callable[[float], bool], start: float) -> tuple[float, float]:
    """Two values a factor of two apart: `exceeds` is false at the lower one and true at the upper one.

    Raises:
        ValueError: if there are none within a factor of 1e9 from `start`.
    """
    factor = 0.5 if exceeds(start) else 2.0
    value = start
    while 1e-9 < value / start < 1e9:
        after = value * factor
        if exceeds(after) != (factor < 1.0):
            return (after, value) if factor < 1.0 else (value, after)
        value = after
    raise ValueError("no limit within a factor of 1e9")


def bisect(exceeds: Callable[[float], bool], low: float, high: float, precision: float) -> float:
    """Where `exceeds` turns true between two positive values, by halving their ratio down to 1 + precision."""
    while high > low * (1.0 + precision):
        middle = sqrt(low * high)
        if exceeds(middle):
            high = middle
        else:
            low = middle
    return sqrt(low * high)


def _negative_gains(wall: SampledWall) -> list[float]:
    """L(exp(j w)) wherever it is real and negative, for w in (0, pi]."""
    lowest = min(1e-6, 1e-3 * sqrt(wall.hand_stiffness_n_m / wall.mass_kg) * wall.tick_period)
    lowest = min(lowest, 1e-3 * wall.hand_stiffness_n_m / wall.damping_n_s_m * wall.tick_period)
    even = np.arange(1, 8 * (wall.delay_ticks + 1)) * (pi / (8 * (wall.delay_ticks + 1)))
    count = int(STEPS_PER_DECADE * log(pi / lowest, 10.0)) + 1
    angles = np.union1d(np.geomspace(lowest, pi, count)[:-1], even)
    imaginary = _loop_gain(wall, angles).imag
    crossings = np.flatnonzero(imaginary[1:] * imaginary[:-1] < 0.0)
    gains = [_gain_at_crossing(wall, float(angles[place]), float(angles[place + 1])) for place in crossings]
    gains.append(float(_loop_gain(wall, np.asarray([pi])).real[0]))
    return [gain for gain in gains if gain < 0.0]


def _gain_at_crossing(wall: SampledWall, low: float, high: float) -> float:
    rising = bool(_loop_gain(wall, np.asarray([high])).imag[0] > 0.0)

    def passed(angle: float) -> bool:
        return bool(_loop_gain(wall, np.asarray([angle])).imag[0] > 0.0) == rising

    crossing = bisect(passed, low, high, PRECISION)
    return float(_loop_gain(wall, np.asarray([crossing])).real[0])


def _loop_gain(wall: SampledWall, angles: NDArray[np.float64]) -> NDArray[np.complex128]:
    """From a held force to the sampled position, after the delay, at exp(j w)."""
    (a, b, c, d), (to_position, to_velocity) = wall.step
    z = np.exp(1j * angles)
    determinant = (z - a) * (z - d) - b * c
    return np.asarray(((z - d) * to_position + b * to_velocity) / determinant * z**-wall.delay_ticks)
