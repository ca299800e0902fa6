"""`adaptive`: a shadow sends when an encoder with its candidate alone would send, and the best record is chosen."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from random import Random
from typing import Any

import pytest

from plugins.predictors.tests.signals import GodObject, contact
from tests.codec.law import FITTED
from tests.codec.signals import Stream, stroke, up
from weberlink.codec import Channel, Encoder, force_channel
from weberlink.codec.choice import NOTHING, DueSample
from weberlink.codec.deadband import ForceDeadband
from weberlink.codec.predictors import PREDICTORS, FitLimits
from weberlink.codec.predictors.contract import Hold
from weberlink.codec.replay import code
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO
from weberlink_predictors.adaptive import REST_S, AdaptiveChoice, FittedCandidate, Shadow
from weberlink_predictors.estimation import KEPT_S, LONGEST_GAP_S, History, Signal

LIMITS = FitLimits()
DEADBAND = ForceDeadband(0.1)


def bank(*names: str) -> Channel:
    return force_channel(predictor="adaptive", bank=names)


def sends(channel: Channel, stream: Stream) -> list[int]:
    return [tick for tick, update in enumerate(code(channel, stream).updates) if update is not None]


def test_a_hybrid_takes_no_estimated_predictor() -> None:
    for predictor in ("affine", "surface", "path", "elastic"):
        with pytest.raises(ValueError, match=f"{predictor}: not for hybrid"):
            force_channel(bank=["zoh", predictor])


@pytest.mark.parametrize(
    ("options", "newest"),
    [
        ({}, [(3,), (3, 3), (3,), (3, 3)]),
        ({"every_position": True}, [(3, 3)] * 4),
        ({"smoothing": 9}, [(3, 3)] * 4),
    ],
)
def test_an_update_carries_what_is_read_and_no_sample_beside_parameters(
    options: dict[str, Any], newest: list[tuple[int, ...]]
) -> None:
    channel = replace(bank("linear", "plane", "path", "affine"), **options)
    assert [form.newest for form in channel.forms] == newest
    assert [form.previous for form in channel.forms] == [(3,), (3, 3), None, None]


# History.


def test_a_history_keeps_the_latest_samples_and_ends_at_a_gap() -> None:
    history, kept = History(1e-3), round(1e3 * KEPT_S)
    for tick in range(1000):
        history.add(tick, up(tick), (float(tick), 0.0, 0.0), 0.1 + tick)
        assert (history.follows, history.bound) == (tick > 0, 0.1 + tick)
        assert min(tick + 1, kept) <= len(history) == len(history.places) <= 2 * kept
        first = tick + 1 - len(history)
        assert history.values == [up(each) for each in range(first, tick + 1)]
    for other in (1001, 999, 998, 0, 10**9):  # a gap, a repetition, or a step back
        history = History(1e-3)
        history.add(998, up(1.0), ZERO, 0.1)
        history.add(999, up(1.0), ZERO, 0.1)
        history.add(other, ZERO, ZERO, 0.1)
        assert not history.follows
        assert (history.values, history.places) == ([ZERO], [ZERO])
        history.add(other + 1, ZERO, ZERO, 0.1)
        assert history.follows


@pytest.mark.parametrize("period", [2e-3, 1e-3, 2.5e-4])
def test_a_short_gap_is_filled_by_straight_lines(period: float) -> None:
    history, longest = History(period), round(LONGEST_GAP_S / period)
    assert history.missing(5, up(1.0), ZERO) == []  # before the first sample there is nothing to fill from
    history.add(100, up(1.0), (0.0, 2.0, 0.0), 0.1)
    for gap in (-50, 0, 1, longest + 1, 10**9):
        assert history.missing(100 + gap, up(9.0), ZERO) == []
    filled = history.missing(100 + longest, up(1.0 + longest), (0.0, 2.0 - longest, 0.0))
    assert [tick for tick, _, _ in filled] == list(range(101, 100 + longest))
    for tick, value, place in filled:
        assert value == pytest.approx(up(1.0 + tick - 100))
        assert place == pytest.approx((0.0, 102.0 - tick, 0.0))


# Shadows.


def zoh_shadow(selector: int = 0) -> Shadow:
    return Shadow(selector, FittedCandidate(PREDICTORS["zoh"], LIMITS), ZERO)


def signal_of(channel: Channel) -> Signal:
    return Signal(channel.grid, LIMITS, 0.04)


def shadowed(channel: Channel, shadow: Shadow, stream: Stream, signal: Signal | None = None) -> list[int]:
    """Ticks of its sends, in the loop of `AdaptiveChoice`."""
    history, sent, deadband = History(channel.tick_period), [], channel.deadband
    estimators = signal.estimators.values() if signal is not None else ()
    for tick, (force, position) in enumerate(stream):
        bound = deadband.bound(force, force, force, 0.0)
        history.add(tick, force, position, bound)
        for estimator in estimators:
            estimator.follow(history)
        if shadow.follow(tick, force, position, bound, deadband):
            sent.append(tick)
            shadow.send(channel.grid.quantize(tick, force, position)[1], bound, history)
    return sent


@pytest.mark.parametrize("name", FITTED)
def test_a_fitted_candidate_sends_at_the_ticks_of_its_encoder(name: str) -> None:
    """Not so for estimated ones: their shadows use the model itself, without the rounding of its parameters."""
    channel = force_channel(predictor=name)
    stream = contact(GodObject(400.0), ticks=2500, noise=0.0)  # so calm that no candidate is suspended
    stream = [(ZERO, position) for _, position in stream[:50]] + stream[50:]
    sent = shadowed(channel, Shadow(0, FittedCandidate(PREDICTORS[name], LIMITS), ZERO), stream)
    assert sent == sends(channel, stream)
    assert len(sent) > 1


def sent_at(*ticks: int) -> Shadow:
    shadow = zoh_shadow()
    for tick in ticks:
        shadow.send(Sample(tick, ZERO, ZERO), 0.1, History(1e-3))
    return shadow


def test_a_tick_count_that_restarts_forgets_nothing() -> None:
    assert sent_at(2**24 - 5).record(3) == pytest.approx(1.0)
    # Nor is the candidate suspended for all the ticks there were.
    assert sent_at(2**24 - 6, 2**24 - 5).follow(3, up(1.0), ZERO, 0.1, DEADBAND)


def test_a_hopeless_candidate_is_suspended_and_its_record_goes_on() -> None:
    channel, shadow = force_channel(predictor="zoh"), zoh_shadow()
    sent = shadowed(channel, shadow, [(up(1.0 + tick % 2), ZERO) for tick in range(400)])
    assert max(later - earlier for earlier, later in pairwise(sent)) >= round(1e3 * REST_S)
    assert len(sent) < 400 / 3
    assert shadow.record(399) > sent_at(*range(0, 400, 5)).record(399)
    # One that lasts four ticks never is.
    slower = [(up(1.0 + tick // 4 % 2), ZERO) for tick in range(200)]
    assert shadowed(channel, zoh_shadow(), slower) == list(range(0, 200, 4))


# The choice.


@cache
def wall() -> Stream:
    return contact(GodObject(800.0), ticks=3000)


@cache
def rubbing() -> Stream:
    return contact(GodObject(800.0, 0.0, 0.3), ticks=3000)


@cache
def nothing_but_noise() -> Stream:
    """Random steps of force, independent of the motion of the hand: neither position nor slope predicts them."""
    random, force, stream = Random(3), 2.0, []
    for tick in range(3000):
        if tick % 60 == 0:
            force = random.uniform(1.0, 3.0)
        noise = [random.gauss(0.0, 0.02) for _ in range(3)]
        a, b, height = stroke(tick * 1e-3)
        stream.append(((noise[0], noise[1], force + noise[2]), (a, b, height)))
    return stream


@cache
def ramps() -> Stream:
    """A force that rises and falls linearly, independent of the hand."""
    return [(up(2.0 + 1.9 * abs((tick / 400) % 2 - 1)), ZERO) for tick in range(3000)]


@pytest.mark.parametrize(
    ("names", "stream", "best", "least"),
    [
        (("zoh", "plane"), wall, {"plane"}, 0.9),
        (("zoh", "linear", "surface"), wall, {"surface"}, 0.9),
        (("zoh", "path", "plane", "surface"), rubbing, {"surface"}, 0.75),
        (("zoh", "linear", "plane", "sphere"), nothing_but_noise, {"zoh"}, 0.8),
        (("zoh", "linear", "plane"), ramps, {"linear"}, 0.9),
    ],
)
def test_what_is_clearly_best_is_in_use(
    names: tuple[str, ...], stream: Callable[[], Stream], best: set[str], least: float
) -> None:
    used = Counter(names[selected] for selected in code(bank(*names), stream()).selected[1000:])
    assert sum(used[name] for name in best) >= least * used.total(), used


def test_the_record_of_a_deselected_predictor_is_kept() -> None:
    encoder, first = Encoder(bank("zoh", "plane")), None
    encoder.retune(ForceDeadband(0.1, 0.02), [0])
    for tick, sample in enumerate(wall()):
        if tick == 2000:
            encoder.retune(ForceDeadband(0.1, 0.02), [0, 1])
        update = encoder.encode(tick, *sample)
        if update is not None and tick >= 2000 and first is None:
            first = update.selector
    assert first == 1


@pytest.mark.parametrize("names", [("zoh", "plane", "linear"), ("sphere", "zoh"), tuple(PREDICTORS)])
def test_the_first_of_equals_is_chosen_and_held_without_a_history(names: Sequence[str]) -> None:
    """A sample without a model is held by `zoh`, which sends no position, where that is allowed."""
    choice, force = AdaptiveChoice(bank(*names)), up(1.0)
    choice.follow(0, force, ZERO, 0.1)
    due = DueSample(Sample(0, force, ZERO), None, force, ZERO, 0.1, NOTHING, 0, None)
    for first, name in enumerate(names):
        simplest = [each for each in range(first, len(names)) if names[each] != "affine"] or [first]
        selector, model = choice.choose(simplest, due)
        zoh = names.index("zoh")
        assert selector == (zoh if model is None and zoh in simplest else simplest[0])
        assert choice.choose([first], due)[1] in (None, Hold(force)), name
