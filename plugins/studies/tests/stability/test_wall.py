"""Limits of the sampled wall: closed forms, eigenvalues, frequency response, and the real hand and plane."""

from math import exp

import pytest
from hypothesis import example, given, strategies as st

from weberlink_studies.stability.measured_wall import measured_limit
from weberlink_studies.stability.wall import Grip, SampledWall, gain_limit, stability_limit

masses = st.floats(-3.0, 1.0).map(lambda exponent: 10.0**exponent)
dampings = st.floats(-1.3, 1.7).map(lambda exponent: 10.0**exponent)
periods = st.sampled_from([1 / 100, 1 / 1000, 1 / 4000])
hands = st.sampled_from([0.01, 10.0, 300.0])


@example(mass=10.0, damping=0.1, period=1 / 4000)
@given(mass=masses, damping=dampings, period=periods)
def test_a_free_device_has_the_closed_form_limit(mass: float, damping: float, period: float) -> None:
    """Of the determinant and of the trace of a 2x2 system (Jury), for a device that nothing holds."""
    slow = mass / damping
    share = exp(-period / slow)
    swinging = damping * (1 - share) / (slow * (1 - share) - period * share)
    slack = period * (1 + share) - 2 * slow * (1 - share)
    alternating = 2 * damping * (1 + share) / slack if slack > 1e-9 * period else float("inf")
    # Softer, and what a tick moves the hand by is lost in the rounding of a transition that is almost the identity.
    free = SampledWall(mass, damping, 1e-3, period)
    assert stability_limit(free) == pytest.approx(min(swinging, alternating), rel=1e-3)


@given(mass=masses, damping=dampings, period=periods, hand=hands, delay=st.integers(0, 6))
def test_eigenvalues_and_frequency_response_agree(
    mass: float, damping: float, period: float, hand: float, delay: int
) -> None:
    wall = SampledWall(mass, damping, hand, period, delay)
    assert gain_limit(wall) == pytest.approx(stability_limit(wall), rel=1e-4)


WALLS = [
    SampledWall(0.001, 0.05, 0.01, 1 / 100),
    SampledWall(0.1, 5.0, 300.0, 1 / 1000, delay_ticks=1),
    SampledWall(0.3, 8.0, 300.0, 1 / 1000, delay_ticks=1, wall_damping_n_s_m=2.0),
]


@pytest.mark.parametrize("wall", WALLS)
def test_the_measured_limit_matches_the_eigenvalues(wall: SampledWall) -> None:
    assert measured_limit(wall) == pytest.approx(stability_limit(wall), rel=0.02)


@pytest.mark.parametrize(("grip", "limit"), [("firm", 5375.0), ("pinch", 2235.0), ("fingertip", 1118.0)])
def test_a_light_grasp_lowers_the_limit_of_a_wall_felt_a_tick_late(grip: Grip, limit: float) -> None:
    wall = SampledWall(0.3, 8.0, 300.0, 1e-3, delay_ticks=1, grip=grip)
    assert stability_limit(wall) == pytest.approx(limit, rel=0.005)
    assert gain_limit(wall) == pytest.approx(stability_limit(wall), rel=1e-4)
    assert measured_limit(wall) == pytest.approx(stability_limit(wall), rel=0.02)
