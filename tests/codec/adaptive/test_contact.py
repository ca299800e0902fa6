"""What is estimated of a contact whose truth is known, with the noise of a sensor (2 mN) on every axis.

The tolerances are what was measured, rounded up. Noise in the force makes a contact look stiffer, and the more so the
softer it is: the changes of force over some ticks are 20 mN at 200 N/m.
"""

from functools import cache
from math import pi, sin

import pytest

from tests.codec.contacts import GodObject, contact, stroke
from tests.codec.signals import Stream
from weberlink.codec.adaptive.contact import Contact
from weberlink.codec.adaptive.history import History
from weberlink.geometry.vector import ZERO, Vector, dot, unit

NORMAL = unit((0.3, -0.2, 0.93))
MU = 0.3


def follow(stream: Stream, found: Contact | None = None, *, skip: tuple[int, ...] = ()) -> Contact:
    history, found = History(), found or Contact(0.04)
    for tick, (force, position) in enumerate(stream):
        if tick not in skip:
            found.follow(history, history.add(tick, force, position))
    return found


@cache
def touched(stiffness: float, curvature: float = 0.0, friction: float = 0.0, ticks: int = 3000) -> Contact:
    return follow(contact(GodObject(stiffness, curvature, friction), ticks=ticks))


@cache
def moved(stiffness: float, amplitude: float, hz: float = 1.0, ticks: int = 4000) -> Contact:
    """On a flat surface that swings, with a hand that nearly goes along."""

    def path(t: float) -> Vector:
        a, b, height = stroke(t)
        return a, b, height + 0.9 * amplitude * sin(2.0 * pi * hz * t)

    return follow(
        contact(GodObject(stiffness), ticks=ticks, path=path, lift=lambda t: amplitude * sin(2.0 * pi * hz * t))
    )


@pytest.mark.parametrize(("stiffness", "off"), [(200.0, 0.07), (500.0, 0.02), (1500.0, 0.01)])
@pytest.mark.parametrize("curvature", [0.0, 20.0, -20.0])
def test_the_stiffness_of_what_has_no_friction(stiffness: float, off: float, curvature: float) -> None:
    assert 1.0 / touched(stiffness, curvature).smooth.compliance == pytest.approx(stiffness, rel=off)


@pytest.mark.parametrize(("stiffness", "off"), [(200.0, 0.18), (500.0, 0.04), (1500.0, 0.02)])
@pytest.mark.parametrize("friction", [0.0, MU])
@pytest.mark.parametrize("curvature", [0.0, 20.0, -20.0])
def test_the_stiffness_of_what_may_have_friction(
    stiffness: float, off: float, friction: float, curvature: float
) -> None:
    assert 1.0 / touched(stiffness, curvature, friction).rough.compliance == pytest.approx(stiffness, rel=off)


@pytest.mark.parametrize("stiffness", [200.0, 500.0, 1500.0])
@pytest.mark.parametrize("curvature", [20.0, -20.0])
def test_the_curvature_with_and_without_friction(stiffness: float, curvature: float) -> None:
    assert touched(stiffness, curvature).bend.value == pytest.approx(curvature, rel=0.08)
    off = 0.15 if stiffness > 200.0 else 0.25
    assert touched(stiffness, curvature, MU).rough_bend.value == pytest.approx(curvature, rel=off)


@pytest.mark.parametrize("friction", [0.0, MU])
def test_a_wall_is_hardly_curved(friction: float) -> None:
    found = touched(500.0, 0.0, friction)
    assert abs(found.bend.value) < 1.5
    assert abs(found.rough_bend.value) < 1.5


@pytest.mark.parametrize(("curvature", "off"), [(0.0, 0.01), (20.0, 0.045), (-20.0, 0.05)])
@pytest.mark.parametrize("stiffness", [500.0, 1500.0])
def test_the_friction(stiffness: float, curvature: float, off: float) -> None:
    """On what is curved the normal that is averaged lags behind, by about two degrees."""
    found = touched(stiffness, curvature, MU)
    assert found.friction == pytest.approx(MU, abs=off)
    if curvature == 0.0:
        assert dot(found.normal, NORMAL) > 0.9995


@pytest.mark.parametrize("curvature", [0.0, 20.0, -20.0])
def test_what_has_no_friction_has_hardly_any(curvature: float) -> None:
    assert touched(500.0, curvature).friction < 0.03


def test_a_press_that_does_not_slide_tells_the_least_friction_there_is() -> None:
    """It held a pull of a fifth of the press."""
    stream = [((0.2 * sin(0.01 * tick), 0.0, 1.0), (0.0, 0.0, -2e-3)) for tick in range(1000)]
    found = follow(stream)
    assert found.normal == (0.0, 0.0, 1.0)
    assert found.friction == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize("amplitude", [0.016, 0.005])
def test_the_stiffness_and_the_pulse_of_what_moves(amplitude: float) -> None:
    """0.016 m at 1 Hz is 0.1 m/s. Third differences leave little but noise of a soft one: 300 N/m looks like 410."""
    found = moved(1000.0, amplitude)
    assert 1.0 / found.moving.compliance == pytest.approx(1000.0, rel=0.05)
    assert found.pulse.value == pytest.approx(2.0 * pi * 1e-3, rel=1e-3)
    assert moved(300.0, amplitude).pulse.value == pytest.approx(2.0 * pi * 1e-3, rel=1e-3)
    # The motion is taken for compliance by those that suppose there is none.
    assert abs(found.smooth.compliance * 1000.0 - 1.0) > 0.3


def test_another_pulse() -> None:
    assert moved(1000.0, 0.004, hz=1.6).pulse.value == pytest.approx(3.2 * pi * 1e-3, rel=5e-3)


# When a contact is one.


def press(force: float) -> tuple[Vector, Vector]:
    return (0.0, 0.0, force), (0.0, 0.0, -force / 500.0)


def test_a_contact_is_a_force_beyond_the_threshold() -> None:
    found = Contact(0.04)
    assert follow([press(0.04)] * 5, found).age == 0
    assert follow([press(0.041)] * 5, found).age == 5
    assert follow([press(0.0)], found).age == 0
    assert found.normal == (0.0, 0.0, 1.0)


@pytest.mark.parametrize("skip", [(7,), (7, 8, 9), (3, 7)])
def test_after_a_gap_it_is_as_old_as_the_record(skip: tuple[int, ...]) -> None:
    assert follow([press(1.0)] * 20, skip=skip).age == 20 - 1 - max(skip)


def test_what_was_learned_outlasts_the_contact_and_the_normal_only_if_the_next_is_alike() -> None:
    stream = contact(GodObject(500.0, 0.0, MU), ticks=2000)
    found = follow(stream)
    before = found.rough.compliance, found.friction, found.normal
    follow([(ZERO, ZERO)] * 30, found)
    assert (found.rough.compliance, found.friction, found.normal) == before
    tilted = unit((NORMAL[0] + 0.3, NORMAL[1], NORMAL[2]))
    follow([(tilted, ZERO)], found)
    assert found.normal == before[2]
    follow([(ZERO, ZERO), ((1.0, 0.0, 0.0), ZERO)], found)
    assert found.normal == (1.0, 0.0, 0.0)


def test_a_gap_of_ticks_compares_nothing_across_it() -> None:
    """The hand was elsewhere before: taken for one tick, the jump would be a compliance of its own."""
    one = contact(GodObject(500.0), ticks=600)
    other = [((f[0], f[1], f[2]), (p[0] + 0.1, p[1] - 0.2, p[2] + 0.3)) for f, p in one]
    history, found, continuous = History(), Contact(0.04), Contact(0.04)
    for tick, (force, position) in enumerate([*one, *other]):
        at = tick if tick < 600 else tick + 1
        found.follow(history, history.add(at, force, position))
    history = History()
    for tick, (force, position) in enumerate([*one, *other]):
        continuous.follow(history, history.add(tick, force, position))
    assert 1.0 / found.smooth.compliance == pytest.approx(500.0, rel=0.05)
    assert continuous.smooth.compliance == 0.0 or 1.0 / continuous.smooth.compliance < 100.0


@pytest.mark.parametrize("size", [1e-3, 1e150])
def test_extreme_forces_and_places_do_not_raise(size: float) -> None:
    stream = [(_extreme(tick, size), _extreme(tick + 3, 1e150)) for tick in range(600)]
    found = follow(stream, Contact(1e-4))
    for number in (found.friction, found.smooth.compliance, found.rough.compliance, found.moving.compliance):
        assert 0.0 <= number < 1e300


def _extreme(tick: int, size: float) -> Vector:
    return (size * (tick % 3 - 1), size * (tick % 5 - 2) / 2.0, size * (tick % 7 - 3) / 3.0)
