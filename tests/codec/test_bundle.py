"""The bundle of joints: the law of closed-loop coding axis by axis, loss, malformed updates and the wire."""

from collections.abc import Iterator, Sequence
from math import inf, nan, pi, sin
from random import Random
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.codec import Update, force_channel
from weberlink.codec.bundle import BundleChannel, BundleDecoder, BundleEncoder, joint_channel
from weberlink.codec.deadband.per_axis import PerAxisDeadband
from weberlink.codec.rate import UpdateRate
from weberlink.geometry.joints import Joints, widths
from weberlink.protocol.wire import UpdateLayout
from weberlink.update import MAX_GAP, ModelParameters, PreviousSample

predictors = pytest.mark.parametrize("predictor", ["zoh", "linear"])
seeds = st.integers(0, 2**32 - 1)
STEP = 1e-3
BOUNDS = (0.01, 0.02, 0.03, 0.005, 0.0004, 0.1, 0.05)


def arm_stream(seed: int, axes: int, ticks: int) -> list[Joints]:
    """Swings of each axis at a frequency of its own, with noise and jumps."""
    random = Random(seed)
    rates = [(random.uniform(0.1, 4.0), random.uniform(0.0, 1.5), random.choice([0.0, 1e-3])) for _ in range(axes)]
    stream: list[Joints] = []
    shift = 0.0
    for tick in range(ticks):
        if random.random() < 0.01:
            shift = random.uniform(-0.5, 0.5)
        at = 1e-3 * tick
        stream.append(tuple(a * sin(2.0 * pi * f * at) + random.gauss(0.0, n) + shift for f, a, n in rates))
    return stream


def channel_of(
    axes: int, predictor: str = "linear", weber: float = 0.0, rate: UpdateRate | None = None
) -> BundleChannel:
    return joint_channel(predictor=predictor, bounds=BOUNDS[:axes], weber=weber, step=STEP, rate=rate)


class Tick(NamedTuple):
    """A coded sample: the update sent, the values displayed, and the largest error in deadbands."""

    update: Update | None
    shown: Joints
    excess: float


def excess(shown: Joints, actual: Joints, channel: BundleChannel, weber: float, share: float = 1.0) -> float:
    """The largest error on an axis in deadbands, none of which is finer than half a step."""
    bounds, finest = BOUNDS[: channel.count], 0.5 * STEP * (1.0 + 1e-8)
    within = (max(-channel.limit, min(channel.limit, a)) for a in actual)
    return max(
        abs(d - a) / max(share * max(weber * abs(a), bound), finest)
        for d, a, bound in zip(shown, within, bounds, strict=True)
    )


def coded(channel: BundleChannel, samples: Sequence[Joints], weber: float, share: float = inf) -> Iterator[Tick]:
    """Code samples on a lossless link; assert that both ends hold the same state, and that the law holds."""
    encoder, decoder = BundleEncoder(channel), BundleDecoder(channel)
    for tick, actual in enumerate(samples):
        update = encoder.encode(tick, actual, most=share)
        if update is not None:
            decoder.apply(update)
        shown = decoder.value(tick)
        assert shown is not None
        assert shown == (encoder.predicted if update is None else encoder.mirror.first)
        assert decoder.state == encoder.mirror.state
        error = excess(shown, actual, channel, weber, min(1.0, share))
        if update is not None:
            assert max(abs(d - a) for d, a in zip(shown, actual, strict=True)) <= 0.5 * STEP * (1.0 + 1e-8)
        yield Tick(update, shown, error)


@predictors
@given(axes=st.integers(1, 7), weber=st.sampled_from([0.0, 0.05, 0.3]), seed=seeds)
@examples(10)
def test_law_holds_on_every_axis(predictor: str, axes: int, weber: float, seed: int) -> None:
    ticks = list(coded(channel_of(axes, predictor, weber), arm_stream(seed, axes, 150), weber))
    assert max(tick.excess for tick in ticks) <= 1.0 + 1e-9
    assert ticks[0].update is not None


@given(share=st.sampled_from([0.0, 0.1, 0.5, 2.0]), seed=seeds)
@examples(8)
def test_a_smaller_share_narrows_every_deadband(share: float, seed: int) -> None:
    ticks = list(coded(channel_of(6), arm_stream(seed, 6, 150), 0.0, share))
    assert max(tick.excess for tick in ticks) <= 1.0 + 1e-9


@given(samples=st.lists(st.tuples(*[st.floats(-1e300, 1e300)] * 4), min_size=1, max_size=30))
@examples(15)
def test_extreme_samples_saturate_and_stay_finite(samples: list[Joints]) -> None:
    channel = channel_of(4, weber=0.1)
    encoder, decoder = BundleEncoder(channel), BundleDecoder(channel)
    for tick, sample in enumerate(samples):
        update = encoder.encode(tick, sample)
        if update is not None:
            decoder.apply(update)
        shown = decoder.value(tick)
        assert shown is not None
        assert max(map(abs, shown)) <= channel.limit
        assert excess(shown, sample, channel, 0.1) <= 1.0 + 1e-9


def test_one_moving_axis_sends_all_axes() -> None:
    encoder = BundleEncoder(channel_of(5, "zoh"))
    encoder.encode(0, (0.1, 0.2, 0.3, 0.4, 0.5))
    assert encoder.encode(1, (0.1, 0.2, 0.3, 0.4, 0.5)) is None
    update = encoder.encode(2, (0.1, 0.2, 0.3, 0.41, 0.5))
    assert update is not None
    assert update.newest == (100, 200, 300, 410, 500)


def test_axes_of_other_thresholds_do_not_move_the_decision() -> None:
    encoder = BundleEncoder(channel_of(6, "zoh"))
    start = (0.0,) * 6
    encoder.encode(0, start)
    for axis, bound in enumerate(BOUNDS[:6]):
        finest = max(bound, 0.5 * STEP)
        inside = tuple(0.98 * finest if i == axis else 0.0 for i in range(6))
        beyond = tuple(1.02 * finest if i == axis else 0.0 for i in range(6))
        assert encoder.encode(2 * axis + 1, inside) is None
        assert encoder.encode(2 * axis + 2, beyond) is not None
        encoder.restart()
        encoder.encode(2 * axis + 2, start)


@predictors
def test_any_update_that_arrives_restores_the_state(predictor: str) -> None:
    channel = channel_of(7, predictor)
    encoder, decoder, random = BundleEncoder(channel), BundleDecoder(channel), Random(7)
    agree, delayed, compared = True, None, 0
    for tick, sample in enumerate(arm_stream(7, 7, 1000)):
        update = encoder.encode(tick, sample)
        if update is not None:
            late_starter = BundleDecoder(channel)
            late_starter.apply(update)
            assert late_starter.state == encoder.mirror.state
            if random.random() < 0.5:
                agree, delayed = False, update
            else:
                if delayed is not None:
                    decoder.apply(delayed)
                decoder.apply(update)
                agree, delayed = True, None
        if agree:
            compared += 1
            assert decoder.value(tick) == (encoder.predicted if update is None else encoder.mirror.value(tick))
            assert decoder.state == encoder.mirror.state
    assert compared > 200


def test_restart_sends_the_next_sample_without_history() -> None:
    encoder = BundleEncoder(channel_of(3))
    for tick in range(3):
        encoder.encode(tick, (0.1 * tick, 0.0, 0.0))
    encoder.restart()
    update = encoder.encode(3, (0.2, 0.0, 0.0))
    assert update is not None
    assert update.payload is None
    assert encoder.encode(4, (0.2, 0.0, 0.0)) is None


def test_a_reset_encoder_sends_as_a_fresh_one() -> None:
    used, fresh = BundleEncoder(channel_of(6)), BundleEncoder(channel_of(6))
    for tick, sample in enumerate(arm_stream(1, 6, 300)):
        used.encode(tick, sample)
    used.reset()
    for tick, sample in enumerate(arm_stream(2, 6, 300), 300):
        assert used.encode(tick, sample) == fresh.encode(tick, sample)


@pytest.mark.parametrize(("gap", "carries"), [(MAX_GAP, True), (MAX_GAP + 1, False)])
def test_a_sample_older_than_the_gap_is_not_sent(gap: int, carries: bool) -> None:
    encoder = BundleEncoder(channel_of(2))
    encoder.encode(0, (0.0, 0.0))
    update = encoder.encode(gap, (0.5, 0.0))
    assert update is not None
    assert (update.payload is not None) is carries


def test_rest_is_displayed_and_not_sent() -> None:
    channel = joint_channel(bounds=(0.1, 0.1, 0.1, 0.1), step=STEP, rest=(0.0,) * 4)
    encoder, decoder = BundleEncoder(channel), BundleDecoder(channel)
    assert encoder.encode(0, (0.05, 0.0, -0.05, 0.09)) is None
    assert decoder.value(0) == (0.0,) * 4
    assert encoder.encode(1, (0.0, 0.0, 0.0, 0.2)) is not None


def test_nothing_is_displayed_before_the_first_update() -> None:
    decoder = BundleDecoder(channel_of(4))
    assert decoder.value(5) is None
    assert decoder.newest is None


@pytest.mark.parametrize(
    "update",
    [
        Update(9, 1, (0, 0, 0, 0)),
        Update(9, 0, (0, 0, 0)),
        Update(9, 0, (0, 0, 0, 0), PreviousSample(1, (0, 0, 0))),
        Update(9, 0, (0, 0, 0, 0), ModelParameters(b"")),
    ],
)
def test_an_update_that_does_not_fit_changes_nothing(update: Update) -> None:
    decoder = BundleDecoder(channel_of(4))
    decoder.apply(Update(3, 0, (1, 2, 3, 4)))
    before = decoder.state, decoder.newest, decoder.first
    with pytest.raises(ValueError, match="update"):
        decoder.apply(update)
    assert (decoder.state, decoder.newest, decoder.first) == before


@pytest.mark.parametrize("broken", [nan, inf, -inf])
def test_a_sample_that_is_not_finite_is_rejected(broken: float) -> None:
    encoder = BundleEncoder(channel_of(4))
    encoder.encode(0, (0.1, 0.1, 0.1, 0.1))
    assert encoder.encode(1, (0.1, 0.1, 0.1, broken)) is None
    assert encoder.rejected == 1
    assert encoder.coded == (0.1, 0.1, 0.1, 0.1)


def test_a_sample_of_other_length_is_an_error() -> None:
    with pytest.raises(ValueError, match="3 axes, expected 4"):
        BundleEncoder(channel_of(4)).encode(0, (0.0, 0.0, 0.0))


def test_a_bounded_rate_widens_all_deadbands() -> None:
    rate, random = UpdateRate(0.05, 20.0), Random(3)
    encoder = BundleEncoder(channel_of(6, "zoh", rate=rate))
    sent, widened = 0, 0
    for tick in range(2000):
        sent += encoder.encode(tick, tuple(random.gauss(0.0, 0.3) for _ in range(6))) is not None
        widened += encoder.widened
        assert encoder.bound >= 1.0
    assert 50 < sent <= 2000 * 0.05 + 20.0
    assert widened > 1000


def test_a_retuned_factor_holds_from_the_next_sample() -> None:
    encoder = BundleEncoder(channel_of(4, "zoh", weber=0.0))
    encoder.encode(0, (1.0, 1.0, 1.0, 1.0))
    encoder.retune(0.3, [0])
    assert encoder.encode(1, (1.2, 1.0, 1.0, 1.2)) is None
    encoder.retune(0.1)
    assert encoder.encode(2, (1.2, 1.0, 1.0, 1.2)) is not None
    with pytest.raises(ValueError, match="selectors"):
        encoder.retune(0.1, [1])
    with pytest.raises(ValueError, match="weber"):
        encoder.retune(-0.1)


@pytest.mark.parametrize("axes", range(1, 8))
def test_the_wire_carries_only_axes_that_exist(axes: int) -> None:
    channel = channel_of(axes)
    layout = UpdateLayout(channel.forms)
    assert channel.forms[0].newest == tuple(widths(axes))
    encoder, decoder = BundleEncoder(channel), BundleDecoder(channel)
    for tick, sample in enumerate(arm_stream(axes, axes, 200)):
        update = encoder.encode(tick, sample)
        if update is None:
            continue
        layout.check(update)
        assert len(update.newest) == axes
        decoder.apply(update)
        assert decoder.state == encoder.mirror.state
    shortest, longest = layout.lengths
    assert shortest <= layout.length(Update(0, 0, (0,) * axes)) <= longest


@pytest.mark.parametrize("predictor", ["plane", "path", "hybrid", "nothing"])
def test_a_predictor_that_does_not_suit_is_refused(predictor: str) -> None:
    with pytest.raises(ValueError, match=predictor):
        joint_channel(predictor=predictor, bounds=(0.1,) * 4, step=STEP)


def test_parts_that_do_not_fit_are_refused() -> None:
    part = channel_of(3).parts[0]
    for parts, count in (((), 0), ((part,), 4), ((part, part), 5)):
        with pytest.raises(ValueError, match="axes, three to a part"):
            BundleChannel(parts, count)
    with pytest.raises(ValueError, match="PerAxisDeadband, not isotropic"):
        BundleChannel((force_channel(predictor="zoh"),), 3)
    with pytest.raises(ValueError, match="rest has 2 axes"):
        joint_channel(bounds=(0.1,) * 4, step=STEP, rest=(0.0, 0.0))


@pytest.mark.parametrize("floor", [0.0, -1.0, nan])
def test_a_threshold_must_be_above_zero(floor: float) -> None:
    with pytest.raises(ValueError, match="threshold of an axis"):
        PerAxisDeadband(0.1, (0.1, floor, 0.1))


def test_error_is_the_largest_ratio() -> None:
    deadband = PerAxisDeadband(0.1, (1.0, 0.01, inf))
    assert deadband.bound((0.0,) * 3, (0.0,) * 3, (0.0,) * 3, 0.0) == 1.0
    assert deadband.error((0.0, 0.0, 0.0), (0.0, 0.0, 5.0)) == 0.0
    assert deadband.error((10.0, 0.0, 0.0), (8.0, 0.0, 0.0)) == pytest.approx(2.0)
    assert deadband.error((8.0, 0.2, 0.0), (8.0, 0.1, 0.0)) == pytest.approx(10.0)
    assert deadband == PerAxisDeadband(0.1, (1.0, 0.01, inf))
    assert len({deadband, PerAxisDeadband(0.1, (1.0, 0.01, inf)), PerAxisDeadband(0.2, (1.0, 0.01, inf))}) == 2
