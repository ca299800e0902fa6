"""The linear model of the sampled virtual wall: when it is stable against a hand, and when it is passive against any.

In tick n the force f_n = -(K x + B (x - x_before) / T) is computed from the sampled position, applied `delay_ticks`
ticks later, and held for a tick T. Device and hand follow m a = -k x - b v + f, or are two masses with a grasp between
them; either is solved exactly, as by the modelled hand. Without delay this is the wall of the textbooks. One tick of
delay corresponds to both daemons over a link without delay, because the force that answers a position is applied one
tick later. `measured_wall` measures the same loop.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import log, pi, sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from weberlink.control import account
from weberlink.master.devices.hand import handle_and_arm, transition
from weberlink.master.devices.hand_options import HandOptions

Grip = Literal["firm", "pinch", "fingertip"]
"""How the hand holds the device: firmly, as one mass with it, or with a grasp between them."""

PRECISION = 1e-9  # relative precision of a limit
STEPS_PER_DECADE = 1000  # density of the frequencies of the loop gain


@dataclass(frozen=True)
class SampledWall:
    """The loop without the stiffness of the wall."""

    mass_kg: float  # m, of device and hand, > 0; of the arm alone with a grasp, as the next two
    damping_n_s_m: float  # b, of device and hand, > 0
    hand_stiffness_n_m: float  # k, > 0; small values approach a free device
    tick_period: float  # T [s]
    delay_ticks: int = 0  # from the sampling of a position to the force that answers it, whole ticks
    wall_damping_n_s_m: float = 0.0  # B
    grip: Grip = "firm"  # the grasp

    @property
    def hand(self) -> HandOptions:
        """Hand and device as the options of the modelled hand."""
        return HandOptions(
            mass_kg=self.mass_kg,
            damping_n_s_m=self.damping_n_s_m,
            stiffness_n_m=self.hand_stiffness_n_m,
            grasp=None if self.grip == "firm" else self.grip,
        )

    @property
    def device_damping_n_s_m(self) -> float:
        """The damping that is there whatever the hand does: that of device and hand, of the handle with a grasp."""
        held = self.hand.held
        return self.damping_n_s_m if held is None else held.handle_damping_n_s_m

    @cached_property
    def step(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """One tick without the wall.

        Returns:
            Transition matrix of position and velocity of the device, with a grasp also of the arm, shape (n, n), and
            their response to 1 N held, shape (n,).
        """
        hand = self.hand
        if hand.held is not None:
            steps = np.asarray(handle_and_arm(hand, hand.held, self.tick_period))
            return steps[:, :4], steps[:, 4]
        a, b, c, d = transition(*hand.oscillator, self.tick_period)
        return np.asarray([[a, b], [c, d]]), np.asarray([1.0 - a, -c]) / self.hand_stiffness_n_m


def loop_matrix(wall: SampledWall, stiffness: float) -> NDArray[np.float64]:
    """One tick of the closed loop, while the contact lasts.

    The state is that of the hand, previous position, and the delayed forces, newest first.
    """
    transition_matrix, response = wall.step
    hand = len(response)
    size = hand + 1 + wall.delay_ticks
    law = np.zeros(size)
    rate = wall.wall_damping_n_s_m / wall.tick_period
    law[0], law[hand] = -(stiffness + rate), rate
    if wall.delay_ticks == 0:
        applied = law
    else:
        applied = np.zeros(size)
        applied[-1] = 1.0
    loop = np.zeros((size, size))
    loop[:hand, :hand] = transition_matrix
    loop[:hand] += np.outer(response, applied)
    loop[hand, 0] = 1.0
    if wall.delay_ticks:
        loop[hand + 1] = law
        for place in range(hand + 2, size):
            loop[place, place - 1] = 1.0
    return loop


def stability_limit(wall: SampledWall) -> float:
    """The stiffness [N/m] at which the spectral radius passes 1, from below."""
    start = passivity_limit(wall) or wall.damping_n_s_m / wall.tick_period

    def grows(stiffness: float) -> bool:
        return float(np.abs(np.linalg.eigvals(loop_matrix(wall, stiffness))).max()) > 1.0  # the spectral radius

    low, high = bracket(grows, start)
    return bisect(grows, low, high, PRECISION)


def gain_limit(wall: SampledWall) -> float:
    """The same limit [N/m] from the frequency response, which also handles delays of thousands of ticks.

    Without a wall the hand is stable, so the first stiffness that puts a pole on the unit circle, at exp(j w), is the
    smallest that solves 1 + K L(exp(j w)) = 0 where L is real and negative: K = -1 / L. Only for walls without damping.
    """
    if wall.wall_damping_n_s_m:
        raise ValueError("the gain at which a damped wall becomes unstable is not that of its stiffness alone")
    candidates = [-1.0 / gain for gain in _negative_gains(wall)]
    return min(candidates)


def passivity_limit(wall: SampledWall) -> float:
    """The stiffness [N/m] up to which wall and device together are passive against any hand; may be 0."""
    return account.passivity_limit(
        wall.device_damping_n_s_m, wall.tick_period, delay_ticks=wall.delay_ticks, wall_damping=wall.wall_damping_n_s_m
    )


def bracket(exceeds: Callable[[float], bool], start: float) -> tuple[float, float]:
    """Two values a factor of two apart: `exceeds` is false at the lower one and true at the upper one."""
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
    low, high, rising = angles[crossings], angles[crossings + 1], imaginary[crossings + 1] > 0.0
    while (high > low * (1.0 + PRECISION)).any():  # all at once: a long delay has thousands
        middle = np.sqrt(low * high)
        passed = (_loop_gain(wall, middle).imag > 0.0) == rising
        low, high = np.where(passed, low, middle), np.where(passed, middle, high)
    gains = _loop_gain(wall, np.append(low, pi)).real
    return [float(gain) for gain in gains if gain < 0.0]


def _loop_gain(wall: SampledWall, angles: NDArray[np.float64]) -> NDArray[np.complex128]:
    """From a held force to the sampled position, after the delay, at exp(j w)."""
    transition_matrix, response = wall.step
    z = np.exp(1j * angles)
    resolvent = z[:, None, None] * np.eye(len(response)) - transition_matrix
    state = np.linalg.solve(resolvent, np.broadcast_to(response[:, None], (len(z), len(response), 1)))
    return np.asarray(state[:, 0, 0] * z**-wall.delay_ticks)
