"""A shadow sends when an encoder with its predictor alone would, and its record says how often that was of late."""

from itertools import pairwise
from math import exp

import pytest

from tests.codec.contacts import GodObject, contact, stroke
from tests.codec.signals import Stream
from weberlink.codec import Channel, Encoder, force_channel
from weberlink.codec.adaptive.candidate import Candidate, Occasion
from weberlink.codec.adaptive.contact import Contact
from weberlink.codec.adaptive.fitted import Fitted
from weberlink.codec.adaptive.history import History
from weberlink.codec.adaptive.shadow import MEMORY, REST, Shadow
from weberlink.codec.adaptive.surface import Rough
from weberlink.codec.predictors import FITTED, Model, Trust
from weberlink.codec.predictors.hold import Hold
from weberlink.codec.predictors.linear import Line
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, distance


def up(force: float) -> Vector:
    return (0.0, 0.0, force)


def shadowed(channel: Channel, shadow: Shadow, stream: Stream, found: Contact | None = None) -> list[int]:
    """Ticks of its sends; the loop is that of `weberlink.codec.adaptive.choice`."""
    history, sends, deadband = History(), [], channel.deadband
    for tick, (force, position) in enumerate(stream):
        bound = deadband.bound(force, force, force, 0.0)
        follows = history.add(tick, force, position)
        if found is not None:
            found.follow(history, follows)
        if shadow.follow(tick, force, position, bound, deadband.error):
            sends.append(tick)
            shadow.send(channel.sample(tick, channel.levels(force, position)), bound, history)
    return sends


def encoded(channel: Channel, stream: Stream) -> list[int]:
    encoder = Encoder(channel)
    return [tick for tick, sample in enumerate(stream) if encoder.encode(tick, *sample) is not None]


def calm(ticks: int = 2500) -> Stream:
    """So that no candidate is left alone, which an encoder never is."""
    stream = contact(GodObject(400.0), ticks=ticks, noise=0.0)
    return [(ZERO, position) for _, position in stream[:50]] + stream[50:]


@pytest.mark.parametrize("name", list(FITTED))
def test_a_fitted_candidate_sends_at_the_ticks_of_its_encoder(name: str) -> None:
    """Equal to the tick: both fit the same quantized samples, and within the range nothing is confined.

    It is not so of `trend`, `affine` and `surface`, whose shadows follow the model itself and not what the wire's
    grid makes of its parameters.
    """
    channel = force_channel(predictor=name)
    stream = calm()
    sends = shadowed(channel, Shadow(0, Fitted(FITTED[name], channel.trust), ZERO), stream)
    assert sends == encoded(channel, stream)
    assert len(sends) > 1


def test_a_surface_that_rubs_is_followed_as_its_encoder_does_but_for_the_grid() -> None:
    """Its shadow takes note of the way as the other end does: without, it would send three times as often."""
    channel = force_channel(predictor="surface")
    stream, found = contact(GodObject(800.0, 0.0, 0.3), ticks=4000), Contact(0.04)
    sends = shadowed(channel, Shadow(0, Rough(found, Trust()), ZERO), stream, found)
    later = [tick for tick in sends if tick >= 400]
    holds = [tick for tick in encoded(force_channel(predictor="zoh"), stream) if tick >= 400]
    assert len(later) < 0.1 * len(holds)


def test_before_the_first_sample_a_force_rests_and_a_position_is_sent() -> None:
    fitted = Fitted(FITTED["zoh"], Trust())
    assert not Shadow(0, fitted, ZERO).follow(0, up(0.05), ZERO, 0.1, distance)
    assert Shadow(0, fitted, ZERO).follow(0, up(0.2), ZERO, 0.1, distance)
    assert Shadow(0, fitted, None).follow(0, ZERO, ZERO, 0.1, distance)


def test_the_error_is_that_of_its_prediction_before_its_send() -> None:
    shadow = Shadow(3, Fitted(FITTED["zoh"], Trust()), ZERO)
    assert shadow.selector == 3
    assert shadow.follow(5, up(2.0), ZERO, 0.2, distance)
    assert shadow.error == 2.0
    shadow.send(Sample(5, up(2.0), ZERO), 0.2, History())
    assert not shadow.follow(6, up(2.15), ZERO, 0.2, distance)
    assert shadow.error == pytest.approx(0.15)


def test_what_is_not_a_number_is_an_error() -> None:
    class Wild:
        def model(self, occasion: Occasion) -> Model:
            return Hold((float("nan"), 0.0, 0.0))

    shadow = Shadow(0, Wild(), ZERO)
    shadow.send(Sample(0, ZERO, ZERO), 0.1, History())
    assert shadow.follow(1, ZERO, ZERO, 0.1, distance)


class Noted:
    """Keeps what it was told, and draws a line through it."""

    def __init__(self) -> None:
        self.occasions: list[Occasion] = []

    def model(self, occasion: Occasion) -> Model | None:
        self.occasions.append(occasion)
        return Line(occasion.newest.value, up(0.1), occasion.newest.tick) if len(self.occasions) > 1 else None


def test_a_candidate_is_told_of_its_own_sends_and_held_where_it_knows_nothing() -> None:
    noted = Noted()
    candidate: Candidate = noted
    shadow, history = Shadow(0, candidate, ZERO), History()
    one, other, third = (Sample(tick, up(1.0), ZERO) for tick in (2, 10, 10 + 65_536))
    for sample in (one, other, third):
        shadow.send(sample, 0.3, history)
        shadow.follow(sample.tick + 5, up(1.0), ZERO, 9.0, distance)
        assert shadow.error == pytest.approx(0.0 if sample is one else 0.5)
    assert [(told.newest, told.earlier) for told in noted.occasions] == [(one, None), (other, one), (third, None)]
    assert all((told.bound, told.history) == (0.3, history) for told in noted.occasions)


# The record.


def sent_at(*ticks: int) -> Shadow:
    shadow = Shadow(0, Fitted(FITTED["zoh"], Trust()), ZERO)
    for tick in ticks:
        shadow.send(Sample(tick, ZERO, ZERO), 0.1, History())
    return shadow


@pytest.mark.parametrize("now", [300, 400, 5000])
def test_a_record_is_the_sends_slowly_forgotten(now: int) -> None:
    ticks = (10, 60, 300)
    expected = sum(exp((tick - now) / MEMORY) for tick in ticks)
    assert sent_at(*ticks).record(now) == pytest.approx(expected)


def test_asking_changes_nothing() -> None:
    shadow = sent_at(10, 50)
    for now in range(60, 100):
        shadow.record(now)
    assert shadow.record(100) == pytest.approx(sent_at(10, 50).record(100))


def test_who_sent_less_and_earlier_has_the_better_record() -> None:
    assert sent_at().record(500) == 0.0
    assert sent_at(100).record(500) < sent_at(100, 200).record(500) < sent_at(100, 300).record(500)


def test_a_count_that_begins_anew_forgets_nothing() -> None:
    assert sent_at(2**24 - 5).record(3) == pytest.approx(1.0)
    # It is not asleep for all the ticks there were.
    assert sent_at(2**24 - 6, 2**24 - 5).follow(3, up(1.0), ZERO, 0.1, distance)


def test_no_time_is_too_long() -> None:
    assert sent_at(0).record(2**70) == 0.0


def test_a_hopeless_candidate_rests_and_is_taken_to_go_on_as_it_did() -> None:
    """It would have sent at every tick, and its record is no better for the rest."""
    stream: Stream = [(up(1.0 + tick % 2), ZERO) for tick in range(400)]
    channel = force_channel(predictor="zoh")
    shadow = Shadow(0, Fitted(FITTED["zoh"], Trust()), ZERO)
    sends = shadowed(channel, shadow, stream)
    assert max(later - earlier for earlier, later in pairwise(sends)) >= REST
    assert len(sends) < 400 / 3
    assert shadow.record(399) > sent_at(*range(0, 400, 5)).record(399)


def test_one_that_lasts_is_never_left_alone() -> None:
    stream: Stream = [(up(1.0 + tick // 4 % 2), stroke(0.0)) for tick in range(200)]
    shadow = Shadow(0, Fitted(FITTED["zoh"], Trust()), ZERO)
    assert shadowed(force_channel(predictor="zoh"), shadow, stream) == list(range(0, 200, 4))
