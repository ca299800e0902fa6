"""Laws of the sampled wall on paper, against closed forms and against the parts that it is a model of."""

from collections import deque
from itertools import product
from math import exp

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from weberlink.master.devices.hand import Hand
from weberlink.studies.stability.boundary import hand_options, plane
from weberlink.studies.stability.wall import (
    Wall,
    bisect,
    bracket,
    gain_limit,
    loop_matrix,
    passivity_limit,
    spectral_radius,
    stability_limit,
)

masses = st.floats(-3.0, 1.0).map(lambda exponent: 10.0**exponent)
dampings = st.floats(-1.3, 1.7).map(lambda exponent: 10.0**exponent)
periods = st.sampled_from([1 / 100, 1 / 1000, 1 / 4000])
hands = st.sampled_from([0.01, 10.0, 300.0])


@example(mass=10.0, damping=0.1, period=1 / 4000)
@given(mass=masses, damping=dampings, period=periods)
def test_free_device_without_delay_has_the_limit_of_its_closed_form(mass: float, damping: float, period: float) -> None:
    """Of the determinant and of the trace of a 2x2 system (Jury), for a device that nothing holds."""
    slow = mass / damping
    share = exp(-period / slow)
    swinging = damping * (1 - share) / (slow * (1 - share) - period * share)
    slack = period * (1 + share) - 2 * slow * (1 - share)
    alternating = 2 * damping * (1 + share) / slack if slack > 1e-9 * period else float("inf")
    # Softer, and what a tick moves the hand by is lost in the rounding of a transition that is almost the identity.
    free = Wall(mass, damping, 1e-3, period)
    assert stability_limit(free) == pytest.approx(min(swinging, alternating), rel=1e-3)


@given(mass=masses, damping=dampings, period=periods, hand=hands, delay=st.integers(0, 6))
def test_eigenvalues_and_frequency_response_agree(
    mass: float, damping: float, period: float, hand: float, delay: int
) -> None:
    wall = Wall(mass, damping, hand, period, delay)
    assert gain_limit(wall) == pytest.approx(stability_limit(wall), rel=1e-4)


@given(mass=masses, damping=dampings, period=periods, hand=hands, delay=st.integers(0, 4), share=st.floats(0.0, 0.9))
def test_what_is_passive_for_any_hand_is_stable_with_this_one(
    mass: float, damping: float, period: float, hand: float, delay: int, share: float
) -> None:
    wall = Wall(mass, damping, hand, period, delay, share * damping)
    passive = passivity_limit(wall)
    assume(passive > 0.0)
    assert spectral_radius(wall, 0.999 * passive) < 1.0


def test_with_a_heavy_device_little_is_stable_that_is_not_passive() -> None:
    for delay in (0, 1, 3):
        heavy = Wall(10.0, 0.5, 0.01, 1e-3, delay)
        assert stability_limit(heavy) == pytest.approx(0.5 / (1e-3 * (delay + 0.5)), rel=1e-3)
        assert passivity_limit(heavy) == pytest.approx(0.5 / (1e-3 * (delay + 0.5)))


def test_bound_is_that_of_colgate_for_a_damped_wall_without_delay() -> None:
    wall = Wall(0.3, 8.0, 0.01, 1e-3, 0, 3.0)
    stiffness = passivity_limit(wall)
    assert wall.damping_n_s_m == pytest.approx(stiffness * 1e-3 / 2 + 3.0)
    assert passivity_limit(Wall(0.3, 2.0, 0.01, 1e-3, 0, 3.0)) == 0.0


@pytest.mark.parametrize(("delay", "wall_damping"), list(product((0, 1, 3), (0.0, 2.0))))
def test_matrix_moves_as_the_real_hand_and_plane_do(delay: int, wall_damping: float) -> None:
    wall, stiffness, depth = Wall(0.3, 8.0, 300.0, 1e-3, delay, wall_damping), 800.0, 1e-3
    scene, hand = plane(stiffness, wall_damping), Hand(hand_options(wall), (0.0, 0.0, -depth))
    scene.force(hand.position, wall.tick_period)
    hand.position = (0.0, 0.0, -1.1 * depth)
    on_the_way = deque([stiffness * depth] * delay)
    state = np.zeros(3 + delay)
    state[0] = -0.1 * depth
    matrix = loop_matrix(wall, stiffness)
    for _ in range(200):
        on_the_way.append(scene.force(hand.position, wall.tick_period)[2])
        hand.advance((0.0, 0.0, -depth), (0.0, 0.0, on_the_way.popleft() - stiffness * depth), wall.tick_period)
        state = matrix @ state
        assert hand.position[2] + depth == pytest.approx(state[0], abs=1e-15)
        assert hand.velocity[2] == pytest.approx(state[1], abs=1e-12)


def test_a_long_delay_is_within_reach() -> None:
    """A second each way at 1 kHz: below the stiffness of the hand no delay whatever can do harm."""
    assert gain_limit(Wall(0.3, 8.0, 300.0, 1e-3, 2000)) == pytest.approx(230.0, rel=0.01)


def test_gain_of_a_damped_wall_is_refused() -> None:
    with pytest.raises(ValueError, match="damped"):
        gain_limit(Wall(0.3, 8.0, 300.0, 1e-3, 0, 1.0))


def test_bracket_and_bisection_find_where_something_begins() -> None:
    for start in (1e-6, 3.0, 1e6):
        low, high = bracket(lambda value: value > 7.0, start)
        assert low <= 7.0 < high
        assert bisect(lambda value: value > 7.0, low, high, 1e-6) == pytest.approx(7.0, rel=1e-6)
    with pytest.raises(ValueError, match="no limit"):
        bracket(lambda value: False, 1.0)
