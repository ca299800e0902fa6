"""The stability limit of the sampled wall, measured: the real hand against the real plane, pressed and disturbed.

Owns the experiment and the way growth is told from decay. Knows nothing of eigenvalues, so that a measured limit says
something about an analytic one.
"""

from collections import deque
from math import ceil, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from weberlink.geometry.vector import ZERO
from weberlink.master.devices.hand import Hand, HandOptions
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.plane import PlaneShape
from weberlink.slave.scenes.scene import Scene
from weberlink.studies.stability.wall import Wall, bisect, bracket

DEPTH = 1e-3
"""How far the wall is pressed in [m]; the loop is linear, so it is the same limit at any depth."""

DISTURBANCE = 1e-3
"""What the hand is first displaced by, as a share of the depth: it can grow for long before contact is lost."""

PERIODS = 8
"""Of the contact's own oscillation, that a verdict looks at: four against four."""

SHORTEST = 400
"""Ticks of a verdict at least."""

GONE = 1e-18
"""Share of its energy at which a disturbance is gone for good: 1e-15 m, where rounding is still far away."""

PRECISION = 0.01
"""Relative, of a measured limit."""


def measured_limit(wall: Wall) -> float:
    """The stiffness [N/m] from which on a small disturbance of the pressed contact grows.

    Searched for from b / T on, in steps of two, and then by bisection.

    Raises:
        ValueError: if there is none within a factor of 1e9.
    """

    def grows_at(stiffness: float) -> bool:
        return grows(wall, stiffness)

    low, high = bracket(grows_at, wall.damping_n_s_m / wall.tick_period)
    return bisect(grows_at, low, high, PRECISION)


def grows(wall: Wall, stiffness: float) -> bool:
    """Whether a small disturbance of the pressed contact has more energy later than it had earlier.

    The energy of the disturbance, that of the hand's motion and of both springs, swings within a period; so two windows
    of four periods each are compared, weighted by a bell (Hann) that hides at which phase they begin.

    Args:
        wall: the loop.
        stiffness: of the wall [N/m].
    """
    omega = sqrt((stiffness + wall.hand_stiffness_n_m) / wall.mass_kg) * wall.tick_period
    ticks = max(SHORTEST, PERIODS * ceil(2.0 * pi / omega))
    energy = disturbance_energy(wall, stiffness, ticks)
    if len(energy) < ticks:
        return bool(energy[-1] > energy[0])
    half = ticks // 2
    bell = np.hanning(half)
    return bool((energy[half : 2 * half] * bell).sum() > (energy[:half] * bell).sum())


def disturbance_energy(wall: Wall, stiffness: float, ticks: int) -> NDArray[np.float64]:
    """Energy of the disturbance [J] at each tick; it ends early once contact is nearly lost, or the disturbance is.

    A constant force presses the hand to `DEPTH`, where it also means to be, and it begins slightly beside.
    """
    rest = -DEPTH
    scene = plane(stiffness, wall.wall_damping_n_s_m)
    hand = Hand(hand_options(wall), (0.0, 0.0, rest))
    scene.force(hand.position, wall.tick_period)  # damping counts from here, not from the surface
    hand.position = (0.0, 0.0, rest * (1.0 + DISTURBANCE))
    press = stiffness * rest
    on_the_way = deque([-press] * wall.delay_ticks)
    intended = (0.0, 0.0, rest)
    spring = stiffness + wall.hand_stiffness_n_m
    energies: list[float] = []
    for _ in range(ticks):
        on_the_way.append(scene.force(hand.position, wall.tick_period)[2])
        felt = on_the_way.popleft() + press
        hand.advance(intended, (0.0, 0.0, felt), wall.tick_period)
        offset, velocity = hand.position[2] - rest, hand.velocity[2]
        energies.append(0.5 * wall.mass_kg * velocity * velocity + 0.5 * spring * offset * offset)
        if abs(offset) > 0.5 * DEPTH or energies[-1] < GONE * energies[0]:
            break
    return np.asarray(energies)


def plane(stiffness: float, damping: float = 0.0) -> Scene:
    """A wall at z = 0, solid below, touched by nothing yet."""
    thing = SceneObject(PlaneShape(ZERO, (0.0, 0.0, 1.0)), stiffness, damping_n_s_m=damping or None)
    scene = Scene([thing])
    scene.force((0.0, 0.0, DEPTH), 1.0)  # the proxy adopts where it is first asked, which must be outside
    return scene


def hand_options(wall: Wall) -> HandOptions:
    return HandOptions(mass_kg=wall.mass_kg, damping_n_s_m=wall.damping_n_s_m, stiffness_n_m=wall.hand_stiffness_n_m)
