"""Another deadband and other predictors while it runs: the law holds across it, and the other end knows of none."""

from math import sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.codec.contacts import rubbing_stream
from tests.codec.signals import contact_stream
from tests.examples import examples
from weberlink.codec import Channel, Decoder, Encoder, Update, force_channel, position_channel
from weberlink.codec.deadband import ForceDeadband, PositionDeadband
from weberlink.codec.predictors import ADAPTIVE, FITTED, PREDICTORS
from weberlink.geometry.vector import ZERO, distance

BANK = tuple(FITTED)
EVERY = tuple(PREDICTORS)
HALF_STEP = 0.5e-3 * sqrt(3.0) * (1.0 + 1e-9)
ZOH, LINEAR, PLANE, SPHERE = range(4)


def changes(count: int) -> st.SearchStrategy[dict[int, tuple[float, float, list[int]]]]:
    """Weber factor, floor and selectors, by the tick."""
    selections = st.sets(st.integers(0, count - 1), min_size=1).map(sorted)
    change = st.tuples(st.floats(0.0, 0.5), st.floats(0.0, 0.1), selections)
    return st.dictionaries(st.integers(0, 299), change, min_size=1, max_size=6)


def ramp(tick: int) -> tuple[float, float, float]:
    return (0.0, 0.0, 1.0 + 0.05 * tick)


def follow_changes(channel: Channel, seed: int, changes: dict[int, tuple[float, float, list[int]]]) -> None:
    encoder, decoder = Encoder(channel), Decoder(channel)
    allowed = list(range(len(channel.bank)))
    for tick, (force, position) in enumerate(contact_stream(seed, ticks=300)):
        if tick in changes:
            weber, floor, allowed = changes[tick]
            deadband = ForceDeadband(weber, floor)
            encoder.retune(deadband, allowed)
        update = encoder.encode(tick, force, position)
        if update is not None:
            assert update.selector in allowed
            decoder.apply(Update(*update))
        if decoder.newest is not None:
            assert decoder.selected in allowed
        held = decoder.value(tick, position)
        assert held is not None
        assert decoder.state == encoder.mirror.state
        actual = channel.value_quantizer.confine(force)
        assert distance(held, actual) <= max(encoder.bound * (1.0 + 1e-12), HALF_STEP)
        if changes and tick >= min(changes):
            assert encoder.bound == deadband.bound(actual, held, ZERO, 0.0)


@given(seed=st.integers(0, 2**32 - 1), changes=changes(len(BANK)))
@examples(100)
def test_the_law_holds_across_changes_and_only_what_is_selected_is_chosen(
    seed: int, changes: dict[int, tuple[float, float, list[int]]]
) -> None:
    follow_changes(force_channel(bank=BANK), seed, changes)


@given(seed=st.integers(0, 2**32 - 1), changes=changes(len(EVERY)))
@examples(50)
def test_it_holds_too_where_the_choice_is_by_the_record(
    seed: int, changes: dict[int, tuple[float, float, list[int]]]
) -> None:
    follow_changes(force_channel(predictor=ADAPTIVE, bank=EVERY), seed, changes)


def test_the_bound_is_another_from_the_next_sample_on() -> None:
    encoder = Encoder(force_channel(predictor="zoh", weber=0.10, floor=0.0))
    assert encoder.encode(0, (0.0, 0.0, 1.0)) is not None
    assert encoder.encode(1, (0.0, 0.0, 1.05)) is None
    encoder.retune(ForceDeadband(0.02), [0])
    assert encoder.bound == pytest.approx(0.105)
    assert encoder.encode(2, (0.0, 0.0, 1.05)) is not None
    assert encoder.bound == pytest.approx(0.021)


def test_a_position_may_be_retuned_too() -> None:
    encoder = Encoder(position_channel(bound=1e-2))
    encoder.encode(0, ZERO)
    assert encoder.encode(1, (0.0, 0.0, 1e-3)) is None
    encoder.retune(PositionDeadband(0.0, 1e-4), [0])
    assert encoder.encode(2, (0.0, 0.0, 1e-3)) is not None


def test_a_predictor_that_is_no_longer_chosen_is_left_at_the_very_next_sample() -> None:
    encoder = Encoder(force_channel(bank=["zoh", "linear"]))
    for tick in range(100):
        encoder.encode(tick, ramp(tick))
    assert encoder.mirror.selected == LINEAR
    assert encoder.encode(100, ramp(100)) is None
    encoder.retune(ForceDeadband(0.10, 0.02), [ZOH])
    update = encoder.encode(101, ramp(101))
    assert update is not None
    assert (update.selector, update.previous) == (ZOH, ())
    assert encoder.encode(102, ramp(102)) is None


def test_the_change_waits_for_a_sample_that_can_be_coded() -> None:
    encoder = Encoder(force_channel(bank=["zoh", "linear"], weber=0.5))
    encoder.encode(0, ramp(0))
    encoder.retune(ForceDeadband(0.5), [LINEAR])
    assert encoder.encode(1, (0.0, 0.0, float("nan"))) is None
    assert encoder.encode(2, ramp(0)) is not None
    assert encoder.encode(3, ramp(0)) is None


def test_a_change_that_is_taken_back_sends_nothing() -> None:
    encoder = Encoder(force_channel(bank=["zoh", "linear"], weber=0.5))
    encoder.encode(0, ramp(0))
    for selectors in ([LINEAR], [ZOH]):
        encoder.retune(ForceDeadband(0.5), selectors)
    assert encoder.encode(1, ramp(0)) is None


@pytest.mark.parametrize("selectors", [[ZOH, LINEAR], (LINEAR, ZOH, ZOH)])
def test_nothing_is_sent_for_a_model_that_may_stay(selectors: list[int]) -> None:
    encoder = Encoder(force_channel(bank=BANK))
    encoder.encode(0, ramp(0))
    encoder.retune(ForceDeadband(0.10, 0.02), selectors)
    assert encoder.encode(1, ramp(0)) is None


def test_at_rest_nothing_is_sent_for_a_change_and_the_first_sample_is_of_what_is_selected() -> None:
    encoder = Encoder(force_channel(bank=BANK))
    encoder.retune(ForceDeadband(0.10, 0.02), [SPHERE, PLANE])
    assert encoder.encode(0, ZERO) is None
    update = encoder.encode(1, ramp(0))
    assert update is not None
    assert update.selector == PLANE


def test_a_reset_keeps_the_tuning_and_forces_nothing() -> None:
    encoder = Encoder(force_channel(bank=BANK))
    encoder.encode(0, ramp(0))
    encoder.retune(ForceDeadband(0.30, 0.5), [SPHERE])
    encoder.reset()
    assert encoder.encode(1, (0.0, 0.0, 0.4)) is None
    update = encoder.encode(2, ramp(0))
    assert update is not None
    assert update.selector == SPHERE


@pytest.mark.parametrize("selectors", [[], [4], [-1], [0, 9]])
def test_refuses_selectors_that_are_none_and_stays_as_it_was(selectors: list[int]) -> None:
    encoder, other = Encoder(force_channel(bank=BANK)), Encoder(force_channel(bank=BANK))
    with pytest.raises(ValueError, match="selectors"):
        encoder.retune(ForceDeadband(0.5, 5.0), selectors)
    for tick in range(50):
        assert encoder.encode(tick, ramp(tick)) == other.encode(tick, ramp(tick))


@pytest.mark.parametrize("name", EVERY)
def test_an_adaptive_choice_never_makes_what_is_not_selected_and_leaves_it_at_once(name: str) -> None:
    channel = force_channel(predictor=ADAPTIVE, bank=EVERY)
    encoder, only, left = Encoder(channel), EVERY.index(name), 0
    for tick, (force, position) in enumerate(rubbing_stream(4, ticks=900)):
        if tick == 300:
            left = encoder.mirror.selected
            encoder.retune(ForceDeadband(0.05, 0.02), [only])
        if tick == 600:
            encoder.retune(ForceDeadband(0.10, 0.02), [each for each in range(len(EVERY)) if each != only])
        update = encoder.encode(tick, force, position)
        if tick == 600 or (tick == 300 and left != only):
            assert update is not None
        if update is not None and tick >= 300:
            assert (update.selector == only) == (tick < 600)
    assert encoder.mirror.selected != only
