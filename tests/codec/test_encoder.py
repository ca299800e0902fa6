"""The law of closed-loop coding, and the encoder in special cases."""

from collections.abc import Sequence
from math import inf, nan
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.codec.law import ESTIMATED, FITTED, FORCE_PREDICTORS, POSITION_PREDICTORS, coded, half_step, make_channel
from tests.codec.signals import contact_stream, rubbing_stream
from tests.examples import examples
from weberlink.codec import Channel, Decoder, Encoder, force_channel, position_channel
from weberlink.codec.deadband import (
    ConeDeadband,
    Deadband,
    ForceDeadband,
    LevelCrossingDeadband,
    PositionDeadband,
    Reference,
)
from weberlink.codec.predictors import ADAPTIVE, PREDICTORS, FitLimits, Predictor
from weberlink.codec.predictors.contract import Candidate, EncodeContext, Signal
from weberlink.codec.predictors.model import Line
from weberlink.codec.replay import code
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.geometry.vector import ZERO, Vector, distance
from weberlink.update import MAX_GAP

webers = st.floats(0.005, 0.5)
seeds = st.integers(0, 2**32 - 1)
axes_sets = st.sampled_from(["z", "xz", "xyz"])
forces = pytest.mark.parametrize("predictor", FORCE_PREDICTORS)
positions = pytest.mark.parametrize("predictor", POSITION_PREDICTORS)
EVERY = tuple(PREDICTORS)
ZOH, LINEAR, PLANE, SPHERE = range(4)


def consume(channel: Channel, samples: Sequence[tuple[Vector, Vector]]) -> None:
    for _ in coded(channel, samples):
        pass


@forces
@given(weber=webers, floor=st.sampled_from([0.0, 0.002, 0.02]), seed=seeds, axes=axes_sets)
@examples(10)
def test_law_holds_for_forces(predictor: str, weber: float, floor: float, seed: int, axes: str) -> None:
    channel = force_channel(predictor=predictor, weber=weber, floor=floor, axes=axes)
    consume(channel, contact_stream(seed, axes=axes, ticks=300))


@positions
@given(weber=webers, bound=st.sampled_from([0.0, 1e-5, 2e-4]), seed=seeds, axes=axes_sets)
@examples(10)
def test_law_holds_for_positions(predictor: str, weber: float, bound: float, seed: int, axes: str) -> None:
    channel = make_channel(predictor, position=True, weber=weber, bound=bound, axes=axes)
    consume(channel, [(position, ZERO) for _, position in contact_stream(seed, axes=axes, ticks=300)])


@positions
@given(seed=seeds, limits=st.lists(st.sampled_from([1e-5, 1e-4, 1e-3, inf]), min_size=300, max_size=300))
@examples(10)
def test_a_limit_of_the_error_holds_where_the_deadband_allows_more(
    predictor: str, seed: int, limits: list[float]
) -> None:
    samples = [(position, ZERO) for _, position in contact_stream(seed, ticks=300)]
    ticks = list(coded(make_channel(predictor, position=True, weber=0.0, bound=2e-4), samples, limits=limits))
    assert [tick.bound for tick in ticks] == [min(2e-4, limit) for limit in limits]


@forces
@given(
    reference=st.sampled_from(["actual", "displayed", "sent"]),
    axes=axes_sets,
    samples=st.lists(st.tuples(*[st.tuples(*[st.floats(-60.0, 60.0)] * 3)] * 2), min_size=1, max_size=40),
)
@examples(15)
def test_law_holds_for_any_finite_samples(
    predictor: str, reference: Reference, axes: str, samples: list[tuple[Vector, Vector]]
) -> None:
    consume(force_channel(predictor=predictor, reference=reference, axes=axes), samples)


@forces
@given(seed=seeds, samples=st.lists(st.tuples(*[st.tuples(*[st.floats(-1e300, 1e300)] * 3)] * 2), max_size=30))
@examples(6)
def test_law_holds_for_extreme_samples_amid_a_contact(
    predictor: str, seed: int, samples: list[tuple[Vector, Vector]]
) -> None:
    stream = contact_stream(seed, ticks=60)
    consume(force_channel(predictor=predictor), [*stream, *samples, *stream])


@pytest.mark.parametrize(("predictor", "position"), [(name, False) for name in FORCE_PREDICTORS] + [("adaptive", True)])
def test_any_update_that_arrives_restores_the_state(predictor: str, position: bool) -> None:
    """After loss and reordering the ends agree until an update is lost again; a decoder that starts late agrees too."""
    channel = make_channel(predictor, position=position)
    encoder, decoder, random = Encoder(channel), Decoder(channel), Random(7)
    agree, delayed, compared = True, None, 0
    for tick, (force, place) in enumerate(rubbing_stream(7, ticks=1500)):
        update = encoder.encode(tick, *((place, ZERO) if position else (force, place)))
        if update is not None:
            late_starter = Decoder(channel)
            late_starter.apply(update)
            assert repr(late_starter.state) == repr(encoder.mirror.state)
            if random.random() < 0.5:
                agree, delayed = False, update
            else:
                if delayed is not None:
                    decoder.apply(delayed)
                decoder.apply(update)
                agree, delayed = True, None
        shown = decoder.value(tick, place)
        if agree:
            compared += 1
            assert shown == (encoder.predicted if update is None else encoder.mirror.value(tick, place))
            assert repr(decoder.state) == repr(encoder.mirror.state)  # an unknown position is not equal to itself
    assert compared > 300


@pytest.mark.parametrize(
    ("predictor", "position"),
    [*((name, False) for name in (*ESTIMATED, "adaptive")), ("path", True), ("adaptive", True)],
)
def test_a_reset_encoder_sends_the_same_bits_as_a_fresh_one(predictor: str, position: bool) -> None:
    channel = make_channel(predictor, position=position)
    used, fresh = Encoder(channel), Encoder(make_channel(predictor, position=position))
    for tick, (force, place) in enumerate(contact_stream(12, ticks=600)):
        used.encode(tick, place if position else force, place)
    used.reset()
    sent = 0
    for tick, (force, place) in enumerate(rubbing_stream(2, ticks=1500), 600):
        # A position channel does not read the second position.
        update = used.encode(tick, place if position else force, (float(tick), 1.0, -1e6) if position else place)
        assert update == fresh.encode(tick, place if position else force, place)
        sent += update is not None
    assert sent > 1


class AsideCandidate:
    def model(self, context: EncodeContext) -> Line:
        x, y, z = context.newest.value
        return Line((x + 3.0 * context.bound, y, z), ZERO, context.newest.tick)


class Aside(Predictor):
    """Its line begins three deadbands beside the sample."""

    name = "aside"
    estimated = True

    def candidates(self, signal: Signal) -> Sequence[Candidate]:
        return [AsideCandidate()]

    def widths(self, grid: SampleGrid) -> tuple[int, ...]:
        return (16,)

    def levels(self, model: Line, newest: Sample, grid: SampleGrid) -> list[int]:
        return [min(65_535, round((model.value[0] - newest.value[0]) / grid.value.step))]

    def build(self, fields: Sequence[int], newest: Sample, grid: SampleGrid, limits: FitLimits) -> Line:
        x, y, z = newest.value
        return Line((x + fields[0] * grid.value.step, y, z), ZERO, newest.tick)


class FittedAside(Predictor):
    """Both ends would begin aside, though no parameter is sent."""

    name = "fitted_aside"

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Line:
        x, y, z = newest.value
        return Line((x + 5.0, y, z), ZERO, newest.tick)


@pytest.mark.parametrize("deadband", [
    ForceDeadband(0.1, 0.02), ConeDeadband(0.3, 0.002, 0.02), LevelCrossingDeadband(0.3, 0.002, 0.02),
])  # fmt: skip
@pytest.mark.parametrize("predictor", [*FORCE_PREDICTORS, "aside", "fitted_aside"])
def test_no_model_begins_outside_the_deadband(
    predictor: str, deadband: Deadband, monkeypatch: pytest.MonkeyPatch
) -> None:
    for strange in (Aside(), FittedAside()):
        monkeypatch.setitem(PREDICTORS.built_in, strange.name, strange)  # type: ignore[arg-type]
        monkeypatch.setitem(PREDICTORS._loaded, strange.name, strange)
    channel, sent = force_channel(predictor=predictor, deadband=deadband), 0
    stream = rubbing_stream(3, ticks=800)
    for tick, (force, _) in zip(code(channel, stream), stream, strict=True):
        if tick.update is not None:
            sent += 1
            rounded = deadband.error(channel.value_quantizer.rounded(force), force)
            assert deadband.error(tick.displayed, force) <= max(tick.bound, rounded)
    assert sent > 5


def test_a_sensor_at_rest_sends_nothing_above_the_floor_and_every_tick_without_one() -> None:
    noise = [(0.0, 0.0, 0.004 * (-1) ** tick) for tick in range(100)]
    for floor, expected in ((0.02, 0), (0.0, 100)):
        encoder = Encoder(force_channel(predictor="zoh", floor=floor))
        assert sum(encoder.encode(tick, force) is not None for tick, force in enumerate(noise)) == expected


def test_first_position_is_sent_and_no_force_is_assumed() -> None:
    assert Encoder(position_channel()).encode(0, ZERO) is not None
    encoder = Encoder(force_channel())
    assert encoder.encode(0, ZERO) is None
    assert encoder.mirror.value(0) == ZERO


@pytest.mark.parametrize("predictor", ["hybrid", *ESTIMATED, "adaptive"])
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
def test_values_beyond_the_wire_are_saturated_and_sent_once(predictor: str) -> None:
    encoder = Encoder(force_channel(predictor=predictor))
    sends = [encoder.encode(tick, (0.0, 0.0, 1e6)) for tick in range(10)]
    assert [update is not None for update in sends] == [True] + [False] * 9
    assert sends[0] is not None
    assert sends[0].newest[:3] == (0, 0, 32_767)


def test_the_previous_sample_travels_only_where_it_is_needed() -> None:
    for predictor, second, reset, needed in [
        ("zoh", 1, False, False),
        ("linear", 1, False, True),
        ("linear", 1, True, False),
        ("linear", MAX_GAP + 1, False, False),
    ]:
        encoder = Encoder(force_channel(predictor=predictor))
        encoder.encode(0, (0.0, 0.0, 1.0))
        if reset:
            encoder.reset()
        update = encoder.encode(second, (0.0, 0.0, 2.0))
        assert update is not None
        assert (update.payload is not None) is needed


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
    counts = {
        name: sum(tick.update is not None for tick in code(force_channel(predictor=name), stream))
        for name in ("zoh", "plane", "hybrid")
    }
    assert counts["plane"] <= 3
    assert counts["hybrid"] <= 5
    assert counts["zoh"] > 100


def test_the_coding_loop_yields_what_a_daemon_would_display() -> None:
    channel, stream = force_channel(), contact_stream(5, ticks=300)
    clock = iter(range(10**6))
    ticks = list(code(channel, stream, stopwatch=lambda: float(next(clock))))
    for tick, law, (force, _) in zip(ticks, coded(channel, stream), stream, strict=True):
        assert (tick.update, tick.displayed, tick.bound) == (law.update, law.shown, law.bound)
        assert tick.error == distance(tick.displayed, force)
        assert tick.seconds == 1.0
    late = list(code(channel, stream, delay_ticks=20))
    assert [tick.update for tick in late] == [tick.update for tick in ticks]
    assert [tick.displayed for tick in late[:20]] == [ZERO] * 20


# Retuning.


def changes(count: int) -> st.SearchStrategy[dict[int, tuple[float, float, list[int]]]]:
    """Weber factor, floor and selectors, by the tick."""
    selections = st.sets(st.integers(0, count - 1), min_size=1).map(sorted)
    change = st.tuples(st.floats(0.0, 0.5), st.floats(0.0, 0.1), selections)
    return st.dictionaries(st.integers(0, 299), change, min_size=1, max_size=6)


@pytest.mark.parametrize(("predictor", "bank"), [("hybrid", FITTED), (ADAPTIVE, EVERY)])
@given(seed=seeds, data=st.data())
@examples(30)
def test_law_holds_across_changes_and_only_selected_predictors_are_chosen(
    predictor: str, bank: tuple[str, ...], seed: int, data: st.DataObject
) -> None:
    channel, retunings = force_channel(predictor=predictor, bank=bank), data.draw(changes(len(bank)))
    encoder, decoder, deadband = Encoder(channel), Decoder(channel), channel.deadband
    allowed = list(range(len(bank)))
    for tick, (force, position) in enumerate(contact_stream(seed, ticks=300)):
        if tick in retunings:
            weber, floor, allowed = retunings[tick]
            deadband = ForceDeadband(weber, floor)
            encoder.retune(deadband, allowed)
        update = encoder.encode(tick, force, position)
        if update is not None:
            decoder.apply(update)
        assert decoder.newest is None or decoder.selected in allowed
        held = decoder.value(tick, position)
        assert held is not None
        assert repr(decoder.state) == repr(encoder.mirror.state)  # an unknown position is not equal to itself
        actual = channel.value_quantizer.confine(force)
        assert distance(held, actual) <= max(encoder.bound * (1.0 + 1e-12), half_step(channel))
        assert encoder.bound == deadband.bound(actual, held, ZERO, 0.0)


def ramp(tick: int) -> Vector:
    return (0.0, 0.0, 1.0 + 0.05 * tick)


def test_a_new_bound_holds_from_the_next_sample_on() -> None:
    encoder = Encoder(force_channel(predictor="zoh", weber=0.10, floor=0.0))
    assert encoder.encode(0, (0.0, 0.0, 1.0)) is not None
    assert encoder.encode(1, (0.0, 0.0, 1.05)) is None
    encoder.retune(ForceDeadband(0.02), [0])
    assert encoder.bound == pytest.approx(0.105)
    assert encoder.encode(2, (0.0, 0.0, 1.05)) is not None
    assert encoder.bound == pytest.approx(0.021)
    encoder = Encoder(position_channel(bound=1e-2))
    encoder.encode(0, ZERO)
    assert encoder.encode(1, (0.0, 0.0, 1e-3)) is None
    encoder.retune(PositionDeadband(0.0, 1e-4), [0])
    assert encoder.encode(2, (0.0, 0.0, 1e-3)) is not None


def test_a_predictor_that_is_deselected_is_left_at_the_next_sample() -> None:
    encoder = Encoder(force_channel(bank=["zoh", "linear"]))
    for tick in range(100):
        encoder.encode(tick, ramp(tick))
    assert encoder.mirror.selected == LINEAR
    encoder.retune(ForceDeadband(0.10, 0.02), [ZOH])
    assert encoder.encode(100, (0.0, 0.0, nan)) is None
    update = encoder.encode(101, ramp(101))
    assert update is not None
    assert (update.selector, update.payload) == (ZOH, None)
    assert encoder.encode(102, ramp(102)) is None


@pytest.mark.parametrize("retunings", [[[LINEAR], [ZOH]], [[ZOH, LINEAR]], [[LINEAR, ZOH, ZOH]]])
def test_nothing_is_sent_for_a_model_that_may_stay(retunings: list[list[int]]) -> None:
    encoder = Encoder(force_channel(bank=FITTED))
    encoder.encode(0, ramp(0))
    for selectors in retunings:
        encoder.retune(ForceDeadband(0.10, 0.02), selectors)
    assert encoder.encode(1, ramp(0)) is None


def test_at_rest_nothing_is_sent_for_a_change_and_a_reset_keeps_the_tuning() -> None:
    encoder = Encoder(force_channel(bank=FITTED))
    encoder.retune(ForceDeadband(0.30, 0.5), [SPHERE, PLANE])
    for _ in range(2):
        assert encoder.encode(0, (0.0, 0.0, 0.4)) is None
        update = encoder.encode(1, ramp(0))
        assert update is not None
        assert update.selector == PLANE
        encoder.reset()


@pytest.mark.parametrize("selectors", [[], [4], [-1], [0, 9]])
def test_refuses_invalid_selectors_and_stays_as_it_was(selectors: list[int]) -> None:
    encoder, other = Encoder(force_channel(bank=FITTED)), Encoder(force_channel(bank=FITTED))
    with pytest.raises(ValueError, match="selectors"):
        encoder.retune(ForceDeadband(0.5, 5.0), selectors)
    for tick in range(50):
        assert encoder.encode(tick, ramp(tick)) == other.encode(tick, ramp(tick))


@pytest.mark.parametrize("name", EVERY)
def test_an_adaptive_choice_leaves_a_deselected_predictor_at_once(name: str) -> None:
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
