"""The modelled hand: exact integration, passivity and tremor."""

from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.geometry.vector import ZERO, add
from weberlink.master.devices.hand import GraspingHand, Tremor, modelled_hand
from weberlink.master.devices.hand_options import GraspOptions, HandOptions

expm = pytest.importorskip("scipy.linalg").expm
positive = st.floats(0.01, 100.0)


@examples(30)
@given(mass=positive, damping=st.floats(0.0, 200.0), stiffness=st.floats(1.0, 1e4), step=st.floats(1e-4, 100.0))
def test_no_step_makes_it_gain_energy(mass: float, damping: float, stiffness: float, step: float) -> None:
    hand = modelled_hand(HandOptions(mass_kg=mass, damping_n_s_m=damping, stiffness_n_m=stiffness), (0.01, 0.0, 0.0))
    energy = 0.5 * stiffness * 0.01**2
    for _ in range(20):
        hand.advance(ZERO, ZERO, step)
        now = 0.5 * stiffness * hand.position[0] ** 2 + 0.5 * mass * hand.velocity[0] ** 2
        assert now <= energy * (1.0 + 1e-9) + 1e-18
        energy = now


@pytest.mark.parametrize("damping", [0.0, 2.0, 19.99999, 20.0, 20.00001, 100.0])
def test_it_is_the_solution_of_the_differential_equation(damping: float) -> None:
    """Against the matrix exponential of another library; m = 0.25 and k = 400 are critically damped at 20."""
    hand = modelled_hand(HandOptions(mass_kg=0.25, damping_n_s_m=damping, stiffness_n_m=400.0), (0.02, 0.0, 0.0))
    hand.advance((0.005, 0.0, 0.0), (1.0, 0.0, 0.0), 0.1)
    rates = [[0.0, 1.0, 0.0], [-1600.0, -damping / 0.25, (400.0 * 0.005 + 1.0) / 0.25], [0.0, 0.0, 0.0]]
    expected = expm(np.asarray(rates) * 0.1) @ [0.02, 0.0, 1.0]
    assert (hand.position[0], hand.velocity[0]) == pytest.approx(expected[:2], abs=1e-9)


def test_tremor_has_stated_amplitude_and_band() -> None:
    options = HandOptions()
    tremor, hand = Tremor(30e-6, options.oscillator, Random(1).random), modelled_hand(options, ZERO)
    positions = []
    for tick in range(22_000):
        hand.advance(add(ZERO, tremor.at(tick * 0.001)), ZERO, 0.001)
        positions.append(hand.position)
    settled = np.array(positions[2000:])
    assert settled.std(axis=0) == pytest.approx([30e-6] * 3, rel=0.15)
    spectrum = np.abs(np.fft.rfft(settled * np.hanning(20_000)[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(20_000, 0.001)
    band = (frequency > 7.8) & (frequency < 12.2)
    assert spectrum[band].sum() > 0.99 * spectrum[frequency > 0.5].sum()


GRASPS_TRIED = st.builds(
    GraspOptions,
    stiffness_n_m=st.floats(1.0, 1e4),
    damping_n_s_m=st.floats(0.0, 50.0),
    handle_kg=positive,
    handle_damping_n_s_m=st.floats(0.0, 10.0),
)


@examples(30)
@given(grasp=GRASPS_TRIED, step=st.floats(1e-4, 1.0), force=st.floats(-10.0, 10.0))
def test_a_grasping_hand_takes_the_exact_step(grasp: GraspOptions, step: float, force: float) -> None:
    """Against the matrix exponential of another library."""
    options = HandOptions(grasp=grasp)
    hand = GraspingHand(options, grasp, (0.01, 0.0, 0.0))
    m, b, k = options.oscillator
    h, d, s = grasp.oscillator
    rates = [
        [0.0, 1.0, 0.0, 0.0, 0.0],
        [-s / h, -(d + grasp.handle_damping_n_s_m) / h, s / h, d / h, force / h],
        [0.0, 0.0, 0.0, 1.0, 0.0],
        [s / m, d / m, -(s + k) / m, -(d + b) / m, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0],
    ]
    expected = expm(np.asarray(rates) * step) @ [0.01, 0.0, 0.01, 0.0, 1.0]
    hand.advance(ZERO, (force, 0.0, 0.0), step)
    found = (hand.position[0], hand.velocity[0], hand.arm[0], hand.arm_velocity[0])
    assert found == pytest.approx(expected[:4], rel=1e-7, abs=1e-9)
