"""What is felt of a coded signal: against the replay of the live ends, and by hand."""

import numpy as np
import pytest

from weberlink.codec import Encoder
from weberlink.codec.smoothing import Smoothing
from weberlink.studies.adaptive.coding import Coded, coded
from weberlink.studies.adaptive.variants import channel_of
from weberlink.studies.evaluate.replay import Signal, replay
from weberlink.studies.evaluate.scenes import scene_signal
from weberlink.system.scoring.perception import Threshold


@pytest.fixture(scope="module")
def touched() -> Signal:
    return scene_signal("plane_friction", 1, 1.5, 2e-3)


@pytest.mark.parametrize("variant", ["hybrid", "adaptive", "linear", "surface"])
def test_the_mirror_displays_what_the_receiver_does(touched: Signal, variant: str) -> None:
    channel = channel_of(variant)
    ours, live = coded(touched, Encoder(channel)), replay(touched, channel)
    assert ours.packets == len(live.updates) > 0
    assert ours.error_n.tolist() == live.error_n.tolist()
    assert ours.outside == 0


def test_ramps_keep_the_law(touched: Signal) -> None:
    found = coded(touched, Encoder(channel_of("adaptive", smoothing=Smoothing(10, 0.8))))
    assert found.packets > 0
    assert found.outside == 0


def test_steps_and_errors_are_counted_in_newtons_and_in_thresholds() -> None:
    force = np.zeros((4, 3))
    force[:, 2] = [1.0, 1.0, 2.0, 2.0]
    displayed = np.zeros((4, 3))
    displayed[:, 2] = [1.0, 1.1, 2.0, 1.8]
    found = Coded(2, displayed, 0, np.linalg.norm(displayed - force, axis=1))
    feel = found.feel(Signal(force, force, 1e-3), Threshold(0.10, 0.02))
    assert feel.largest_step_n == pytest.approx(0.9)
    assert feel.error_rms_n == pytest.approx(np.sqrt((0.01 + 0.04) / 4))
    assert feel.error_rms_jnd == pytest.approx(np.sqrt((1.0 + 1.0) / 4))
    # Steps of 1, 4.5 and 1 thresholds.
    assert feel.step_jnd == pytest.approx(4.5, rel=0.01)
