"""A ramp within the deadband instead of a step: closed form, the law of the encoder, effect, and losses."""

import pytest

from tests.codec.law import POSITION_PREDICTORS, make_channel
from tests.codec.signals import contact_stream, up
from weberlink.codec import Decoder, Encoder, Update, force_channel
from weberlink.codec.deadband import ForceDeadband
from weberlink.geometry.vector import ZERO
from weberlink.update import PreviousSample


def held(tick: int, force: int) -> Update:
    return Update(tick, 0, (0, 0, force))


def test_a_step_is_displayed_as_a_ramp_within_the_deadband() -> None:
    """From 1 N to 2 N with k = 0.1: 0.4 * 0.2 N of the jump take 10 ticks, the rest is displayed at once."""
    decoder = Decoder(make_channel("zoh", smoothing=10))
    decoder.apply(held(0, 1000))
    assert decoder.value(0) == pytest.approx(up(0.96))
    assert decoder.value(9) == pytest.approx(up(0.996))
    assert decoder.value(10) == up(1.0)
    decoder.apply(held(50, 2000))
    for tick in range(50, 60):
        assert decoder.value(tick) == pytest.approx(up(2.0 - 0.08 * (1.0 - (tick - 50) / 10)))
        assert decoder.value(tick + 0.5) == pytest.approx(up(2.0 - 0.08 * (1.0 - (tick - 49.5) / 10)))
    assert [decoder.value(tick) for tick in (60, 61, 1000)] == [up(2.0)] * 3
    # A jump within the share is no step at all, and a ramp that is cut short goes on from where it was.
    decoder.apply(held(1000, 2080))
    assert decoder.value(1000) == pytest.approx(up(2.0))
    assert decoder.value(1004) == pytest.approx(up(2.032))
    decoder.apply(held(1005, 2120))
    assert decoder.value(1005) == pytest.approx(up(2.04))
    decoder.reset()
    assert decoder.value(1006) == ZERO


def test_the_ramp_of_a_line_leads_from_within_the_deadband_to_the_line() -> None:
    smoothed = Decoder(make_channel("linear", smoothing=10))
    plain = Decoder(force_channel(predictor="linear"))
    for update in (held(0, 2000), Update(30, 0, (0, 0, 2300), PreviousSample(30, (0, 0, 2000)))):
        for decoder in (smoothed, plain):
            decoder.value(29)
            decoder.apply(update)
    for tick in range(30, 45):
        line, shown = plain.value(tick), smoothed.value(tick)
        assert line is not None
        assert shown is not None
        assert line[2] - shown[2] == pytest.approx(0.4 * 0.23 * max(0.0, 1.0 - (tick - 30) / 10))


def test_an_update_on_its_way_during_a_live_change_has_the_ramp_of_its_tick() -> None:
    decoder = Decoder(make_channel("zoh", weber=0.1, smoothing=10))
    decoder.retune(ForceDeadband(0.2, 0.02), since=100)
    for tick, force, kept in ((90, 1.0, 0.04), (99, 2.0, 0.08), (100, 4.0, 0.32), (120, 8.0, 0.64)):
        decoder.apply(held(tick, round(1000 * force)))
        assert decoder.value(tick) == pytest.approx(up(force - kept))
    decoder.reset()  # the sender may have begun its ticks anew; the deadband stays
    decoder.apply(held(5, 1000))
    assert decoder.value(5) == pytest.approx(up(0.92))


@pytest.mark.parametrize("predictor", POSITION_PREDICTORS)
def test_after_a_loss_the_ends_display_the_same_when_the_ramp_is_over(predictor: str) -> None:
    ticks = 8
    channel = make_channel(predictor, smoothing=ticks)
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
                assert repr(decoder.state) == repr(encoder.mirror.state)  # an unknown position is not equal to itself
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
