"""A bounded rate of updates: the laws of rate and error for any signal, smoothness, and what is counted."""

from itertools import pairwise
from math import inf, nan
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.codec.law import half_step, make_channel
from tests.codec.signals import Stream, contact_stream, rubbing_stream
from tests.examples import examples
from weberlink.codec import Decoder, Encoder, force_channel
from weberlink.codec.deadband import ConeDeadband, Deadband, ForceDeadband, LevelCrossingDeadband
from weberlink.codec.predictors import ADAPTIVE
from weberlink.codec.rate import WIDEST, TokenBucket, UpdateRate
from weberlink.codec.smoothing import Smoothing
from weberlink.geometry.vector import ZERO, Vector

RATE = UpdateRate.limited_to(100.0, 1e-3)


def noise(seed: int, rms: float = 0.05, ticks: int = 5000, force: float = 0.0) -> Stream:
    """Of a force sensor, on each axis [N], at rest."""
    random = Random(seed)
    return [((random.gauss(0.0, rms), random.gauss(0.0, rms), random.gauss(force, rms)), ZERO) for _ in range(ticks)]


def most_beyond(sent: list[float], per_tick: float) -> float:
    """The largest number of updates beyond the rate, over all windows of consecutive ticks."""
    most = beyond = 0.0
    for each in sent:
        beyond = max(0.0, beyond + each - per_tick)
        most = max(most, beyond)
    return most


@pytest.mark.parametrize(("per_tick", "burst"), [(0.0, 16.0), (-1.0, 16.0), (nan, 16.0), (inf, 16.0), (0.1, 3.9)])
def test_refuses_a_rate_out_of_range(per_tick: float, burst: float) -> None:
    with pytest.raises(ValueError, match=r"per_tick|burst"):
        UpdateRate(per_tick, burst)


@pytest.mark.parametrize("predictor", ["zoh", "linear", "hybrid", ADAPTIVE])
@given(
    per_tick=st.floats(0.001, 1.5), burst=st.floats(4.0, 40.0), seed=st.integers(0, 2**32 - 1),
    floor=st.sampled_from([0.0, 0.002, 0.02]), position=st.booleans(), smooth=st.booleans(),
    kind=st.sampled_from(["contact", "rubbing", "noise", "loud"]), shape=st.sampled_from(["ball", "cone", "levels"]),
    restarts=st.sets(st.integers(0, 399), max_size=20), resets=st.sets(st.integers(0, 399), max_size=5),
    missed=st.integers(0, 300),
)  # fmt: skip
@examples(15)
def test_the_laws_of_rate_and_error_hold_for_any_signal(
    predictor: str, per_tick: float, burst: float, seed: int, floor: float, position: bool, smooth: bool,
    kind: str, shape: str, restarts: set[int], resets: set[int], missed: int,
) -> None:  # fmt: skip
    """Forced updates are counted too, but not held back; a tick without a sample returns tokens all the same."""
    stream = {
        "contact": lambda: contact_stream(seed), "rubbing": lambda: rubbing_stream(seed, ticks=400),
        "noise": lambda: noise(seed, ticks=400), "loud": lambda: noise(seed, 10.0, 400),
    }[kind]()  # fmt: skip
    rate = UpdateRate(per_tick, burst)
    deadband: Deadband = ForceDeadband(0.1, floor)
    if shape != "ball" and not position and floor > 0.0:
        deadband = ConeDeadband(0.1, floor) if shape == "cone" else LevelCrossingDeadband(0.1, floor)
    if position:
        channel = make_channel(predictor, position=True, rate=rate)
        deadband = channel.deadband
    else:
        smoothing = Smoothing(9) if smooth and deadband.is_ball else None
        channel = make_channel(predictor, deadband=deadband, smoothing=smoothing, rate=rate)
    encoder, decoder = Encoder(channel), Decoder(channel)
    sent: list[float] = []
    forced = channel.rest is None
    for index, (force, place) in enumerate(stream):
        tick = index if index < 200 else index + missed
        if index == 200:
            sent += [0.0] * missed
        if index in resets:
            encoder.reset()
            decoder.reset()
            forced = channel.rest is None
        if index in restarts:
            encoder.restart()
            decoder.reset()
            forced = True
        value = place if position else force
        update = encoder.encode(tick, value, place)
        if update is not None:
            decoder.apply(update)
        shown = decoder.value(tick, place)
        sent.append(0.0 if update is None or forced else 1.0)
        if shown is not None:
            forced = forced and update is None
            actual = channel.value_quantizer.confine(value)
            rounded = deadband.error(channel.value_quantizer.rounded(actual), actual) + half_step(channel)
            assert update is not None or forced or shown == encoder.predicted
            assert deadband.error(shown, actual) <= max(encoder.bound * (1.0 + 1e-9), rounded)
        if not encoder.widened:
            assert encoder.bound <= deadband.bound(actual, shown or actual, actual, 1.0) * (1.0 + 1e-9) + 1e-12
    assert most_beyond(sent, per_tick) <= burst + 1e-6


@pytest.mark.parametrize("predictor", ["zoh", "hybrid", ADAPTIVE])
@pytest.mark.parametrize("floor", [0.0, 0.02])
@pytest.mark.parametrize("force", [0.0, 1.0])
def test_noise_above_the_floor_settles_at_the_rate(predictor: str, floor: float, force: float) -> None:
    """50 mN rms: without a bound nearly every tick is sent; with it the deadband is no wider than a few times that."""
    rates, bounds = [], []
    for rate in (None, RATE):
        encoder = Encoder(force_channel(predictor=predictor, weber=0.05, floor=floor, rate=rate))
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
    encoder = Encoder(force_channel(predictor="zoh", rate=RATE))
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


def test_a_contact_in_noise_is_sent_at_once() -> None:
    encoder = Encoder(force_channel(predictor="zoh", rate=RATE))
    for tick, (value, place) in enumerate(noise(3)):
        encoder.encode(tick, value, place)
    assert encoder.widened
    assert encoder.encode(5000, (0.0, 0.0, 2.0)) is not None
    assert encoder.encode(5001, (0.0, 0.0, 5.0)) is not None


@pytest.mark.parametrize("predictor", ["hybrid", "surface", ADAPTIVE])
def test_a_signal_below_the_rate_is_coded_as_without(predictor: str) -> None:
    free, bounded = Encoder(force_channel(predictor=predictor)), Encoder(force_channel(predictor=predictor, rate=RATE))
    for tick, (value, place) in enumerate(rubbing_stream(5, ticks=2000)):
        assert bounded.encode(tick, value, place) == free.encode(tick, value, place)
        assert (bounded.bound, bounded.widened) == (free.bound, False)


def test_what_may_stay_unsent_at_most_is_widened_too() -> None:
    """Or an error bound that the control asks for would break the law of the rate."""
    encoder = Encoder(make_channel("zoh", position=True, rate=RATE))
    random, sent = Random(4), 0
    for tick in range(5000):
        position: Vector = (random.gauss(0.0, 1e-3), 0.0, 0.0)
        sent += encoder.encode(tick, position, ZERO, 1e-5) is not None
    assert sent <= RATE.per_tick * 5000 + RATE.burst
    assert encoder.widened
    assert encoder.bound > 1e-5


def test_a_reset_returns_no_tokens_and_forced_updates_are_paid_back() -> None:
    encoder = Encoder(force_channel(predictor="zoh", rate=UpdateRate(0.01, 8.0)))
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
    for _ in range(8):
        bucket.widened(1000, 1.0)
        assert bucket.take(forced=False)
    assert not bucket.take(forced=False)
    bucket.widened(0, 1.0)
    assert not bucket.take(forced=False)
    assert bucket.widened(1, 1.0) == pytest.approx(1.0 + 1e-3 * WIDEST)
    bucket.widened(2, 1.0)
    assert bucket.take(forced=False)
