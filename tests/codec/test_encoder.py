"""The encoder in special cases; its law is in test_contract."""

from collections.abc import Sequence

import pytest

from tests.codec.law import coded, make_channel, shaped
from tests.codec.signals import contact_stream, rubbing_stream
from weberlink.codec import Encoder, force_channel
from weberlink.codec.choice import CHOICES, Choice, DueSample
from weberlink.codec.deadband import DEADBANDS
from weberlink.codec.predictors import PREDICTORS, EstimatedPredictor, FitLimits, FittedPredictor, Predictor
from weberlink.codec.predictors.signal_based import Line
from weberlink.codec.replay import code
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.geometry.vector import ZERO
from weberlink.update import ModelParameters


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
    updates = [tick.update for tick in coded(channel, rubbing_stream(3, ticks=800)) if tick.update is not None]
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
