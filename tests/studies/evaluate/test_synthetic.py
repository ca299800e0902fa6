"""Synthetic signals: reproducible, independent of the tick rate, and what their names say."""

import re
from pathlib import Path

import numpy as np
import pytest

from weberlink.codec import force_channel
from weberlink.studies.evaluate.replay import Array, replay
from weberlink.studies.evaluate.synthetic import SYNTHETIC, WHITE_N, synthetic_names, synthetic_signal

DRAWN_PER_SAMPLE = ("switching", "white_noise")


def scalar(name: str, seed: int = 1, period_s: float = 1e-3) -> Array:
    """The force along its direction, which is of one sign or the other."""
    force = synthetic_signal(name, seed, 10.0, period_s).force_n
    direction = np.linalg.svd(force, full_matrices=False)[2][0]
    along = force @ direction
    return np.asarray(along if along.sum() > 0.0 else -along)


@pytest.mark.parametrize("name", synthetic_names())
def test_a_seed_determines_every_bit(name: str) -> None:
    one, same, other = (synthetic_signal(name, seed) for seed in (3, 3, 4))
    assert one.force_n.shape == one.position_m.shape == (10_000, 3)
    assert np.isfinite(one.force_n).all()
    assert np.array_equal(one.force_n, same.force_n)
    assert np.array_equal(one.position_m, same.position_m)
    assert not np.array_equal(one.force_n, other.force_n)
    assert 0.3 < np.linalg.norm(one.force_n, axis=1).mean() < 5.0
    assert 0.01 < np.abs(np.diff(one.position_m, axis=0)).max() / 1e-3 < 0.5


@pytest.mark.parametrize("name", [name for name in SYNTHETIC if name not in DRAWN_PER_SAMPLE])
@pytest.mark.parametrize("per_s", [500, 4000])
def test_a_tick_rate_only_samples_the_signal(name: str, per_s: int) -> None:
    coarse, fine = (synthetic_signal(name, 2, 5.0, 1.0 / rate) for rate in sorted((1000, per_s)))
    share = len(fine) // len(coarse)
    assert np.allclose(fine.position_m[::share], coarse.position_m, rtol=0.0, atol=1e-9)
    # A jump may fall on either side of a time that is rounded.
    differing = np.linalg.norm(fine.force_n[::share] - coarse.force_n, axis=1) > 1e-6
    assert differing.mean() < 5e-3


def test_each_is_what_its_name_says() -> None:
    assert len(np.unique(scalar("step").round(6))) == pytest.approx(20, abs=10)
    assert set(scalar("square").round(6)) == {1.0, 3.0}
    crossings = np.diff(np.sign(scalar("chirp") - 2.0)).nonzero()[0]
    assert np.diff(crossings)[:2].min() > 30 * np.diff(crossings)[-20:].mean()
    assert np.abs(np.diff(scalar("triangle"))).max() == pytest.approx(6e-3, rel=1e-6)
    slips = np.diff(scalar("saw")) < -0.01
    assert 0.002 < slips.mean() < 0.03
    assert np.diff(scalar("saw"))[~slips].max() <= 8e-3 + 1e-9
    power = np.abs(np.fft.rfft(scalar("texture") - scalar("texture").mean())) ** 2
    at = np.fft.rfftfreq(10_000, 1e-3)
    assert power[(at > 40.0) & (at < 260.0)].sum() > 0.95 * power[at > 10.0].sum()
    assert 0.002 < (scalar("drop_outs") == 0.0).mean() < 0.03
    steps = 10.0 * scalar("quantised")
    assert steps == pytest.approx(np.round(steps), abs=1e-6)
    assert (np.diff(scalar("held")).round(12) == 0.0).mean() == pytest.approx(0.9, abs=0.01)
    assert np.abs(scalar("spikes")).max() > 2.5
    magnitude = np.linalg.norm(synthetic_signal("turning", 1).force_n, axis=1)
    assert magnitude == pytest.approx(2.0)


@pytest.mark.parametrize("period_s", [2e-3, 1e-3, 2.5e-4])
def test_white_noise_is_that_of_each_sample(period_s: float) -> None:
    force = synthetic_signal("white_noise", 1, 10.0, period_s).force_n
    assert force[:, :2].std(axis=0) == pytest.approx([WHITE_N] * 2, rel=0.05)
    assert np.diff(force[:, :2], axis=0).std(axis=0) == pytest.approx([2.0**0.5 * WHITE_N] * 2, rel=0.05)


@pytest.mark.parametrize("name", synthetic_names())
def test_the_codec_stays_within_its_deadband(name: str) -> None:
    run = replay(synthetic_signal(name, 1, 2.0), force_channel(predictor="adaptive", weber=0.1, floor=0.02))
    assert (run.deviation_n <= run.bound_n).all()


def test_an_unknown_signal_is_refused() -> None:
    with pytest.raises(KeyError):
        synthetic_signal("spoon", 1)


def test_the_documentation_lists_every_signal() -> None:
    page = (Path(__file__).parents[3] / "docs" / "scenes.md").read_text(encoding="utf-8")
    table = page.split("| synthetic |", 1)[1].split("\n\n", 1)[0]
    assert re.findall(r"^\| `(\w+)` \|", table, re.M) == list(synthetic_names())
