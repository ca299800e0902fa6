"""A signal followed through the codec: against the evaluation's own counts, and the choice of a moment."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from weberlink.codec import force_channel
from weberlink.codec.predictors.linear import Line
from weberlink.codec.predictors.plane import Plane
from weberlink.codec.predictors.sphere import Sphere
from weberlink.codec.predictors.zoh import Hold
from weberlink.master.trace import Trace, read_trace
from weberlink.studies.evaluate.replay import replay, signal_of
from weberlink.studies.moments.moments import Coded, Fit, Window, fits, follow, interesting_window, longest, model_at

OWN = Path(__file__).parents[3] / "configs" / "traces" / "operator.csv"
PREDICTORS = ("zoh", "linear", "plane", "sphere", "hybrid")


@cache
def own() -> Trace:
    return read_trace(OWN)


@cache
def run(predictor: str) -> Coded:
    return follow(own(), force_channel(predictor=predictor))


@cache
def fine_fits() -> list[Fit]:
    """Of a hybrid with steps fine enough for a sphere to be told from a plane."""
    return fits(own(), force_channel(position_step=2e-6))


def pressed(force: Callable[[float], float], seconds: float = 2.0) -> Trace:
    """A trace along z whose force is a function of time."""
    time = np.arange(round(1e3 * seconds)) * 1e-3
    forces = np.zeros((len(time), 3))
    forces[:, 2] = [force(t) for t in time.tolist()]
    return Trace(time, -forces / 500.0, forces, np.empty((0, 2)))


@pytest.mark.parametrize("predictor", PREDICTORS)
@pytest.mark.parametrize("weber", [0.05, 0.20])
def test_sends_and_errors_are_those_of_the_evaluation(predictor: str, weber: float) -> None:
    channel = force_channel(predictor=predictor, weber=weber)
    counted, coded = replay(signal_of(own()), channel), follow(own(), channel)
    assert coded.predictor == predictor
    assert coded.packets == len(counted.updates)
    assert np.flatnonzero(coded.sent).tolist() == [update.tick for update in counted.updates]
    assert coded.selected[coded.sent].tolist() == [update.selector for update in counted.updates]
    assert np.linalg.norm(coded.displayed_n - coded.force_n, axis=1) == pytest.approx(counted.error_n)
    assert coded.bound_n == pytest.approx(counted.bound_n)


def test_it_sends_where_the_prediction_leaves_the_deadband_and_nowhere_else() -> None:
    for predictor in PREDICTORS:
        coded = run(predictor)
        missed = np.linalg.norm(coded.predicted_n - coded.force_n, axis=1)
        assert (missed[coded.sent] > coded.bound_n[coded.sent]).all()
        assert (missed[~coded.sent] <= coded.bound_n[~coded.sent] + 1e-3).all()
        assert (coded.predicted_n[~coded.sent] == coded.displayed_n[~coded.sent]).all()
        assert np.abs(coded.displayed_n - coded.force_n)[coded.sent].max() <= 0.5e-3 + 1e-12
        assert coded.bound_n == pytest.approx(np.maximum(0.1 * np.linalg.norm(coded.force_n, axis=1), 0.02))


def test_fits_are_in_force_from_send_to_send() -> None:
    channel = force_channel()
    found, coded = fits(own(), channel), run("hybrid")
    sends = np.flatnonzero(coded.sent).tolist()
    assert [fit.newest.tick for fit in found] == sends
    assert [fit.until for fit in found] == [*sends[1:], len(coded.time_s)]
    assert [channel.bank.index(fit.predictor) for fit in found] == coded.selected[sends].tolist()
    assert {type(fit.model) for fit in found} >= {Hold, Line, Plane}
    for fit in found:
        assert fit.newest.value == pytest.approx(coded.force_n[fit.newest.tick], abs=0.5e-3 + 1e-12)
        if fit.previous is not None:
            assert fit.previous.tick < fit.newest.tick
            assert coded.sent[fit.previous.tick]
        for tick in (fit.newest.tick + 1, fit.until - 1):
            if fit.newest.tick < tick < fit.until:
                x, y, z = coded.position_m[tick].tolist()
                assert fit.model.at(tick, (x, y, z)) == pytest.approx(coded.displayed_n[tick], abs=1e-9)


def test_a_signal_that_is_never_sent_has_no_fit() -> None:
    still = np.zeros((20, 3))
    trace = Trace(np.arange(20) * 1e-3, still, still, np.empty((0, 2)))
    assert fits(trace, force_channel()) == []


def test_the_model_at_a_tick_is_that_of_its_fit() -> None:
    channel = force_channel(position_step=2e-6)
    fit = fine_fits()[3]
    assert model_at(own(), channel, fit.newest.tick) == fit
    assert model_at(own(), channel, fit.until - 1) == fit
    assert model_at(own(), channel, fit.until) == fine_fits()[4]


@pytest.mark.parametrize(
    ("tick", "message"), [(-1, "expected 0 to 6049"), (6050, "expected 0 to"), (0, "no model yet")]
)
def test_a_tick_without_a_model_is_refused(tick: int, message: str) -> None:
    with pytest.raises(ValueError, match=f"tick {tick}: .*{message}"):
        model_at(own(), force_channel(), tick)


def test_the_longest_fits_are_the_parts_of_the_scene() -> None:
    """The scene of the trace is a plane z = 0 with a dome of 25 mm about (-35, 15, -10) mm, all of 500 N/m."""
    plane, sphere = longest(fine_fits(), Plane), longest(fine_fits(), Sphere)
    assert plane is not None
    assert sphere is not None
    assert isinstance(plane.model, Plane)
    assert isinstance(sphere.model, Sphere)
    assert plane.model.normal == pytest.approx((0.0, 0.0, 1.0), abs=1e-3)
    assert plane.model.stiffness == pytest.approx(500.0, rel=0.01)
    assert sphere.model.centre == pytest.approx((-0.035, 0.015, -0.010), abs=3e-4)
    assert sphere.model.radius == pytest.approx(0.025, rel=0.02)
    assert sphere.model.stiffness == pytest.approx(500.0, rel=0.02)
    assert plane.ticks == max(fit.ticks for fit in fine_fits() if isinstance(fit.model, Plane))
    assert longest(fits(own(), force_channel(predictor="zoh")), Plane) is None


def test_the_window_is_in_contact_with_sends_where_the_force_varies_most() -> None:
    coded = run("zoh")
    window = interesting_window(coded, 0.5)
    assert window == interesting_window(coded, 0.5)
    assert window.until - window.first == 500
    drawn = slice(*window)
    force = np.linalg.norm(coded.force_n, axis=1)
    assert coded.sent[drawn].sum() >= 3
    assert (force[drawn] > 0.05 * force.max()).mean() >= 0.75
    others = [force[first : first + 500] for first in range(0, len(force) - 500, 50)]
    allowed = [other for other in others if (other > 0.05 * force.max()).mean() >= 0.75]
    assert np.ptp(force[drawn]) >= max(map(np.ptp, allowed))


def test_the_window_finds_a_known_event() -> None:
    """2 N with a step to 4 N at 1.2 s: every window across the step varies alike, the earliest is taken."""
    coded = follow(pressed(lambda t: 2.0 + 0.3 * np.sin(60.0 * t) + 2.0 * (t >= 1.2)), force_channel(predictor="zoh"))
    window = interesting_window(coded, 0.4)
    assert window.first < 1200 < window.until


def test_a_great_change_with_hardly_a_send_is_not_shown() -> None:
    """A second of wobble, then growth that extrapolation follows, though the force varies most at its end."""
    coded = follow(
        pressed(lambda t: 2.0 + 0.5 * np.sin(60.0 * t) if t < 1.0 else 2.0 * np.exp(t - 1.0), 3.0),
        force_channel(predictor="linear"),
    )
    assert coded.sent[2600:].sum() < 3
    window = interesting_window(coded, 0.4)
    assert coded.sent[slice(*window)].sum() >= 3
    assert window.first < 1000


def test_the_window_without_contact_or_sends_is_that_with_most_sends() -> None:
    one_push = follow(pressed(lambda t: 3.0 * (1.0 <= t < 1.05)), force_channel(predictor="zoh"))
    window = interesting_window(one_push, 0.5)
    assert one_push.sent[slice(*window)].sum() == one_push.packets == 2
    nothing = follow(pressed(lambda t: 0.0), force_channel())
    assert nothing.packets == 0
    assert interesting_window(nothing, 0.5) == Window(0, 500)


def test_a_window_longer_than_the_run_is_the_run() -> None:
    assert interesting_window(run("zoh"), 100.0) == Window(0, len(own().time_s))


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan")])
def test_a_window_has_a_length(seconds: float) -> None:
    with pytest.raises(ValueError, match="seconds: expected more than 0"):
        interesting_window(run("zoh"), seconds)


def test_a_channel_of_one_axis_displays_nothing_on_the_others() -> None:
    channel = force_channel(axes="z", predictor="plane")
    coded = follow(pressed(lambda t: 4.0 * t), channel)
    assert 0 < coded.packets < 10
    assert (coded.displayed_n[:, :2] == 0.0).all()
