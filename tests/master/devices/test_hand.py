"""The modelled hand: exact integration, passivity and tremor."""

from random import Random

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from tests.examples import examples
from weberlink.geometry.vector import ZERO
from weberlink.master.devices.hand import Tremor, modelled_hand
from weberlink.master.devices.hand_options import GraspOptions, HandOptions

expm = pytest.importorskip("scipy.linalg").expm
positive = st.floats(0.01, 100.0)
hands = st.builds(HandOptions, mass_kg=positive, damping_n_s_m=st.floats(0.0, 200.0), stiffness_n_m=st.floats(1.0, 1e4))
grasps = st.builds(
    GraspOptions,
    stiffness_n_m=st.floats(1.0, 1e4),
    damping_n_s_m=st.floats(0.0, 50.0),
    handle_kg=positive,
    handle_damping_n_s_m=st.floats(0.0, 10.0),
)


def critical(damping: float) -> HandOptions:
    """Critically damped at 20 N s/m."""
    return HandOptions(mass_kg=0.25, damping_n_s_m=damping, stiffness_n_m=400.0)


@examples(60)
@given(options=hands, grasp=st.none() | grasps, step=st.floats(1e-4, 100.0), force=st.floats(-10.0, 10.0))
@example(critical(0.0), None, 0.1, 1.0)
@example(critical(19.99999), None, 0.1, 1.0)
@example(critical(20.0), None, 0.1, 1.0)
@example(critical(20.00001), None, 0.1, 1.0)
def test_a_step_is_the_solution_of_the_differential_equation(
    options: HandOptions, grasp: GraspOptions | None, step: float, force: float
) -> None:
    """Against the matrix exponential of another library; x, v, arm and its velocity, and 1 for the force."""
    hand = modelled_hand(options.model_copy(update={"grasp": grasp}), (0.01, 0.0, 0.0))
    m, b, k = options.oscillator
    h, d, s = (m, b, k) if grasp is None else grasp.oscillator
    c = 0.0 if grasp is None else grasp.handle_damping_n_s_m
    rates = [[0.0] * 5 for _ in range(5)]
    rates[0][1] = rates[2][3] = 1.0
    rates[1] = [-s / h, -(d + c) / h, s / h, d / h, force / h]
    if grasp is not None:  # else the arm stays at the intention
        rates[3] = [s / m, d / m, -(s + k) / m, -(d + b) / m, 0.0]
    expected = expm(np.asarray(rates) * step) @ [0.01, 0.0, 0.01 if grasp else 0.0, 0.0, 1.0]
    hand.advance(ZERO, (force, 0.0, 0.0), step)
    assert (hand.position[0], hand.velocity[0]) == pytest.approx(expected[:2], rel=1e-6, abs=1e-8)


def test_tremor_has_stated_amplitude_and_band() -> None:
    options = HandOptions()
    tremor, hand = Tremor(30e-6, options.oscillator, Random(1).random), modelled_hand(options, ZERO)
    positions = []
    for tick in range(22_000):
        hand.advance(tremor.at(tick * 0.001), ZERO, 0.001)
        positions.append(hand.position)
    settled = np.array(positions[2000:])
    assert settled.std(axis=0) == pytest.approx([30e-6] * 3, rel=0.15)
    spectrum = np.abs(np.fft.rfft(settled * np.hanning(20_000)[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(20_000, 0.001)
    band = (frequency > 7.8) & (frequency < 12.2)
    assert spectrum[band].sum() > 0.99 * spectrum[frequency > 0.5].sum()
