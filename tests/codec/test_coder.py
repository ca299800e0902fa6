"""Encoder and decoder in special cases; the law of both is in test_contract."""

from collections.abc import Sequence
from math import inf

import pytest

from tests.codec.law import AXIS_BOUNDS, FITTED, POSITION_PREDICTORS, coded, make_channel, shaped
from tests.codec.signals import contact_stream, rubbing_stream, up
from weberlink.codec import Channel, Decoder, Encoder, Update, force_channel, position_channel
from weberlink.codec.channel import joint_channel
from weberlink.codec.choice import CHOICES, NOTHING, Ahead, Choice, DueSample, Hybrid
from weberlink.codec.deadband import DEADBANDS, ForceDeadband
from weberlink.codec.predictors import PREDICTORS, EstimatedPredictor, FitLimits, FittedPredictor, Model, Predictor
from weberlink.codec.predictors.contract import UNFITTED, ModelKind
from weberlink.codec.predictors.signal_based import Line
from weberlink.codec.replay import code
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.geometry.vector import ZERO, Vector
from weberlink.protocol.wire import UpdateLayout
from weberlink.update import ModelParameters, PreviousSample


class Asides(Choice):
    """Its models are lines that begin beside the sample, in every other tick outside the deadband."""

    name = "asides"

    @classmethod
    def bank(cls, signal: str) -> tuple[str, ...]:
        return ("aside",)

    @classmethod
    def takes(cls, predictor: Predictor) -> bool:
        return True

    def reset(self) -> None:
        """Nothing is remembered."""

    def choose(self, selectors: Sequence[int], due: DueSample) -> tuple[int, Line]:
        (x, y, z), tick = due.newest.value, due.newest.tick
        return 0, Line((x + (0.5 if tick % 2 else 3.0) * due.bound, y, z), ZERO, tick)


class Aside(EstimatedPredictor):
    """The distance from the sample travels."""

    name = "aside"
    choice = "asides"

    def packed(self, model: Line, newest: Sample, grid: SampleGrid) -> ModelParameters:
        return ModelParameters(min(65_535, round((model.value[0] - newest.value[0]) / grid.value.step)).to_bytes(2))

    def unpacked(self, data: bytes, newest: Sample, grid: SampleGrid, limits: FitLimits) -> Line:
        x, y, z = newest.value
        return Line((x + int.from_bytes(data) * grid.value.step, y, z), ZERO, newest.tick)


class FittedAside(FittedPredictor):
    """Both ends would begin aside, though no parameter is sent."""

    name = "fitted_aside"

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Line:
        x, y, z = newest.value
        return Line((x + 5.0, y, z), ZERO, newest.tick)


@pytest.mark.parametrize(("shape", "smoothing"), [("isotropic", 10), *((shape, 0) for shape in DEADBANDS)])
@pytest.mark.parametrize("predictor", ["aside", "fitted_aside"])
def test_no_model_begins_outside_the_deadband(
    predictor: str, shape: str, smoothing: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And one that would leaves no trace in the mirror: the decoder never hears of it."""
    for strange in (Aside(), FittedAside()):
        monkeypatch.setitem(PREDICTORS.built_in, strange.name, strange)  # type: ignore[arg-type]
        monkeypatch.setitem(PREDICTORS._loaded, strange.name, strange)
    monkeypatch.setitem(CHOICES.built_in, Asides.name, Asides)  # type: ignore[arg-type]
    deadband = shaped(shape, 0.1 if smoothing else 0.3, 0.002)
    channel = make_channel(predictor, deadband=deadband, smoothing=smoothing)
    updates = [tick.update for tick in coded(channel, rubbing_stream(5, ticks=800)) if tick.update is not None]
    assert len(updates) > 5
    if predictor == "aside":
        assert {update.payload is None for update in updates} == {True, False}


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


def test_the_coding_loop_yields_what_a_daemon_would_display() -> None:
    channel, stream = force_channel(), contact_stream(5, ticks=300)
    clock = iter(range(10**6))
    laws = list(coded(channel, stream))
    for stopwatch, seconds in ((lambda: float(next(clock)), [1.0] * 300), (None, [])):
        found = code(channel, stream, stopwatch=stopwatch)
        assert found.updates == [law.update for law in laws]
        assert found.displayed == [law.shown for law in laws]
        assert found.bounds == [law.bound for law in laws]
        assert found.seconds == seconds


def test_a_deadband_finer_than_the_wire_does_not_hold_a_model() -> None:
    encoder = Encoder(force_channel(predictor="linear", weber=0.0, floor=0.0))
    updates = [encoder.encode(tick, (0.0, 0.0, 0.0004 + 0.1 * tick)) for tick in (1, 2)]
    assert [update is not None and update.payload is not None for update in updates] == [False, True]


# The values of a decoder between updates.


def test_before_the_first_update_a_force_is_zero_and_a_position_unknown() -> None:
    assert Decoder(force_channel()).value(5.5) == ZERO
    assert Encoder(force_channel()).coded == Encoder(position_channel()).coded == ZERO
    decoder = Decoder(position_channel())
    assert (decoder.value(5.5), decoder.model, decoder.record) == (None, None, UNFITTED)


def test_at_the_tick_of_a_sample_the_value_is_the_sample_even_on_a_stiff_model() -> None:
    decoder = Decoder(force_channel(predictor="plane"))
    decoder.apply(Update(10, 0, (0, 0, 2000, 0, 0, -4), PreviousSample(5, (0, 0, 1000, 0, 0, -3))))
    assert decoder.value(10, (0.0, 0.0, -0.000044)) == (0.0, 0.0, 2.0)
    assert decoder.value(10.5, (0.0, 0.0, -0.000044)) == pytest.approx((0.0, 0.0, 2.4))
    assert decoder.model is not None and decoder.model.surface() == decoder.model
    assert decoder.record.kind is ModelKind.PLANE


def test_extrapolation_without_end_is_confined_to_the_wire() -> None:
    decoder = Decoder(force_channel(predictor="linear"))
    decoder.apply(Update(1, 0, (0, 0, 2000), PreviousSample(1, (0, 0, 1000))))
    assert decoder.value(1e6) == pytest.approx((0.0, 0.0, 32.767))
    assert decoder.value(inf) == (0.0, 0.0, 2.0)
    assert decoder.model is not None and decoder.model.surface() is None
    assert decoder.record.kind is ModelKind.LINE


class Wearing(Model):
    """One newton more each time that it is asked."""

    memory = 0.0

    def at(self, tick: float, position: Vector) -> Vector:
        return ZERO

    def advance(self, tick: float, position: Vector, memory: float) -> tuple[Vector, float]:
        return up(memory + 1.0), memory + 1.0


class Worn(FittedPredictor):
    name = "worn"

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Wearing:
        return Wearing()


def test_a_memory_survives_a_repeat_of_its_update_and_ends_with_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    for table in (PREDICTORS.built_in, PREDICTORS._loaded):
        monkeypatch.setitem(table, "worn", Worn())  # type: ignore[arg-type]
    decoder, update = Decoder(force_channel(predictor="worn")), Update(10, 0, (0, 0, 500))
    decoder.apply(update)
    shown = [decoder.value(10), decoder.value(11), decoder.value(12)]
    decoder.apply(update)
    shown.append(decoder.value(13))
    decoder.apply(Update(20, 0, (0, 0, 500)))
    assert [*shown, decoder.value(21)] == [up(0.5), up(1.0), up(2.0), up(3.0), up(1.0)]


# Smooth updates: a ramp within the deadband instead of a step.


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


# Look-ahead: the use of the future, and no sample lost or decided twice.


@pytest.mark.parametrize("predictor", (*FITTED, "hybrid"))
def test_without_a_known_future_the_decisions_are_those_of_the_causal_encoder(predictor: str) -> None:
    check_that_only_the_delay_is_left(predictor)


def check_that_only_the_delay_is_left(predictor: str) -> None:
    """Every second tick is missing, so that no sample has a known successor."""
    stream = contact_stream(11, ticks=1000)
    causal = Encoder(force_channel(predictor=predictor))
    late = Encoder(make_channel(predictor, lookahead=2))
    expected, found = [], []
    for index, (force, position) in enumerate(stream):
        expected.append(causal.encode(2 * index, force, position))
        found.append(late.encode(2 * index, force, position))
    assert found[0] is None
    assert found[1:] == expected[:-1]
    assert sum(update is not None for update in expected) > 5


def test_ticks_that_begin_anew_drop_the_samples_that_wait() -> None:
    encoder = Encoder(make_channel("zoh", weber=0.0, floor=0.0, lookahead=2))
    updates = [encoder.encode(tick, up(float(tick))) for tick in (7, 8, 3, 4, 5, 6)]
    assert [update and update.tick for update in updates] == [None, None, None, None, 3, 4]


def test_of_a_known_future_the_hybrid_takes_the_predictor_that_lasts_longest() -> None:
    first, second = Sample(0, up(1.0), ZERO), Sample(10, up(2.0), ZERO)
    for expected, slope in ((0, 0.0), (1, 0.1)):
        hybrid = Hybrid(make_channel("hybrid", bank=["zoh", "linear"], lookahead=3))
        future = Ahead(tuple(up(2.0 + slope * step) for step in (1, 2, 3)), (ZERO,) * 3, (0.05,) * 3)
        hybrid.choose((0, 1), DueSample(first, None, first.value, ZERO, 0.1, NOTHING, 0, None))
        assert hybrid.choose((0, 1), DueSample(second, first, second.value, ZERO, 0.1, future, 0, None))[0] == expected


@pytest.mark.parametrize(("earlier", "expected"), [(Sample(0, up(1.0), ZERO), 1), (None, 0)])
def test_the_hybrid_fits_what_the_other_end_fitted(earlier: Sample | None, expected: int) -> None:
    """Without the sample before the newest, where that was too old to travel: the line is held, as by the first."""
    hybrid = Hybrid(make_channel("hybrid", bank=["zoh", "linear"]))
    samples = [(Sample(0, up(1.0), ZERO), None), (Sample(10, up(2.0), ZERO), earlier)]
    samples.append((Sample(20, up(3.0), ZERO), samples[1][0]))
    chosen = [
        hybrid.choose((0, 1), DueSample(newest, before, newest.value, ZERO, 0.1, NOTHING, 0, None))[0]
        for newest, before in samples
    ]
    assert chosen == [0, 0, expected]


# Joints: one decision for axes of different thresholds.


STEP = 1e-3


def channel_of(axes: int, predictor: str = "linear") -> Channel:
    return joint_channel(predictor=predictor, bounds=AXIS_BOUNDS[:axes], step=STEP)


@pytest.mark.parametrize(("axes", "groups"), [(1, (1,)), (3, (3,)), (4, (3, 1)), (7, (3, 3, 1))])
def test_the_wire_carries_only_axes_that_exist(axes: int, groups: tuple[int, ...]) -> None:
    channel = channel_of(axes)
    assert channel.forms[0].newest == channel.forms[0].previous == groups
    update = Encoder(channel).encode(0, (0.1,) * axes)
    assert update == Update(0, 0, (100,) * axes)
    shortest, longest = UpdateLayout(channel.forms).lengths
    assert shortest <= UpdateLayout(channel.forms).length(update) <= longest
    decoder = Decoder(channel)
    assert (decoder.joints(5), decoder.newest) == (None, None)
    for wrong in (Update(0, 0, (0,) * (axes + 1)), Update(0, 0, (0,) * axes, PreviousSample(1, (0,) * (axes + 1)))):
        with pytest.raises(ValueError, match="levels"):
            decoder.apply(wrong)


def test_rest_is_displayed_and_not_sent() -> None:
    rest = (0.5, 0.0, 0.0, -0.25)
    channel = joint_channel(bounds=(0.1, 0.1, 0.1, 0.1), step=STEP, rest=rest)
    encoder, decoder = Encoder(channel), Decoder(channel)
    assert encoder.coded == rest
    assert encoder.encode(0, (0.55, 0.0, -0.05, -0.16)) is None
    assert decoder.joints(0) == encoder.held == rest
    assert encoder.encode(1, (0.5, 0.0, 0.0, 0.0)) is not None


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="rest has 2 axes"):
        joint_channel(bounds=(0.1,) * 4, step=STEP, rest=(0.0, 0.0))
    for predictor in ("plane", "path", "hybrid", "nothing"):
        with pytest.raises(ValueError, match=predictor):
            channel_of(4, predictor)
    encoder = Encoder(channel_of(4))
    with pytest.raises(ValueError, match="3 axes, expected 4"):
        encoder.encode(0, (0.0, 0.0, 0.0))
