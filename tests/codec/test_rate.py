"""A bounded rate of updates: the laws of rate and error for any signal, smoothness, and what is counted."""

from itertools import pairwise
from random import Random

import pytest

from tests.codec.law import make_channel
from tests.codec.signals import Stream
from weberlink.codec import Encoder
from weberlink.codec.rate import WIDEST, TokenBucket, UpdateRate
from weberlink.geometry.vector import ZERO

RATE = UpdateRate.limited_to(100.0, 1e-3)


def noise(seed: int, rms: float = 0.05, ticks: int = 5000, force: float = 0.0) -> Stream:
    """Of a force sensor, on each axis [N], at rest."""
    random = Random(seed)
    return [((random.gauss(0.0, rms), random.gauss(0.0, rms), random.gauss(force, rms)), ZERO) for _ in range(ticks)]


@pytest.mark.parametrize("predictor", ["zoh", "hybrid"])
@pytest.mark.parametrize(("floor", "force"), [(0.0, 1.0), (0.02, 0.0)])
def test_noise_above_the_floor_settles_at_the_rate(predictor: str, floor: float, force: float) -> None:
    """50 mN rms: without a bound nearly every tick is sent; with it the deadband is no wider than a few times that."""
    rates, bounds = [], []
    for rate in (None, RATE):
        encoder = Encoder(make_channel(predictor, weber=0.05, floor=floor, rate=rate))
        sent = 0
        for tick, (value, place) in enumerate(noise(1, force=force)):
            update = encoder.encode(tick, value, place)
            if tick >= 2000:
                sent += update is not None
                bounds.append(encoder.bound)
        rates.append(sent / 3.0)
    assert rates[0] > 300.0
    assert rates[1] == pytest.approx(100.0, rel=0.03)
    assert max(bounds) < 12 * 0.05


def test_the_deadband_grows_and_shrinks_without_a_jump() -> None:
    """One token changes it by one factor, and it is back within the time of half the bucket."""
    encoder = Encoder(make_channel("zoh", rate=RATE))
    stream = noise(2) + [((0.0, 0.0, 0.0), ZERO)] * 300
    added, last = [], 0
    for tick, (value, place) in enumerate(stream):
        last = tick if encoder.encode(tick, value, place) is not None else last
        at_rest = max(0.02, 0.1 * sum(each * each for each in value) ** 0.5)
        added.append((encoder.bound - at_rest) / 0.02 + 1.0)
    factor = (WIDEST + 1.0) ** (1.0 / (0.5 * RATE.burst - 1.0)) * (1.0 + 1e-9)
    assert all(1.0 / factor <= after / before <= factor for before, after in pairwise(added))
    assert added[10] == 1.0
    assert 3.0 < added[4999] < 30.0
    assert all(after <= before for before, after in pairwise(added[last + 1 :]))
    assert last < 5050
    assert added[-1] == 1.0
    assert not encoder.widened


def test_a_reset_returns_no_tokens_and_forced_updates_are_paid_back() -> None:
    encoder = Encoder(make_channel("zoh", rate=UpdateRate(0.01, 8.0)))
    for tick in range(40):
        encoder.restart()
        assert encoder.encode(tick, (0.0, 0.0, float(tick))) is not None, "forced"
    encoder.reset()
    assert [encoder.encode(tick, (0.0, 0.0, 30.0)) for tick in range(40, 3000)] == [None] * 2960
    assert encoder.bound == 30.0, "the error that stayed unsent"
    later = [tick for tick in range(3000, 4000) if encoder.encode(tick, (0.0, 0.0, 30.0)) is not None]
    assert later == [pytest.approx(3340, abs=100)], "32 tokens on credit, and one"


def test_no_tokens_come_back_if_the_ticks_begin_anew() -> None:
    bucket = TokenBucket(UpdateRate(0.5, 8.0), 1e-3)
    wider = []
    for _ in range(8):
        wider.append(bucket.widened(1000, 1.0) > 1.0)
        assert bucket.take(forced=False)
    assert wider == [False] * 5 + [True] * 3, "below half of the bucket"
    assert not bucket.take(forced=False)
    bucket.widened(0, 1.0)
    assert not bucket.take(forced=False)
    assert bucket.widened(1, 1.0) == pytest.approx(1.0 + 1e-3 * WIDEST)
    bucket.widened(2, 1.0)
    assert bucket.take(forced=False)
