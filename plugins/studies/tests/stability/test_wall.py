"""Limits of the sampled wall: closed forms, eigenvalues, frequency response, and the real hand and plane."""

import json
from collections import deque
from itertools import product
from math import exp

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.master.devices.hand import modelled_hand
from weberlink_studies.stability.measured_wall import (
    activity,
    grows,
    measured_limit,
    plane,
)
from weberlink_studies.stability.survey import survey
from weberlink_studies.stability.wall import (
    Grip,
    SampledWall,
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


@given(mass=masses, damping=dampings, period=periods, hand=hands, delay=st.integers(0, 4), share=st.floats(0.0, 0.9))
def test_passive_for_any_hand_is_stable_with_one(
    mass: float, damping: float, period: float, hand: float, delay: int, share: float
) -> None:
    wall = SampledWall(mass, damping, hand, period, delay, share * damping)
    passive = passivity_limit(wall)
    assume(passive > 0.0)
    assert spectral_radius(wall, 0.999 * passive) < 1.0


def test_colgate_bound_of_a_damped_wall() -> None:
    wall = SampledWall(0.3, 8.0, 0.01, 1e-3, 0, 3.0)
    stiffness = passivity_limit(wall)
    assert wall.damping_n_s_m == pytest.approx(stiffness * 1e-3 / 2 + 3.0)
    assert passivity_limit(SampledWall(0.3, 2.0, 0.01, 1e-3, 0, 3.0)) == 0.0


@pytest.mark.parametrize(("delay", "wall_damping"), list(product((0, 1, 3), (0.0, 2.0))))
def test_the_matrix_moves_as_hand_and_plane(delay: int, wall_damping: float) -> None:
    wall, stiffness, depth = SampledWall(0.3, 8.0, 300.0, 1e-3, delay, wall_damping), 800.0, 1e-3
    scene, hand = plane(stiffness, wall_damping), modelled_hand(wall.hand, (0.0, 0.0, -depth))
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


def test_the_limit_of_a_long_delay() -> None:
    """A second each way at 1 kHz: below the stiffness of the hand no delay whatever can do harm."""
    assert gain_limit(SampledWall(0.3, 8.0, 300.0, 1e-3, 2000)) == pytest.approx(230.0, rel=0.01)


def test_bracket_and_bisection_find_a_threshold() -> None:
    for start in (1e-6, 3.0, 1e6):
        low, high = bracket(lambda value: value > 7.0, start)
        assert low <= 7.0 < high
        assert bisect(lambda value: value > 7.0, low, high, 1e-6) == pytest.approx(7.0, rel=1e-6)
    with pytest.raises(ValueError, match="no limit"):
        bracket(lambda value: False, 1.0)


WALLS = [
    SampledWall(0.001, 0.05, 0.01, 1 / 100),
    SampledWall(10.0, 50.0, 0.01, 1 / 4000),
    SampledWall(0.1, 5.0, 300.0, 1 / 1000, delay_ticks=1),
    SampledWall(0.001, 0.5, 300.0, 1 / 100, delay_ticks=5),
    SampledWall(0.1, 5.0, 0.01, 1 / 1000, wall_damping_n_s_m=2.0),
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


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95, 1.05, 2.0, 50.0])
def test_a_disturbance_grows_only_above_the_limit(share: float) -> None:
    wall = SampledWall(0.3, 8.0, 300.0, 1e-3, delay_ticks=1)
    assert grows(wall, share * stability_limit(wall)) is (share > 1.0)


@given(
    damping=st.floats(0.05, 50.0),
    mass=st.floats(0.001, 10.0),
    period=st.sampled_from([1 / 100, 1 / 1000, 1 / 4000]),
    delay=st.integers(0, 4),
    wall_share=st.floats(0.0, 0.9),
    share=st.floats(0.01, 1.0),
)
@examples(15)
def test_no_motion_gets_energy_from_passive_walls(
    damping: float, mass: float, period: float, delay: int, wall_share: float, share: float
) -> None:
    wall = SampledWall(mass, damping, 0.01, period, delay, wall_share * damping)
    passive = passivity_limit(wall)
    assume(passive > 0.0)
    assert activity(wall, share * passive) <= 1e-9


def test_a_survey_row_agrees_with_theory() -> None:
    row = survey(SampledWall(0.1, 5.0, 0.01, 1e-3))
    assert abs(row["deviation"]) < 0.02
    assert row["passive_but_active"] == 0
    beyond = [cell["activity"] for cell in row["cells"] if cell["stiffness_n_m"] > row["passive_to_n_m"]]
    assert beyond
    assert min(beyond) > 0.0
    assert json.loads(json.dumps(row, allow_nan=False))["mass_kg"] == 0.1
