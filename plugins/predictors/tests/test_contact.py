"""Estimates of a contact with known parameters, with sensor noise (2 mN) on every axis.

The tolerances are the measured errors, rounded up. Noise in the force makes a contact look stiffer, most of all a soft
one: at 200 N/m the force changes by only 20 mN over some ticks.
"""

from functools import cache
from math import cos, pi, sin

import pytest

from plugins.predictors.tests.signals import GodObject, contact
from tests.codec.signals import Stream, stroke
from weberlink.codec import force_channel
from weberlink.codec.predictors import FitLimits
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, add, distance, dot, norm, scale, unit
from weberlink_predictors.contact import ContactEstimator
from weberlink_predictors.estimation import EncodeContext, History, Signal
from weberlink_predictors.surface import (
    DampedHypothesis,
    FrictionalHypothesis,
    FrictionlessHypothesis,
    MovingHypothesis,
    SurfacePatch,
)

NORMAL = unit((0.3, -0.2, 0.93))
MU = 0.3
AMPLITUDE, FREQUENCY = 0.016, 2.0 * pi * 1e-3
Kind = type[FrictionlessHypothesis] | type[FrictionalHypothesis] | type[MovingHypothesis]
KINDS: list[Kind] = [FrictionlessHypothesis, FrictionalHypothesis, MovingHypothesis]


def signal(limits: FitLimits | None = None) -> Signal:
    return Signal(force_channel().grid, limits or FitLimits(), 0.04)


def follow(
    stream: Stream, found: ContactEstimator | None = None, *, skip: tuple[int, ...] = (), history: History | None = None
) -> ContactEstimator:
    history = History(1e-3) if history is None else history  # an empty one is false
    found = found or ContactEstimator(signal())
    for tick, (force, position) in enumerate(stream):
        if tick not in skip:
            history.add(tick, force, position, 0.1)
            found.follow(history)
    return found


def swinging(stiffness: float, amplitude: float, hz: float = 1.0, ticks: int = 4000) -> Stream:
    """On a flat surface that swings, with a hand that nearly goes along."""

    def lift(t: float) -> float:
        return amplitude * sin(2.0 * pi * hz * t)

    def path(t: float) -> Vector:
        a, b, height = stroke(t)
        return a, b, height + 0.9 * lift(t)

    return contact(GodObject(stiffness), ticks=ticks, path=path, lift=lift)


@cache
def touched(stiffness: float, curvature: float = 0.0, friction: float = 0.0) -> ContactEstimator:
    return follow(contact(GodObject(stiffness, curvature, friction), ticks=3000))


@pytest.mark.parametrize(("stiffness", "off", "off_if_frictional"), [(200.0, 0.07, 0.18), (1500.0, 0.01, 0.02)])
@pytest.mark.parametrize("curvature", [0.0, 20.0, -20.0])
def test_stiffness_and_curvature(stiffness: float, off: float, off_if_frictional: float, curvature: float) -> None:
    smooth, rough = touched(stiffness, curvature), touched(stiffness, curvature, MU)
    assert 1.0 / smooth.frictionless.compliance == pytest.approx(stiffness, rel=off)
    assert 1.0 / smooth.frictional.compliance == pytest.approx(stiffness, rel=off_if_frictional)
    assert 1.0 / rough.frictional.compliance == pytest.approx(stiffness, rel=off_if_frictional)
    if curvature != 0.0:
        assert smooth.curvature.value == pytest.approx(curvature, rel=0.08)
        bent = 0.15 if stiffness > 200.0 else 0.25
        assert rough.frictional_curvature.value == pytest.approx(curvature, rel=bent)
    elif stiffness > 200.0:
        for found in (smooth, rough):
            assert abs(found.curvature.value) < 1.5
            assert abs(found.frictional_curvature.value) < 1.5


@pytest.mark.parametrize(("curvature", "off"), [(0.0, 0.01), (20.0, 0.045), (-20.0, 0.05)])
def test_friction(curvature: float, off: float) -> None:
    """On a curved surface the averaged normal lags behind, by about two degrees."""
    found = touched(1500.0, curvature, MU)
    assert found.friction == pytest.approx(MU, abs=off)
    assert curvature != 0.0 or dot(found.normal, NORMAL) > 0.9995
    assert touched(1500.0, curvature).friction < 0.03


def test_a_press_that_sticks_gives_a_lower_bound_of_the_friction() -> None:
    """The tangential force reaches a fifth of the normal force without sliding."""
    found = follow([((0.2 * sin(0.01 * tick), 0.0, 1.0), (0.0, 0.0, -2e-3)) for tick in range(1000)])
    assert found.normal == (0.0, 0.0, 1.0)
    assert found.friction == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize(("amplitude", "hz", "off"), [(0.016, 1.0, 1e-3), (0.005, 1.0, 1e-3), (0.004, 1.6, 5e-3)])
def test_stiffness_and_frequency_of_a_moving_surface(amplitude: float, hz: float, off: float) -> None:
    """0.016 m at 1 Hz is 0.1 m/s. A soft surface is left out: its third differences are mostly noise."""
    found = follow(swinging(1000.0, amplitude, hz))
    assert found.frequency.value == pytest.approx(2.0 * pi * hz * 1e-3, rel=off)
    if hz == 1.0:
        assert 1.0 / found.moving.compliance == pytest.approx(1000.0, rel=0.05)
        # The hypothesis of a surface at rest takes the motion for compliance.
        assert abs(found.frictionless.compliance * 1000.0 - 1.0) > 0.3


# When a contact is one.


def press(force: float) -> tuple[Vector, Vector]:
    return (0.0, 0.0, force), (0.0, 0.0, -force / 500.0)


def test_a_contact_is_a_force_beyond_the_threshold() -> None:
    found = ContactEstimator(signal())
    assert follow([press(0.04)] * 5, found).age == 0
    assert follow([press(0.041)] * 5, found).age == 5
    assert follow([press(0.0)], found).age == 0
    assert found.normal == (0.0, 0.0, 1.0)
    for skip in ((7,), (7, 8, 9), (3, 7)):  # after a gap it is as old as the record
        assert follow([press(1.0)] * 20, skip=skip).age == 20 - 1 - max(skip)


def test_what_was_learned_outlasts_the_contact_and_the_normal_only_a_similar_one() -> None:
    found = follow(contact(GodObject(500.0, 0.0, MU), ticks=2000))
    before = found.frictional.compliance, found.friction, found.normal
    follow([(ZERO, ZERO)] * 30, found)
    assert (found.frictional.compliance, found.friction, found.normal) == before
    follow([(unit((NORMAL[0] + 0.3, NORMAL[1], NORMAL[2])), ZERO)], found)
    assert found.normal == before[2]
    follow([(ZERO, ZERO), ((1.0, 0.0, 0.0), ZERO)], found)
    assert found.normal == (1.0, 0.0, 0.0)


def test_nothing_is_compared_across_a_gap_of_ticks() -> None:
    """The hand moved during the gap: taken for the motion of one tick, the jump would give a wrong compliance."""
    one = contact(GodObject(500.0), ticks=600)
    stream = [*one, *((f, (p[0] + 0.1, p[1] - 0.2, p[2] + 0.3)) for f, p in one)]
    found, continuous = follow([*stream[:600], stream[0], *stream[600:]], skip=(600,)), follow(stream)
    assert 1.0 / found.frictionless.compliance == pytest.approx(500.0, rel=0.05)
    assert continuous.frictionless.compliance == 0.0 or 1.0 / continuous.frictionless.compliance < 100.0


# The surfaces that the hypotheses make.


@cache
def stream_for(kind: Kind) -> Stream:
    """A contact for which the hypothesis is true."""
    if kind is MovingHypothesis:
        return swinging(800.0, AMPLITUDE, ticks=3100)
    return contact(GodObject(800.0, *((20.0,) if kind is FrictionlessHypothesis else (0.0, 0.3))), ticks=3100)


def model_at_end(samples: Stream, kind: Kind, limits: FitLimits | None = None) -> SurfacePatch | None:
    """What the hypothesis makes of the last sample."""
    of, history = signal(limits), History(1e-3)
    follow(samples, of.estimator(ContactEstimator), history=history)
    return kind(of).model(EncodeContext(Sample(len(samples) - 1, *samples[-1]), None, 0.1, history))


@pytest.mark.parametrize(("kind", "allowed"), [*zip(KINDS, (0.1, 0.1, 0.25), strict=True)])
def test_a_surface_passes_through_its_sample_and_predicts_the_next_tenth_of_a_second(
    kind: Kind, allowed: float
) -> None:
    """Within the error allowed, as a share of the force, and within 0.6 of the error of a hold."""
    samples, now = stream_for(kind), 3000
    model = model_at_end(samples[: now + 1], kind)
    assert model is not None
    force, position = samples[now]
    assert model.tick == now
    assert model.point == pytest.approx(add(position, scale(force, 1.0 / model.stiffness)))
    assert norm(model.normal) == pytest.approx(1.0)
    if kind is not FrictionalHypothesis:
        assert model.normal == pytest.approx(unit(force))
        assert (model.friction, model.memory) == (0.0, None)
        assert model.at(now, position) == pytest.approx(force, abs=1e-6)
    memory, worst, hold = model.memory, 0.0, 0.0
    for tick in range(now + 1, now + 100):
        later, position = samples[tick]
        if memory is None:
            predicted = model.at(tick, position)
        else:
            predicted, memory = model.advance(tick, position, memory)
        worst = max(worst, distance(predicted, later) / norm(later))
        hold = max(hold, distance(force, later) / norm(later))
    assert worst < allowed
    assert worst < 0.6 * hold


def test_each_hypothesis_recovers_its_own_parameters() -> None:
    curved, frictional, moving = (model_at_end(stream_for(kind)[:3001], kind) for kind in KINDS)
    assert curved is not None
    assert frictional is not None
    assert moving is not None
    assert curved.curvature == pytest.approx(20.0, rel=0.1)
    assert (curved.velocity, curved.acceleration, curved.frequency) == (0.0, 0.0, 0.0)
    assert frictional.friction == pytest.approx(0.3, abs=0.02)
    assert dot(frictional.normal, NORMAL) > 0.999
    assert moving.frequency == pytest.approx(FREQUENCY, rel=2e-3)
    assert moving.velocity == pytest.approx(AMPLITUDE * FREQUENCY * cos(2.0 * pi * 3.0), rel=0.05)
    assert moving.acceleration == pytest.approx(0.0, abs=0.2 * AMPLITUDE * FREQUENCY**2)


@pytest.mark.parametrize(("stiffness", "damping", "off"), [(500.0, 1e3, 0.02), (500.0, 3e3, 0.02), (2e3, 3e3, 0.01)])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_damping_is_told_from_stiffness(stiffness: float, damping: float, off: float, friction: float) -> None:
    """On a position that moves in steps, as a decoded one does; the model then predicts the steps of the force."""
    samples: Stream = []
    before, offset = 0.0, 0.0
    for tick, (force, position) in enumerate(contact(GodObject(stiffness, 0.0, friction), ticks=3100)):
        if tick % 7 == 0:
            offset = 5e-5 * sin(tick)
        # The push of the step, and of the rate, along the normal.
        height = dot(NORMAL, position) + offset
        push = -stiffness * offset - (damping * (height - before) if tick else 0.0)
        before = height
        samples.append((add(force, scale(NORMAL, push)), add(position, scale(NORMAL, offset))))
    now = next(tick for tick in range(3000, 3100) if tick % 7 == 3)
    model = model_at_end(samples[: now + 1], DampedHypothesis)
    assert model is not None
    assert model.stiffness == pytest.approx(stiffness, rel=off)
    assert model.damping == pytest.approx(damping, rel=off)
    memory = model.memory
    for tick in range(now + 1, now + 30):
        predicted, memory = model.advance(tick, samples[tick][1], memory)
        assert distance(predicted, samples[tick][0]) < 0.1 * norm(samples[tick][0]) + 0.03


@pytest.mark.parametrize("kind", KINDS)
def test_there_is_no_surface_without_a_settled_contact_within_the_limits(kind: Kind) -> None:
    samples = stream_for(kind)[:3001]
    assert model_at_end([(ZERO, ZERO)] * 50, kind) is None
    assert model_at_end(samples[:3], kind) is None
    assert model_at_end([*samples[:3000], (ZERO, ZERO)], kind) is None
    assert model_at_end(samples, kind, FitLimits(stiffness=(1e4, 1e5))) is None
    # Below 0.03 a coefficient of friction is noise.
    assert model_at_end(contact(GodObject(1500.0), ticks=1500), FrictionalHypothesis) is None
