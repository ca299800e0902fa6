"""What `adaptive` sends: the predictor that is plainly best, nothing that is excluded, and the same when run again."""

from collections import Counter
from collections.abc import Sequence
from functools import cache
from math import pi, sin
from random import Random

import pytest

from tests.codec.contacts import GodObject, contact, rubbing_stream, stroke
from tests.codec.signals import Stream, contact_stream
from weberlink.codec import Channel, Encoder, Update, force_channel, position_channel
from weberlink.codec.adaptive.choice import Choice
from weberlink.codec.adaptive.contact import Contact
from weberlink.codec.deadband import ForceDeadband
from weberlink.codec.predictors import PREDICTORS
from weberlink.codec.predictors.hold import Hold
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector


def bank(*names: str) -> Channel:
    return force_channel(predictor="adaptive", bank=names)


def updates(channel: Channel, stream: Stream) -> list[Update]:
    encoder = Encoder(channel)
    sent = [encoder.encode(tick, *sample) for tick, sample in enumerate(stream)]
    return [update for update in sent if update is not None]


def shares(channel: Channel, stream: Stream, since: int = 1000) -> dict[str, float]:
    """Of the ticks from then on, how many each predictor was in use."""
    encoder, ticks = Encoder(channel), Counter[str]()
    for tick, sample in enumerate(stream):
        encoder.encode(tick, *sample)
        if tick >= since:
            ticks[channel.bank[encoder.mirror.selected]] += 1
    return {name: ticks[name] / ticks.total() for name in channel.bank}


@cache
def wall() -> Stream:
    return contact(GodObject(800.0), ticks=3000)


@cache
def rubbing() -> Stream:
    return contact(GodObject(800.0, 0.0, 0.3), ticks=3000)


@cache
def moving() -> Stream:
    def path(t: float) -> Vector:
        a, b, height = stroke(t)
        return a, b, height + 0.9 * lift(t)

    def lift(t: float) -> float:
        return 0.016 * sin(2.0 * pi * t)

    return contact(GodObject(800.0), ticks=3000, path=path, lift=lift)


@cache
def nothing_but_noise() -> Stream:
    """A force that steps at random, and a hand that goes elsewhere: neither place nor slope says anything."""
    random, force, stream = Random(3), 2.0, []
    for tick in range(3000):
        if tick % 60 == 0:
            force = random.uniform(1.0, 3.0)
        noise = [random.gauss(0.0, 0.02) for _ in range(3)]
        a, b, height = stroke(tick * 1e-3)
        stream.append(((noise[0], noise[1], force + noise[2]), (a, b, height)))
    return stream


@cache
def tremor() -> Stream:
    """A slow wave, and on it a tremor of a little more than the deadband and the noise of a sensor."""
    random, stream = Random(8), []
    for tick in range(3000):
        t = tick * 1e-3
        force = 2.5 + 0.5 * sin(2.0 * pi * 0.8 * t) + 0.4 * sin(2.0 * pi * 8.0 * t) + random.gauss(0.0, 0.02)
        stream.append(((0.0, 0.0, force), ZERO))
    return stream


@cache
def ramps() -> Stream:
    """A force that rises and falls evenly whatever the hand does."""
    return [((0.0, 0.0, 2.0 + 1.9 * abs((tick / 400) % 2 - 1)), ZERO) for tick in range(3000)]


@pytest.mark.parametrize(
    ("names", "stream", "best", "least"),
    [
        (("zoh", "plane"), wall, {"plane"}, 0.9),
        (("zoh", "linear", "surface"), wall, {"surface"}, 0.9),
        (("zoh", "linear", "affine"), wall, {"affine"}, 0.6),
        (("zoh", "trend", "plane", "surface"), rubbing, {"surface"}, 0.75),
        (("zoh", "plane", "sphere"), moving, {"zoh", "plane"}, 0.3),
        (("zoh", "plane", "surface"), moving, {"surface"}, 0.75),
        (("zoh", "linear", "plane", "sphere"), nothing_but_noise, {"zoh"}, 0.8),
        (("zoh", "trend"), tremor, {"trend"}, 0.7),
        (("zoh", "linear", "plane"), ramps, {"linear"}, 0.9),
    ],
)  # fmt: skip
def test_what_is_plainly_best_is_in_use(names: tuple[str, ...], stream: object, best: set[str], least: float) -> None:
    assert callable(stream)
    found = shares(bank(*names), stream())
    assert sum(found[name] for name in best) >= least, found


@pytest.mark.parametrize(
    "names", [("zoh", "plane"), ("zoh", "linear", "surface"), ("zoh", "linear", "plane", "surface")]
)
@pytest.mark.parametrize("stream", [wall, rubbing, moving, nothing_but_noise, ramps])
def test_it_sends_hardly_more_than_the_best_of_its_bank(names: tuple[str, ...], stream: object) -> None:
    """A quarter more, and a few while it learns, on three seconds."""
    assert callable(stream)
    alone = [len(updates(force_channel(predictor=name), stream())) for name in names]
    assert len(updates(bank(*names), stream())) <= 1.25 * min(alone) + 10


SETTLED = 2000
"""Ticks after a change of the signal by which the record has followed it."""


def test_it_changes_with_the_signal_and_back() -> None:
    def of(name: str, parts: Sequence[Stream]) -> list[float]:
        encoder, found = Encoder(channel), []
        start = 0
        for part in parts:
            used = 0
            for tick, sample in enumerate(part, start):
                encoder.encode(tick, *sample)
                used += channel.bank[encoder.mirror.selected] == name and tick - start >= SETTLED
            start += len(part)
            found.append(used / (len(part) - SETTLED))
        return found

    channel = bank("zoh", "linear", "plane")
    first, between, last = of("plane", [wall(), ramps(), wall()])
    assert min(first, last) > 0.8
    assert between < 0.2


# What is not chosen.


@pytest.mark.parametrize("excluded", range(len(PREDICTORS)))
def test_what_retune_excludes_is_not_chosen_whatever_its_record(excluded: int) -> None:
    channel = bank(*PREDICTORS)
    others = [selector for selector in range(len(PREDICTORS)) if selector != excluded]
    encoder = Encoder(channel)
    encoder.retune(ForceDeadband(0.1, 0.02), others)
    chosen = Counter(
        update.selector
        for tick, sample in enumerate(rubbing_stream(4, ticks=2500))
        if (update := encoder.encode(tick, *sample)) is not None
    )
    assert excluded not in chosen
    assert set(chosen) <= set(others)


def test_the_record_of_what_was_excluded_is_kept_for_when_it_may_be_chosen_again() -> None:
    channel = bank("zoh", "plane")
    encoder = Encoder(channel)
    encoder.retune(ForceDeadband(0.1, 0.02), [0])
    first = None
    for tick, sample in enumerate(wall()):
        if tick == 2000:
            encoder.retune(ForceDeadband(0.1, 0.02), [0, 1])
        update = encoder.encode(tick, *sample)
        if update is not None and tick >= 2000 and first is None:
            first = update.selector
    assert first == 1


@pytest.mark.parametrize("names", [("zoh", "plane", "linear"), ("sphere", "zoh"), ("plane", "sphere", "linear", "zoh")])
def test_of_equals_the_first_is_chosen(names: tuple[str, ...]) -> None:
    choice, force = Choice(bank(*names)), (0.0, 0.0, 1.0)
    choice.follow(0, force, ZERO, 0.1)
    for first in range(len(names)):
        assert choice.choose(range(first, len(names)), Sample(0, force, ZERO), None, 0.1)[0] == first


@pytest.mark.parametrize("only", range(len(PREDICTORS)))
def test_without_a_history_the_sample_is_held(only: int) -> None:
    choice, force = Choice(bank(*PREDICTORS)), (0.0, 0.0, 1.0)
    choice.follow(0, force, ZERO, 0.1)
    selector, model = choice.choose([only], Sample(0, force, ZERO), None, 0.1)
    assert selector == only
    assert model in (None, Hold(force))


@pytest.mark.parametrize("bound", [0.0, 1e-300])
def test_a_deadband_of_nothing_is_no_division(bound: float) -> None:
    choice = Choice(force_channel(predictor="adaptive"))
    for tick in range(60):
        choice.follow(tick, (0.0, 0.0, 1.0 + tick % 3), ZERO, bound)
        choice.choose(range(5), Sample(tick, (0.0, 0.0, 1.0), ZERO), None, bound)


# The same again.


@pytest.mark.parametrize("predictor", ["trend", "affine", "surface", "adaptive"])
def test_a_reset_is_a_fresh_start(predictor: str) -> None:
    """Whatever was learned: the same bits again, also where the ticks go on."""
    channel = force_channel(predictor=predictor)
    used, fresh = Encoder(channel), Encoder(channel)
    for tick, sample in enumerate(contact_stream(12, ticks=900)):
        used.encode(tick, *sample)
    used.reset()
    count = 0
    for tick, sample in enumerate(rubbing()[:1500], 900):
        update = used.encode(tick, *sample)
        assert update == fresh.encode(tick, *sample)
        count += update is not None
    assert count > 1


def test_a_reset_of_a_position_channel_too() -> None:
    channel = position_channel(predictor="adaptive", bank=("zoh", "linear", "trend"))
    used, fresh = Encoder(channel), Encoder(channel)
    stream = [position for _, position in contact_stream(12, ticks=900)]
    for tick, position in enumerate(stream):
        used.encode(tick, position)
    used.reset()
    for tick, position in enumerate(stream):
        assert used.encode(tick, position) == fresh.encode(tick, position)


def test_a_position_channel_does_not_read_the_other_position() -> None:
    channel = position_channel(predictor="adaptive", bank=("zoh", "linear", "trend"))
    one, other = Encoder(channel), Encoder(channel)
    for tick, (_, position) in enumerate(contact_stream(2, ticks=900)):
        assert one.encode(tick, position) == other.encode(tick, position, (float(tick), 1.0, -1e6))


@pytest.mark.parametrize(
    ("names", "follows"), [(("zoh", "plane", "affine", "trend"), False), (("zoh", "surface"), True)]
)
def test_a_contact_is_followed_only_for_surfaces(
    names: tuple[str, ...], follows: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a bank does not need is not computed."""
    made: list[float] = []

    class Noting(Contact):
        def __init__(self, threshold: float) -> None:
            super().__init__(threshold)
            made.append(threshold)

    monkeypatch.setattr("weberlink.codec.adaptive.choice.Contact", Noting)
    encoder = Encoder(bank(*names))
    for tick, sample in enumerate(rubbing_stream(1, ticks=50)):
        encoder.encode(tick, *sample)
    # Twice the deadband at rest, or ten steps of the wire.
    assert made == ([0.04, 0.04] if follows else [])
