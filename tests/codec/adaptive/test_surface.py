"""The surfaces that are made of what is known: each with its supposition, and none before its time."""

from functools import cache
from math import cos, pi, sin

import pytest

from tests.codec.contacts import GodObject, contact, stroke, turned
from tests.codec.signals import Stream
from weberlink.codec.adaptive.candidate import Occasion
from weberlink.codec.adaptive.contact import Contact
from weberlink.codec.adaptive.history import History
from weberlink.codec.adaptive.surface import Moving, Rough, Smooth
from weberlink.codec.predictors import Trust
from weberlink.codec.predictors.surface import Surface
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, add, distance, dot, norm, scale, unit

NORMAL = unit((0.3, -0.2, 0.93))
Kind = type[Smooth] | type[Rough] | type[Moving]
KINDS: list[Kind] = [Smooth, Rough, Moving]
AMPLITUDE, PULSE = 0.016, 2.0 * pi * 1e-3


def lift(t: float) -> float:
    return AMPLITUDE * sin(2.0 * pi * t)


def stream(kind: Kind) -> Stream:
    """What each is for."""
    return _made(kind.__name__)


@cache
def _made(name: str) -> Stream:
    if name == "Smooth":
        return contact(GodObject(800.0, 20.0), ticks=3100)
    if name == "Rough":
        return contact(GodObject(800.0, 0.0, 0.3), ticks=3100)

    def path(t: float) -> Vector:
        a, b, height = stroke(t)
        return a, b, height + 0.9 * lift(t)

    return contact(GodObject(800.0), ticks=3100, path=path, lift=lift)


def at_end(samples: Stream) -> tuple[Contact, Occasion]:
    """What is known when the last sample is to be sent."""
    history, found = History(), Contact(0.04)
    for tick, (force, position) in enumerate(samples):
        found.follow(history, history.add(tick, force, position))
    return found, Occasion(Sample(len(samples) - 1, *samples[-1]), None, 0.1, history)


def model_at_end(samples: Stream, kind: Kind, trust: Trust | None = None) -> Surface | None:
    found, occasion = at_end(samples)
    model = kind(found, trust or Trust()).model(occasion)
    assert model is None or isinstance(model, Surface)
    return model


@pytest.mark.parametrize(("kind", "allowed"), [(Smooth, 0.1), (Rough, 0.1), (Moving, 0.25)])
def test_what_is_made_for_a_contact_foretells_its_next_tenth_of_a_second(kind: Kind, allowed: float) -> None:
    """Within a deadband and a half of k = 0.1 or better, at the positions that come; a hold is off by more."""
    samples = stream(kind)
    now = 3000
    model = model_at_end(samples[: now + 1], kind)
    assert model is not None
    held, worst, hold = model.memory, 0.0, 0.0
    for tick in range(now + 1, now + 100):
        force, position = samples[tick]
        if held is None:
            said = model.at(tick, position)
        else:
            said, held = model.along(tick, position, held)
        worst = max(worst, distance(said, force) / norm(force))
        hold = max(hold, distance(samples[now][0], force) / norm(force))
    assert worst < allowed
    assert worst < 0.6 * hold


@pytest.mark.parametrize("kind", KINDS)
def test_it_holds_the_probe_where_the_newest_sample_says(kind: Kind) -> None:
    samples = stream(kind)[:3001]
    model = model_at_end(samples, kind)
    assert model is not None
    force, position = samples[-1]
    assert model.tick == 3000
    assert model.point == pytest.approx(add(position, scale(force, 1.0 / model.stiffness)))
    assert norm(model.normal) == pytest.approx(1.0)
    if kind is not Rough:
        assert model.normal == pytest.approx(unit(force))
        assert (model.friction, model.memory) == (0.0, None)
        assert model.at(3000, position) == pytest.approx(force, abs=1e-6)


def test_a_smooth_one_is_curved_and_a_rough_one_rubs() -> None:
    smooth, rough = model_at_end(stream(Smooth)[:3001], Smooth), model_at_end(stream(Rough)[:3001], Rough)
    assert smooth is not None
    assert rough is not None
    assert smooth.curvature == pytest.approx(20.0, rel=0.1)
    assert (smooth.velocity, smooth.acceleration, smooth.pulse) == (0.0, 0.0, 0.0)
    assert rough.friction == pytest.approx(0.3, abs=0.02)
    assert dot(rough.normal, NORMAL) > 0.999


@pytest.mark.parametrize("kind", [Smooth, Rough])
def test_what_is_hardly_curved_is_made_flat(kind: Kind) -> None:
    """Half a reciprocal metre: a ball of 2 m."""
    found, occasion = at_end(stream(Rough)[:3001])
    for curvature, expected in ((0.49, 0.0), (-0.49, 0.0), (0.51, 0.51), (-0.51, -0.51)):
        found.bend.value = found.rough_bend.value = curvature
        model = kind(found, Trust()).model(occasion)
        assert model is not None
        assert model.curvature == expected


def test_the_motion_of_a_moving_one_is_that_of_its_surface() -> None:
    """Velocity and acceleration of the sine that it swings by, along its normal."""
    model = model_at_end(stream(Moving)[:3001], Moving)
    assert model is not None
    t = 3.0
    assert model.pulse == pytest.approx(PULSE, rel=2e-3)
    assert model.velocity == pytest.approx(AMPLITUDE * PULSE * cos(2.0 * pi * t), rel=0.05)
    assert model.acceleration == pytest.approx(
        -AMPLITUDE * PULSE**2 * sin(2.0 * pi * t), abs=0.2 * AMPLITUDE * PULSE**2
    )


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_known_of_no_contact_nor_at_the_first_touch(kind: Kind) -> None:
    assert model_at_end([(ZERO, ZERO)] * 50, kind) is None
    assert model_at_end(stream(kind)[:3], kind) is None
    assert model_at_end([*stream(kind)[:3000], (ZERO, ZERO)], kind) is None


def test_what_does_not_rub_is_not_made_rough() -> None:
    """Below 0.03 the coefficient is noise."""
    assert model_at_end(contact(GodObject(1500.0), ticks=1500), Rough) is None


@pytest.mark.parametrize("kind", [Smooth, Moving])
def test_a_stiffness_outside_trust_is_not_believed(kind: Kind) -> None:
    samples = stream(kind)[:3001]
    assert model_at_end(samples, kind) is not None
    assert model_at_end(samples, kind, Trust(stiffness=(1e4, 1e5))) is None


def test_the_frame_of_the_streams_has_the_normal_that_is_meant() -> None:
    assert turned(NORMAL)[:, 2] == pytest.approx(NORMAL)
