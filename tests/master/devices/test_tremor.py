from random import Random

import numpy as np
import pytest

from weberlink.geometry.vector import ZERO, add
from weberlink.master.devices.hand import Hand, HandOptions, Tremor


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_free_hand_trembles_by_the_stated_amount_in_the_stated_band(seed: int) -> None:
    options = HandOptions()
    tremor, hand = Tremor(30e-6, options.oscillator, Random(seed).random), Hand(options, ZERO)
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


def test_it_is_a_function_of_time_and_seed_alone() -> None:
    one, other = (Tremor(30e-6, HandOptions().oscillator, Random(seed).random) for seed in (1, 2))
    again = Tremor(30e-6, HandOptions().oscillator, Random(1).random)
    backwards = [one.at(0.01 * i) for i in reversed(range(50))]
    assert backwards[::-1] == [again.at(0.01 * i) for i in range(50)]
    assert one.at(0.3) != other.at(0.3)
