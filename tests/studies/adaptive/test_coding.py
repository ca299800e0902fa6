"""Coding of a signal, encoders without a part, and the Weber factor of equal packets."""

from dataclasses import dataclass

import numpy as np
import pytest

from weberlink.codec import Encoder
from weberlink.codec.predictors import ADAPTIVE_BANK
from weberlink.codec.smoothing import Smoothing
from weberlink.studies.adaptive.coding import LEAST, MOST, RUNS, CodedSignal, coded, equal_packets
from weberlink.studies.adaptive.variants import ABLATIONS, TUNINGS, Alteration, altered, altered_channel, channel_of
from weberlink.studies.evaluate.replay import Signal, replay
from weberlink.studies.evaluate.scenes import scene_signal
from weberlink.system.scoring.perception import Threshold


@pytest.fixture(scope="module")
def touched() -> Signal:
    return scene_signal("plane_friction", 1, 1.2, 2e-3)


@pytest.fixture(scope="module")
def moved() -> Signal:
    """In contact with a heaving plane."""
    whole = scene_signal("plane_moving", 2, 1.4, 2e-3)
    return Signal(whole.force_n[600:], whole.position_m[600:], whole.period_s)


def updates(signal: Signal, encoder: Encoder) -> list[object]:
    return [encoder.encode(tick, force, position) for tick, (force, position) in enumerate(signal.samples)]


@pytest.mark.parametrize("variant", ["hybrid", "adaptive", "linear"])
def test_the_mirror_displays_what_the_receiver_does(touched: Signal, variant: str) -> None:
    channel = channel_of(variant)
    ours, live = coded(touched, channel), replay(touched, channel)
    assert ours.packets == len(live.updates) > 0
    assert ours.error_n.tolist() == live.error_n.tolist()
    assert ours.outside == 0


def test_ramps_stay_within_the_deadband(touched: Signal) -> None:
    found = coded(touched, channel_of("adaptive", smoothing=Smoothing(10, 0.8)))
    assert found.packets > 0
    assert found.outside == 0


def test_steps_and_errors_in_newtons_and_thresholds() -> None:
    force = np.zeros((4, 3))
    force[:, 2] = [1.0, 1.0, 2.0, 2.0]
    displayed = np.zeros((4, 3))
    displayed[:, 2] = [1.0, 1.1, 2.0, 1.8]
    found = CodedSignal(2, displayed, 0, np.linalg.norm(displayed - force, axis=1))
    felt = found.felt(Signal(force, force, 1e-3), Threshold(0.10, 0.02))
    assert felt.largest_step_n == pytest.approx(0.9)
    assert felt.error_rms_n == pytest.approx(np.sqrt((0.01 + 0.04) / 4))
    assert felt.error_rms_jnd == pytest.approx(np.sqrt((1.0 + 1.0) / 4))
    # Steps of 1, 4.5 and 1 thresholds.
    assert felt.step_jnd == pytest.approx(4.5, rel=0.01)


def test_without_alteration_it_is_the_live_encoder(moved: Signal) -> None:
    live = updates(moved, Encoder(channel_of("adaptive")))
    assert any(live)
    assert updates(moved, altered(Alteration())) == live
    for name in ("no surface", "no motion"):
        assert updates(moved, altered(ABLATIONS[name])) != live


@pytest.mark.parametrize("name", [*ABLATIONS, *TUNINGS])
def test_every_alteration_stays_within_the_deadband(moved: Signal, name: str) -> None:
    alteration = (ABLATIONS | TUNINGS)[name]
    signal = Signal(moved.force_n[:200], moved.position_m[:200], 1e-3)
    found = coded(signal, altered_channel(alteration), altered(alteration))
    assert found.packets > 0
    assert found.outside == 0
    if name.removeprefix("no ") in ADAPTIVE_BANK:
        assert set(ABLATIONS[name].bank) == set(ADAPTIVE_BANK) - {name.removeprefix("no ")}


def test_without_curvature_a_ball_is_coded_otherwise() -> None:
    ball = scene_signal("sphere_friction", 1, 1.4, 2e-3)
    ball = Signal(ball.force_n[600:], ball.position_m[600:], ball.period_s)
    assert updates(ball, altered(ABLATIONS["no curvature"])) != updates(ball, altered(Alteration()))


@dataclass(frozen=True)
class Count:
    packets: int


@pytest.mark.parametrize("power", [0.5, 1.0, 1.6])
@pytest.mark.parametrize("target", [150, 1000, 4000])
@pytest.mark.parametrize("first", [0.02, 0.4])
def test_equal_packets_inverts_a_power_law(power: float, target: int, first: float) -> None:
    runs: list[float] = []

    def run(weber: float) -> Count:
        runs.append(weber)
        return Count(round(1000 * (0.05 / weber) ** power))

    weber, found = equal_packets(target, run, first)
    assert len(runs) <= RUNS
    assert found == run(weber)
    expected = 0.05 * (1000 / target) ** (1.0 / power)
    if LEAST < expected < MOST:
        assert found.packets == pytest.approx(target, rel=0.03)
        assert weber == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize(("more", "fewer", "taken"), [(140, 90, 90), (104, 70, 104), (106, 90, 90)])
def test_the_nearest_count_wins_fewer_packets_preferred(more: int, fewer: int, taken: int) -> None:
    _, found = equal_packets(100, lambda weber: Count(more if weber < 0.07 else fewer), 0.05)
    assert found.packets == taken


@pytest.mark.parametrize("target", [0, 10])
def test_the_search_ends_without_any_packet(target: int) -> None:
    weber, found = equal_packets(target, lambda _: Count(0), 0.05)
    assert LEAST <= weber <= MOST
    assert found.packets == 0
