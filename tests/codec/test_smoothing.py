"""A ramp within the deadband in place of a step: its closed form, the law with it, what is felt of it, and losses."""

from collections.abc import Callable
from itertools import pairwise
from math import sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.codec.contacts import rubbing_stream
from tests.codec.law import FORCE_PREDICTORS, half_step
from tests.codec.signals import Stream, contact_stream
from tests.examples import examples
from weberlink.codec import Channel, Decoder, Encoder, Update, force_channel
from weberlink.codec.deadband import ConeDeadband, Deadband, ForceDeadband, LevelCrossingDeadband, VelocityDeadband
from weberlink.codec.predictors.linear import Line
from weberlink.codec.predictors.trend import TREND
from weberlink.codec.smoothing import Smoothing
from weberlink.geometry.vector import ZERO, Vector, distance, norm

vectors = st.tuples(*[st.floats(-40.0, 40.0)] * 3)
DEADBANDS: dict[str, Callable[[], Deadband]] = {
    "actual": lambda: ForceDeadband(0.1, 0.02),
    "displayed": lambda: ForceDeadband(0.1, 0.02, "displayed"),
    "sent": lambda: ForceDeadband(0.1, 0.02, "sent"),
    "no floor": lambda: ForceDeadband(0.1),
    "velocity": lambda: VelocityDeadband(0.1, 0.02),
    "velocity of displayed": lambda: VelocityDeadband(0.1, 0.02, "displayed"),
}


def up(force: float) -> Vector:
    return (0.0, 0.0, force)


@pytest.mark.parametrize(("ticks", "share", "what"), [
    (0, 0.5, "ticks"), (-3, 0.5, "ticks"), (4, -0.1, "share"), (4, 0.91, "share"), (4, float("nan"), "share"),
])  # fmt: skip
def test_refuses_numbers_out_of_range(ticks: int, share: float, what: str) -> None:
    with pytest.raises(ValueError, match=what):
        Smoothing(ticks, share)


@given(jump=vectors, bound=st.floats(0.0, 10.0), share=st.floats(0.0, 0.9))
def test_of_a_jump_the_share_of_a_deadband_is_kept_in_its_direction(jump: Vector, bound: float, share: float) -> None:
    kept = Smoothing(5, share).kept(jump, bound)
    assert norm(kept) == pytest.approx(min(norm(jump), share * bound), abs=1e-12)
    assert distance(kept, jump) == pytest.approx(norm(jump) - norm(kept), abs=1e-9)
    if norm(jump) < share * bound * 0.999:
        assert kept == jump


def test_the_ramp_is_even_and_ends_after_its_ticks() -> None:
    smoothing = Smoothing(4, 0.7)
    assert [smoothing.remaining(since) for since in (-1, 0, 1, 2.5, 4, 5, 1e300)] == [1, 1, 0.75, 0.375, 0, 0, 0]


def test_a_step_is_displayed_as_a_ramp_over_what_the_deadband_allows() -> None:
    """From 1 N to 2 N with k = 0.1: 0.7 * 0.2 N of the jump are given over 10 ticks, the rest at once."""
    decoder = Decoder(force_channel(predictor="zoh", smoothing=Smoothing(10, 0.7)))
    decoder.apply(Update(0, 0, (0, 0, 1000, 0, 0, 0)))
    # From nothing, the deadband of 1 N is kept back.
    assert decoder.value(0) == pytest.approx(up(0.93))
    assert decoder.value(9) == pytest.approx(up(0.993))
    assert decoder.value(10) == up(1.0)
    decoder.apply(Update(50, 0, (0, 0, 2000, 0, 0, 0)))
    for tick in range(50, 60):
        assert decoder.value(tick) == pytest.approx(up(2.0 - 0.14 * (1.0 - (tick - 50) / 10)))
        assert decoder.value(tick + 0.5) == pytest.approx(up(2.0 - 0.14 * (1.0 - (tick - 49.5) / 10)))
    assert [decoder.value(tick) for tick in (60, 61, 1000)] == [up(2.0)] * 3


def test_a_jump_within_the_share_is_no_step_at_all() -> None:
    decoder = Decoder(force_channel(predictor="zoh", smoothing=Smoothing(10, 0.7)))
    decoder.apply(Update(0, 0, (0, 0, 2000, 0, 0, 0)))
    before = decoder.value(30)
    decoder.apply(Update(30, 0, (0, 0, 2100, 0, 0, 0)))
    assert before == up(2.0)
    assert decoder.value(30) == pytest.approx(up(2.0))
    assert decoder.value(35) == pytest.approx(up(2.05))
    assert decoder.value(40) == up(2.1)


def test_a_ramp_that_is_cut_short_goes_on_from_where_it_was() -> None:
    decoder = Decoder(force_channel(predictor="zoh", smoothing=Smoothing(10, 0.7)))
    decoder.apply(Update(0, 0, (0, 0, 2000, 0, 0, 0)))
    decoder.value(20)
    decoder.apply(Update(20, 0, (0, 0, 2100, 0, 0, 0)))
    assert decoder.value(24) == pytest.approx(up(2.04))
    decoder.apply(Update(25, 0, (0, 0, 2150, 0, 0, 0)))
    assert decoder.value(25) == pytest.approx(up(2.05))


def test_the_ramp_of_a_line_leads_from_within_the_deadband_to_the_line() -> None:
    channel = force_channel(predictor="linear", smoothing=Smoothing(10, 0.7))
    smoothed, plain = Decoder(channel), Decoder(force_channel(predictor="linear"))
    for update in (
        Update(0, 0, (0, 0, 2000, 0, 0, 0)),
        Update(30, 0, (0, 0, 2300, 0, 0, 0), 30, (0, 0, 2000, 0, 0, 0)),
    ):
        for decoder in (smoothed, plain):
            decoder.value(29)
            decoder.apply(update)
    for tick in range(30, 45):
        line, shown = plain.value(tick), smoothed.value(tick)
        assert line is not None
        assert shown is not None
        assert line[2] - shown[2] == pytest.approx(0.7 * 0.23 * max(0.0, 1.0 - (tick - 30) / 10))


def test_where_the_model_begins_aside_of_the_sample_the_ramp_begins_near_the_sample_all_the_same() -> None:
    """A line of `trend` that begins on the side of what was displayed before: else the error would not be mended."""
    channel = force_channel(predictor="trend", axes="z", smoothing=Smoothing(10, 0.7))
    decoder = Decoder(channel)
    decoder.apply(Update(0, 0, (2000, 0)))
    assert decoder.value(49) == up(2.0)
    newest = channel.sample(50, (2300, 0))
    decoder.apply(Update(50, 0, (2300, 0), *TREND.packed(Line(up(2.12), ZERO, 50), newest, channel.grids)))
    shown = [decoder.value(tick) for tick in (50, 55, 60)]
    # 0.7 of the deadband of 0.23 N below the sample, and from there to the line.
    assert shown[0] == pytest.approx(up(2.3 - 0.161))
    assert shown[1] == pytest.approx(up(0.5 * (2.139 + 2.12)), abs=2e-3)
    assert shown[2] == pytest.approx(up(2.12), abs=2e-3)


def follow(channel: Channel, stream: Stream) -> int:
    """Both ends alike, and the law.

    At a send the deadband is that of what is displayed and sent from then on: `reference` may be either.
    """
    encoder, decoder, sent = Encoder(channel), Decoder(channel), 0
    near, deadband, before = half_step(channel), channel.deadband, stream[0][1]
    for tick, (force, position) in enumerate(stream):
        update = encoder.encode(tick, force, position)
        if update is not None:
            sent += 1
            decoder.apply(Update(*update))
        shown = decoder.value(tick, position)
        assert shown is not None
        assert decoder.state == encoder.mirror.state
        assert shown == (encoder.predicted if update is None else encoder.mirror.value(tick, position))
        actual = channel.value_quantizer.confine(force)
        error, bound = deadband.error(shown, actual), encoder.bound
        if update is not None:
            newest = channel.sample(update.tick, update.newest).value
            bound = deadband.bound(actual, shown, newest, distance(position, before))
            # The ramp takes 0.7 of the deadband at the sample, which is rounded.
            bound = max(bound, 0.7 * deadband.bound(newest, newest, newest, 0.0) + near)
        assert error <= max(bound * (1.0 + 1e-9), near)
        before = position
    return sent


@pytest.mark.parametrize("predictor", FORCE_PREDICTORS)
@given(
    deadband=st.sampled_from(list(DEADBANDS)), ticks=st.integers(1, 30), seed=st.integers(0, 2**32 - 1),
    axes=st.sampled_from(["z", "xz", "xyz"]),
)  # fmt: skip
@examples(15)
def test_the_law_holds_with_the_ramp(predictor: str, deadband: str, ticks: int, seed: int, axes: str) -> None:
    channel = force_channel(
        predictor=predictor, axes=axes, deadband=DEADBANDS[deadband](), smoothing=Smoothing(ticks, 0.7)
    )
    follow(channel, contact_stream(seed, ticks=250, axes=axes))


@pytest.mark.parametrize("deadband", [ConeDeadband(0.1, 0.02), LevelCrossingDeadband(0.1, 0.02)])
@pytest.mark.parametrize("predictor", ["zoh", "plane", "trend", "affine", "adaptive"])
def test_the_law_holds_in_the_measure_of_every_shape(predictor: str, deadband: Deadband) -> None:
    channel = force_channel(predictor=predictor, deadband=deadband, smoothing=Smoothing(12, 0.7))
    encoder, decoder = Encoder(channel), Decoder(channel)
    for tick, (force, position) in enumerate(rubbing_stream(6, ticks=800)):
        update = encoder.encode(tick, force, position)
        if update is not None:
            decoder.apply(update)
        shown = decoder.value(tick, position)
        assert shown is not None
        assert shown == (encoder.predicted if update is None else encoder.mirror.value(tick, position))
        assert deadband.error(shown, force) <= encoder.bound * (1.0 + 1e-9)


@pytest.mark.parametrize("predictor", ["zoh", "linear", "plane", "hybrid", "affine"])
def test_the_largest_step_is_smaller(predictor: str) -> None:
    """Of a slow press and a tremor."""
    forces = (up(2.0 + sin(0.004 * tick) + 0.05 * sin(0.07 * tick)) for tick in range(3000))
    stream = [(force, (0.0, 0.0, -1e-3 * sin(0.02 * tick))) for tick, force in enumerate(forces)]
    steps = []
    for smoothing in (None, Smoothing(20, 0.7)):
        channel = force_channel(predictor=predictor, smoothing=smoothing)
        encoder, shown, largest = Encoder(channel), [], 0.0
        for tick, (force, position) in enumerate(stream):
            encoder.encode(tick, force, position)
            shown.append(encoder.mirror.value(tick, position) or ZERO)
        for one, other in pairwise(shown[50:]):
            largest = max(largest, distance(one, other))
        steps.append(largest)
    assert steps[1] < 0.6 * steps[0]


@pytest.mark.parametrize("predictor", ["zoh", "trend", "hybrid", "adaptive"])
def test_after_a_loss_the_ends_display_the_same_when_the_ramp_is_over(predictor: str) -> None:
    ticks = 8
    channel = force_channel(predictor=predictor, smoothing=Smoothing(ticks, 0.7))
    encoder, decoder = Encoder(channel), Decoder(channel)
    missed = [True, True, False, False, False, True, False] * 1000
    since, compared, ramping = ticks, 0, 0
    for tick, (force, position) in enumerate(contact_stream(7, ticks=2000)):
        update, since = encoder.encode(tick, force, position), since + 1
        if update is not None:
            if missed.pop():
                since = -(10**9)
            else:
                decoder.apply(update)
                assert decoder.state == encoder.mirror.state
                since = since if since > ticks else 0
        shown = decoder.value(tick, position)
        mirrored = encoder.predicted if update is None else encoder.mirror.value(tick, position)
        if since >= ticks:
            compared += 1
            assert shown == mirrored
        elif since >= 0:
            ramping += shown != mirrored
    assert compared > 100
    assert ramping > 0


@pytest.mark.parametrize("smoothing", [Smoothing(1, 0.7), Smoothing(20, 0.0)])
def test_a_ramp_of_nothing_is_none(smoothing: Smoothing) -> None:
    """One without a share is the codec without one, but for the sign of a zero."""
    channel = force_channel(predictor="zoh", smoothing=smoothing)
    plain, smoothed = Encoder(force_channel(predictor="zoh")), Encoder(channel)
    for tick, (force, position) in enumerate(contact_stream(9, ticks=300)):
        update = plain.encode(tick, force, position)
        if smoothing.share == 0.0:
            assert smoothed.encode(tick, force, position) == update
        else:
            smoothed.encode(tick, force, position)
            newest = smoothed.mirror.newest
            if newest is not None and newest.tick < tick:
                assert smoothed.mirror.value(tick) == newest.value


def test_reset_forgets_the_ramp() -> None:
    decoder = Decoder(force_channel(predictor="zoh", smoothing=Smoothing(10, 0.7)))
    decoder.apply(Update(0, 0, (0, 0, 2000, 0, 0, 0)))
    decoder.reset()
    assert decoder.value(1) == ZERO


def test_the_way_that_a_surface_takes_note_of_is_that_before_the_update() -> None:
    """To know where the ramp begins, the old model is asked where the new sample lies; nothing is noted of that."""
    smoothed = force_channel(predictor="surface", smoothing=Smoothing(5, 0.7))
    encoder, decoder = Encoder(smoothed), Decoder(smoothed)
    for tick, (force, position) in enumerate(rubbing_stream(11, ticks=1500)):
        update = encoder.encode(tick, force, position)
        if update is not None:
            decoder.apply(update)
        decoder.value(tick, position)
        assert decoder.state == encoder.mirror.state
