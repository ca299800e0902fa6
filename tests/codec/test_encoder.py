"""The law of closed-loop coding, and what an encoder does at its edges."""

from collections.abc import Sequence
from math import inf, nan
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.codec.contacts import rubbing_stream
from tests.codec.law import FORCE_PREDICTORS, POSITION_BANKS, POSITION_PREDICTORS, coded
from tests.codec.signals import contact_stream
from tests.examples import examples
from weberlink.codec import Channel, Decoder, Encoder, force_channel, position_channel
from weberlink.codec.deadband import Reference
from weberlink.codec.update import MAX_GAP
from weberlink.geometry.vector import ZERO, Vector

webers = st.floats(0.005, 0.5)
seeds = st.integers(0, 2**32 - 1)
axes_sets = st.sampled_from(["z", "xz", "xyz"])
forces = pytest.mark.parametrize("predictor", FORCE_PREDICTORS)
positions = pytest.mark.parametrize("predictor", POSITION_PREDICTORS)


def consume(channel: Channel, samples: Sequence[tuple[Vector, Vector]]) -> None:
    for _ in coded(channel, samples):
        pass


@forces
@given(weber=webers, floor=st.sampled_from([0.0, 0.002, 0.02]), seed=seeds, axes=axes_sets)
@examples(20)
def test_decoded_force_is_within_the_deadband_and_states_are_identical(
    predictor: str, weber: float, floor: float, seed: int, axes: str
) -> None:
    channel = force_channel(predictor=predictor, weber=weber, floor=floor, axes=axes)
    consume(channel, contact_stream(seed, axes=axes, ticks=300))


@positions
@given(weber=webers, bound=st.sampled_from([0.0, 1e-5, 2e-4]), seed=seeds, axes=axes_sets)
@examples(20)
def test_decoded_position_is_within_the_deadband_and_states_are_identical(
    predictor: str, weber: float, bound: float, seed: int, axes: str
) -> None:
    bank = POSITION_BANKS.get(predictor, ())
    channel = position_channel(predictor=predictor, bank=bank, weber=weber, bound=bound, axes=axes)
    consume(channel, [(position, ZERO) for _, position in contact_stream(seed, axes=axes, ticks=300)])


@forces
@given(
    reference=st.sampled_from(["actual", "displayed", "sent"]),
    axes=axes_sets,
    samples=st.lists(
        st.tuples(*[st.tuples(*[st.floats(-60.0, 60.0)] * 3)] * 2),
        min_size=1,
        max_size=40,
    ),
)
@examples(25)
def test_law_holds_for_any_finite_samples(
    predictor: str, reference: Reference, axes: str, samples: list[tuple[Vector, Vector]]
) -> None:
    consume(force_channel(predictor=predictor, reference=reference, axes=axes), samples)


@forces
@given(seed=seeds, samples=st.lists(st.tuples(*[st.tuples(*[st.floats(-1e300, 1e300)] * 3)] * 2), max_size=30))
@examples(8)
def test_law_holds_for_extreme_samples_amid_a_contact(
    predictor: str, seed: int, samples: list[tuple[Vector, Vector]]
) -> None:
    stream = contact_stream(seed, ticks=60)
    consume(force_channel(predictor=predictor), [*stream, *samples, *stream])


@forces
def test_any_update_that_arrives_restores_the_state_whatever_was_lost(predictor: str) -> None:
    channel = force_channel(predictor=predictor)
    encoder = Encoder(channel)
    updates = 0
    for tick, (force, position) in enumerate(contact_stream(7, ticks=2000)):
        update = encoder.encode(tick, force, position)
        if update is None:
            continue
        updates += 1
        late_starter = Decoder(channel)
        late_starter.apply(update)
        assert late_starter.state == encoder.mirror.state
    assert updates > 10


@pytest.mark.parametrize(("predictor", "position"), [(name, False) for name in FORCE_PREDICTORS] + [("adaptive", True)])
@pytest.mark.parametrize("seed", [3, 7])
def test_after_losses_and_overtaking_the_next_update_makes_the_ends_agree(
    predictor: str, position: bool, seed: int
) -> None:
    """From then on they agree at every tick until one is lost again."""
    channel = force_channel(predictor=predictor)
    if position:
        channel = position_channel(predictor=predictor, bank=POSITION_BANKS[predictor])
    encoder, decoder, random = Encoder(channel), Decoder(channel), Random(seed)
    agree, delayed, compared = True, None, 0
    for tick, (force, place) in enumerate(rubbing_stream(seed, ticks=1500)):
        update = encoder.encode(tick, *((place, ZERO) if position else (force, place)))
        if update is not None:
            if random.random() < 0.5:
                agree, delayed = False, update
            else:
                if delayed is not None:
                    decoder.apply(delayed)
                decoder.apply(update)
                agree, delayed = True, None
                assert decoder.state == encoder.mirror.state
        shown = decoder.value(tick, place)
        if agree:
            compared += 1
            assert shown == (encoder.predicted if update is None else encoder.mirror.value(tick, place))
            assert decoder.state == encoder.mirror.state
    assert compared > 300


@pytest.mark.parametrize("predictor", ["trend", "affine", "surface", "adaptive"])
def test_two_encoders_on_the_same_samples_send_the_same(predictor: str) -> None:
    channel = force_channel(predictor=predictor)
    one, other, again = Encoder(channel), Encoder(force_channel(predictor=predictor)), Encoder(channel)
    for tick, (force, position) in enumerate(contact_stream(5, ticks=300)):
        again.encode(tick, force, position)
    again.reset()
    sent = 0
    for tick, (force, position) in enumerate(rubbing_stream(2, ticks=1500)):
        update = one.encode(tick, force, position)
        assert update == other.encode(tick, force, position)
        assert update == again.encode(tick, force, position)
        sent += update is not None
    assert sent > 5


def test_a_sensor_at_rest_sends_nothing_above_the_floor_and_every_tick_without_one() -> None:
    noise = [(0.0, 0.0, 0.004 * (-1) ** tick) for tick in range(100)]
    with_floor = Encoder(force_channel(predictor="zoh", floor=0.02))
    without = Encoder(force_channel(predictor="zoh", floor=0.0))
    assert sum(with_floor.encode(tick, force) is not None for tick, force in enumerate(noise)) == 0
    assert sum(without.encode(tick, force) is not None for tick, force in enumerate(noise)) == 100


def test_first_position_is_sent_even_at_the_origin() -> None:
    assert Encoder(position_channel()).encode(0, ZERO) is not None


def test_no_force_is_assumed_until_one_is_sent() -> None:
    encoder = Encoder(force_channel())
    assert encoder.encode(0, ZERO) is None
    assert encoder.mirror.value(0) == ZERO


@pytest.mark.parametrize("predictor", ["hybrid", "trend", "affine", "surface", "adaptive"])
@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_samples_that_are_not_finite_are_counted_and_change_nothing(bad: float, predictor: str) -> None:
    encoder, clean = Encoder(force_channel(predictor=predictor)), Encoder(force_channel(predictor=predictor))
    for tick, (force, position) in enumerate(contact_stream(3)):
        if tick % 10 == 5:
            assert encoder.encode(tick, (0.0, bad, 0.0), position) is None
            assert encoder.encode(tick, force, (0.0, bad, 0.0)) is None
            continue
        assert encoder.encode(tick, force, position) == clean.encode(tick, force, position)
    assert encoder.rejected == 80


@forces
def test_values_beyond_the_wire_are_saturated_and_not_sent_at_every_tick(predictor: str) -> None:
    encoder = Encoder(force_channel(predictor=predictor))
    sends = [encoder.encode(tick, (0.0, 0.0, 1e6)) for tick in range(10)]
    assert [update is not None for update in sends] == [True] + [False] * 9
    assert sends[0] is not None
    assert sends[0].newest[:3] == (0, 0, 32_767)


def test_reset_sends_the_next_sample_as_a_first_one() -> None:
    encoder = Encoder(force_channel(predictor="linear"))
    encoder.encode(0, (0.0, 0.0, 1.0))
    encoder.encode(1, (0.0, 0.0, 2.0))
    encoder.reset()
    update = encoder.encode(2, (0.0, 0.0, 2.0))
    assert update is not None
    assert update.previous == ()


def test_a_sample_too_old_for_the_wire_predicts_nothing() -> None:
    encoder = Encoder(force_channel(predictor="linear"))
    encoder.encode(0, (0.0, 0.0, 1.0))
    update = encoder.encode(MAX_GAP + 1, (0.0, 0.0, 2.0))
    assert update is not None
    assert (update.gap, update.previous) == (0, ())


def test_previous_sample_travels_only_where_the_chosen_predictor_reads_it() -> None:
    for predictor, needed in [("zoh", False), ("linear", True)]:
        encoder = Encoder(force_channel(predictor=predictor))
        encoder.encode(0, (0.0, 0.0, 1.0))
        update = encoder.encode(1, (0.0, 0.0, 2.0))
        assert update is not None
        assert bool(update.previous) is needed


def test_hybrid_picks_the_predictor_that_was_closest_before_the_update() -> None:
    channel = force_channel(bank=["zoh", "linear"], weber=0.05)
    encoder = Encoder(channel)
    selectors = []
    for tick in range(200):
        force = 1.0 + 0.01 * tick if tick < 100 else 2.0 + (0.3 if tick % 50 < 25 else 0.0)
        update = encoder.encode(tick, (0.0, 0.0, force))
        if update is not None:
            selectors.append((tick, channel.bank[update.selector]))
    assert selectors[0] == (0, "zoh")
    assert [name for tick, name in selectors if 20 < tick <= 101][-1] == "linear"
    assert selectors[-1][1] == "zoh"


def test_hybrid_sends_no_more_than_its_worst_member_on_a_wall() -> None:
    stream = [((0.0, 0.0, 500.0 * d), (0.0, 0.0, -d)) for d in (0.001 + 0.0001 * (t % 100) for t in range(2000))]
    counts = {}
    for predictor in ("zoh", "plane", "hybrid"):
        encoder = Encoder(force_channel(predictor=predictor))
        counts[predictor] = sum(encoder.encode(t, f, p) is not None for t, (f, p) in enumerate(stream))
    assert counts["plane"] <= 3
    assert counts["hybrid"] <= 5
    assert counts["zoh"] > 100
