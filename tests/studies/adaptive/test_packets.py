"""The Weber factor of equal packets, on counts that are known and on a signal that is coded."""

from dataclasses import dataclass

import numpy as np
import pytest

from weberlink.codec import Encoder
from weberlink.studies.adaptive.coding import Coded, coded
from weberlink.studies.adaptive.packets import LEAST, MOST, RUNS, equal_packets
from weberlink.studies.adaptive.variants import channel_of
from weberlink.studies.evaluate.replay import Signal


@dataclass(frozen=True)
class Counted:
    packets: int


@pytest.mark.parametrize("power", [0.5, 1.0, 1.6])
@pytest.mark.parametrize("target", [150, 1000, 4000])
@pytest.mark.parametrize("first", [0.02, 0.1, 0.4])
def test_it_finds_the_factor_of_a_power_law(power: float, target: int, first: float) -> None:
    runs: list[float] = []

    def run(weber: float) -> Counted:
        runs.append(weber)
        return Counted(round(1000 * (0.05 / weber) ** power))

    weber, found = equal_packets(target, run, first)
    assert len(runs) <= RUNS
    assert found == run(weber)
    expected = 0.05 * (1000 / target) ** (1.0 / power)
    if LEAST < expected < MOST:
        assert found.packets == pytest.approx(target, rel=0.03)
        assert weber == pytest.approx(expected, rel=0.1)


def test_between_two_sides_a_power_law_is_met_at_once() -> None:
    runs: list[float] = []

    def run(weber: float) -> Counted:
        runs.append(weber)
        return Counted(round(50.0 / weber))

    _, found = equal_packets(1000, run, 0.1)
    # One on either side, one in the middle, and the interpolation.
    assert len(runs) == 4
    assert found.packets == pytest.approx(1000, abs=1)


def test_where_counts_jump_over_the_target_the_nearest_counts() -> None:
    _, found = equal_packets(100, lambda weber: Counted(140 if weber < 0.07 else 90), 0.05)
    assert found.packets == 90
    _, found = equal_packets(100, lambda weber: Counted(104 if weber < 0.07 else 70), 0.05)
    assert found.packets == 104
    _, found = equal_packets(100, lambda weber: Counted(106 if weber < 0.07 else 90), 0.05)
    assert found.packets == 90


def test_a_signal_that_is_never_sent_ends() -> None:
    _, found = equal_packets(0, lambda _: Counted(0), 0.05)
    assert found.packets == 0
    weber, found = equal_packets(10, lambda _: Counted(0), 0.05)
    assert LEAST <= weber <= MOST
    assert found.packets == 0


def wave(seconds: float) -> Signal:
    """A press that swells and fades along z, with a tremor."""
    time = np.arange(round(1000 * seconds)) * 1e-3
    push = 2.0 + 1.5 * np.sin(5.0 * time) + 0.2 * np.sin(47.0 * time)
    force = np.stack([0.0 * push, 0.0 * push, push], axis=1)
    return Signal(force, force * -2e-3, 1e-3)


def test_a_coded_signal_is_sent_as_often_with_a_smaller_deadband() -> None:
    signal = wave(2.0)

    def run(weber: float) -> Coded:
        return coded(signal, Encoder(channel_of("linear", weber, 0.2 * weber)))

    target = coded(signal, Encoder(channel_of("zoh"))).packets
    weber, found = equal_packets(target, run, 0.05)
    assert found.packets == pytest.approx(target, rel=0.05)
    assert weber < 0.1
    assert found.packets == run(weber).packets
