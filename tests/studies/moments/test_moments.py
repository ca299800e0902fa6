"""A signal through the codec tick by tick: against the replay of the evaluation, and the choice of a window."""

from functools import cache

import numpy as np
import pytest

from tests.studies.moments.shipped import own, pressed, run
from weberlink.codec import force_channel
from weberlink.codec.predictors.model import Hold, Line, ModelKind
from weberlink.codec.predictors.plane import Plane
from weberlink.master.trace import Trace
from weberlink.studies.evaluate.replay import replay, signal_of
from weberlink.studies.moments.moments import CodedTrace, TickWindow, interesting_window, longest

PREDICTORS = ("zoh", "linear", "plane", "sphere", "hybrid")


@cache
def fine() -> CodedTrace:
    """A hybrid with a position step fine enough to tell a sphere from a plane."""
    return CodedTrace(own(), force_channel(position_step=2e-6))


@pytest.mark.parametrize("predictor", PREDICTORS)
def test_ticks_are_those_of_the_replay(predictor: str) -> None:
    counted, coded = replay(signal_of(own()), force_channel(predictor=predictor)), run(predictor)
    assert coded.predictor == predictor
    assert coded.sent.sum() == len(counted.updates)
    assert np.flatnonzero(coded.sent).tolist() == [update.tick for update in counted.updates]
    assert coded.selected[coded.sent].tolist() == [update.selector for update in counted.updates]
    assert np.linalg.norm(coded.displayed_n - coded.trace.force_n, axis=1) == pytest.approx(counted.error_n)
    assert coded.bound_n == pytest.approx(counted.bound_n)


@pytest.mark.parametrize("predictor", PREDICTORS)
def test_it_sends_exactly_where_the_prediction_leaves_the_deadband(predictor: str) -> None:
    coded = run(predictor)
    missed = np.linalg.norm(coded.predicted_n - coded.trace.force_n, axis=1)
    assert (missed[coded.sent] > coded.bound_n[coded.sent]).all()
    assert (missed[~coded.sent] <= coded.bound_n[~coded.sent] + 1e-3).all()
    assert (coded.predicted_n[~coded.sent] == coded.displayed_n[~coded.sent]).all()
    assert np.abs(coded.displayed_n - coded.trace.force_n)[coded.sent].max() <= 0.5e-3 + 1e-12
    assert coded.bound_n == pytest.approx(np.maximum(0.1 * np.linalg.norm(coded.trace.force_n, axis=1), 0.02))


def test_fits_are_in_use_from_send_to_send() -> None:
    channel = force_channel()
    found, coded = CodedTrace(own(), channel).fits, run("hybrid")
    sends = np.flatnonzero(coded.sent).tolist()
    assert [fit.newest.tick for fit in found] == sends
    assert [fit.until for fit in found] == [*sends[1:], len(coded.trace.time_s)]
    assert [channel.bank.index(fit.predictor) for fit in found] == coded.selected[sends].tolist()
    assert {type(fit.model) for fit in found} >= {Hold, Line, Plane}
    for fit in found:
        assert fit.newest.value == pytest.approx(coded.trace.force_n[fit.newest.tick], abs=0.5e-3 + 1e-12)
        if fit.previous is not None:
            assert fit.previous.tick < fit.newest.tick
            assert coded.sent[fit.previous.tick]
        for tick in (fit.newest.tick + 1, fit.until - 1):
            if fit.newest.tick < tick < fit.until:
                x, y, z = coded.trace.position_m[tick].tolist()
                assert fit.model.at(tick, (x, y, z)) == pytest.approx(coded.displayed_n[tick], abs=1e-9)


def test_a_signal_that_is_never_sent_has_no_fit() -> None:
    still = np.zeros((20, 3))
    assert CodedTrace(Trace(np.arange(20) * 1e-3, still, still, np.empty((0, 2))), force_channel()).fits == []


def test_the_model_at_a_tick_is_that_of_its_fit() -> None:
    fit = fine().fits[3]
    for tick, expected in ((fit.newest.tick, fit), (fit.until - 1, fit), (fit.until, fine().fits[4])):
        assert fine().fit_at(tick) == expected
    for tick, message in ((-1, "expected 0 to 6049"), (6050, "expected 0 to"), (0, "no model yet")):
        with pytest.raises(ValueError, match=f"tick {tick}: .*{message}"):
            fine().fit_at(tick)


def test_the_longest_fits_are_the_parts_of_the_scene() -> None:
    """The scene is a plane z = 0 with a dome of 25 mm about (-35, 15, -10) mm, all of 500 N/m."""
    plane, sphere = (longest(fine().fits, kind) for kind in (ModelKind.PLANE, ModelKind.SPHERE))
    assert plane is not None
    assert sphere is not None
    flat, dome = plane.surface, sphere.surface
    assert flat is not None
    assert dome is not None
    assert flat.nearest((0.0, 0.0, 0.0)).normal == pytest.approx((0.0, 0.0, 1.0), abs=1e-3)
    assert flat.stiffness == pytest.approx(500.0, rel=0.01)
    assert dome.centre == pytest.approx((-0.035, 0.015, -0.010), abs=3e-4)
    assert dome.radius == pytest.approx(0.025, rel=0.02)
    assert dome.stiffness == pytest.approx(500.0, rel=0.02)
    assert longest(fine().fits) in (plane, sphere)
    assert longest(CodedTrace(own(), force_channel(predictor="zoh")).fits) is None


# --- the window


def test_the_window_has_contact_sends_and_most_variation() -> None:
    coded = run("zoh")
    window = interesting_window(coded, 0.5)
    assert window.until - window.first == 500
    drawn = slice(*window)
    force = np.linalg.norm(coded.trace.force_n, axis=1)
    assert coded.sent[drawn].sum() >= 3
    assert (force[drawn] > 0.05 * force.max()).mean() >= 0.75
    others = [force[first : first + 500] for first in range(0, len(force) - 500, 50)]
    allowed = [other for other in others if (other > 0.05 * force.max()).mean() >= 0.75]
    assert np.ptp(force[drawn]) >= max(map(np.ptp, allowed))


def test_the_window_finds_a_step() -> None:
    step = pressed(lambda t: 2.0 + 0.3 * float(np.sin(60.0 * t)) + 2.0 * (t >= 1.2))
    coded = CodedTrace(step, force_channel(predictor="zoh"))
    window = interesting_window(coded, 0.4)
    assert window.first < 1200 < window.until


def test_a_great_change_with_few_sends_is_not_shown() -> None:
    """A second of wobble, then growth that extrapolation follows."""

    def wobble(t: float) -> float:
        return float(2.0 + 0.5 * np.sin(60.0 * t) if t < 1.0 else 2.0 * np.exp(t - 1.0))

    coded = CodedTrace(pressed(wobble, 3.0), force_channel(predictor="linear"))
    assert coded.sent[2600:].sum() < 3
    window = interesting_window(coded, 0.4)
    assert coded.sent[slice(*window)].sum() >= 3
    assert window.first < 1000


def test_without_contact_the_window_has_most_sends() -> None:
    one_push = CodedTrace(pressed(lambda t: 3.0 * (1.0 <= t < 1.05)), force_channel(predictor="zoh"))
    window = interesting_window(one_push, 0.5)
    assert one_push.sent[slice(*window)].sum() == one_push.sent.sum() == 2
    nothing = CodedTrace(pressed(lambda t: 0.0), force_channel())
    assert nothing.sent.sum() == 0
    assert interesting_window(nothing, 0.5) == TickWindow(0, 500)


def test_the_length_of_a_window() -> None:
    assert interesting_window(run("zoh"), 100.0) == TickWindow(0, len(own().time_s))
    for seconds in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="seconds: expected more than 0"):
            interesting_window(run("zoh"), seconds)


def test_a_channel_of_one_axis_displays_nothing_on_the_others() -> None:
    coded = CodedTrace(pressed(lambda t: 4.0 * t), force_channel(axes="z", predictor="plane"))
    assert 0 < coded.sent.sum() < 10
    assert (coded.displayed_n[:, :2] == 0.0).all()
