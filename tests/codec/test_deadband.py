"""Deadbands: what each accepts, at its edges, and the contract of all."""

from collections.abc import Callable
from math import cos, inf, isfinite, nan, pi, radians, sin
from typing import Any

import pytest
from hypothesis import assume, given, strategies as st

from tests.codec.signals import up
from weberlink.codec import Encoder, force_channel
from weberlink.codec.deadband import (
    DEADBANDS,
    Deadband,
    DeadbandSetup,
    ForceDeadband,
    PerAxisDeadband,
    PositionDeadband,
)
from weberlink.geometry.vector import ZERO, Vector, add, distance, norm, scale

K, FLOOR = 0.10, 0.02
BALL = ForceDeadband(0.5, 0.25)
AXES = PerAxisDeadband(0.5, (0.25, 0.5, inf))

components = st.floats(-40.0, 40.0) | st.sampled_from([0.0, -0.0, 1e-3, 0.02, 1.0])
vectors = st.tuples(components, components, components)
any_numbers = st.tuples(*[st.floats(-1e150, 1e150) | st.sampled_from([5e-324, 1e-310, 1e150, 0.0])] * 3)
every = pytest.mark.parametrize("name", DEADBANDS)


def make(name: str, weber: float = K, floor: float = FLOOR) -> Deadband:
    shape = DEADBANDS[name]
    return shape.configured(DeadbandSetup(weber, floor, "actual", 1e-3, shape.Options()))


def at(degrees: float, size: float = 1.0) -> Vector:
    """In a plane, from z."""
    return (size * sin(radians(degrees)), 0.0, size * cos(radians(degrees)))


def accepts(deadband: Deadband, displayed: Vector, actual: Vector, moved: float = 0.0) -> bool:
    return deadband.error(displayed, actual) <= deadband.bound(actual, displayed, actual, moved)


def check_refusals(shape: Callable[..., Deadband], arguments: list[tuple[Any, ...]]) -> None:
    """Each argument: what the error names, a good value, and what is beyond its range; of a number also all below."""
    good = [value for _, value, *_ in arguments]
    shape(*good)
    for index, (named, value, *beyond) in enumerate(arguments):
        for bad in (*beyond, *([-0.1, nan, inf] if isinstance(value, float) else [])):
            with pytest.raises(ValueError, match=named):
                shape(*good[:index], bad, *good[index + 1 :])


OVER, UNDER = 1.0 + 2.0**-40, 1.0 - 2.0**-40


@pytest.mark.parametrize(
    ("deadband", "displayed", "actual", "expected"),
    [
        # Exactly at the threshold nothing is sent, beside it a sample is; with numbers that floats hold exactly.
        *((BALL, up(shown), up(force), expected) for shown, force, expected in [
            (3.0, 2.0, True), (3.0 * OVER, 2.0, False), (1.0, 2.0, True), (UNDER, 2.0, False),
            (0.25, 0.0, True), (0.25 * OVER, 0.0, False), (0.0, 0.25, True), (0.5, 0.25, True), (-0.25, 0.0, True),
        ]),
        (BALL, (0.0, 1.5, 2.0), up(2.0), False),
        (AXES, (3.0, 0.5, 7.0), (2.0, 0.0, 2.0), True), (AXES, (3.0 * OVER, 0.0, 0.0), (2.0, 0.0, 0.0), False),
        (AXES, (0.0, 0.5 * OVER, 0.0), ZERO, False), (AXES, (-0.25, -0.5, -9.0), ZERO, True),
    ],
)  # fmt: skip
def test_what_may_stay_unsent(deadband: Deadband, displayed: Vector, actual: Vector, expected: bool) -> None:
    assert accepts(deadband, displayed, actual) == expected


@pytest.mark.parametrize(
    ("deadband", "displayed", "actual", "error"),
    [
        (AXES, up(0.0), up(5.0), 0.0), (AXES, (10.0, 0.0, 0.0), (8.0, 0.0, 0.0), 0.5),
        (AXES, (8.0, 2.0, 0.0), (8.0, 0.5, 0.0), 3.0), (AXES, (9.0, 2.0, 0.0), (8.0, 0.5, 0.0), 3.0),
        (PerAxisDeadband(0.0, (0.1,) * 3, 0.5), (1.0, 0.5, 0.0), ZERO, 10.0),
        (PerAxisDeadband(0.0, (inf,) * 3), (1.0, 0.0, 0.0), ZERO, 0.0),
    ],
)  # fmt: skip
def test_an_error_is_in_units_of_the_bound(deadband: Deadband, displayed: Vector, actual: Vector, error: float) -> None:
    assert deadband.error(displayed, actual) == pytest.approx(error)


@pytest.mark.parametrize(("reference", "expected"), [("actual", 0.3), ("displayed", 0.4), ("sent", 0.5)])
def test_a_weber_bound_scales_with_the_chosen_reference(reference: str, expected: float) -> None:
    forces = (0.0, 0.0, 3.0), (0.0, 4.0, 0.0), (5.0, 0.0, 0.0)
    deadband = ForceDeadband(0.1, 0.02, reference)  # type: ignore[arg-type]
    assert deadband.bound(*forces, 0.0) == pytest.approx(expected)
    assert deadband.bound(ZERO, ZERO, ZERO, 0.0) == 0.02
    assert ForceDeadband(0.1).bound(ZERO, *forces[1:], 0.0) == 0.0


def test_a_position_bound_grows_with_the_distance_moved_in_a_tick() -> None:
    deadband = PositionDeadband(0.1, 2e-4)
    assert deadband.bound((0.01, 0.0, 0.0), ZERO, ZERO, 0.0) == 2e-4
    assert deadband.bound((0.01, 0.0, 0.0), ZERO, ZERO, 0.01) == pytest.approx(2e-4 + 0.1 * 0.01)


def test_moved_is_the_distance_since_the_sample_before() -> None:
    """Neither after a reset nor after a deadband that did not read it is an earlier motion counted."""
    deadband = PositionDeadband(1.0, 0.0)
    encoder = Encoder(force_channel(deadband=deadband))

    def moved(tick: int, depth: float) -> float:
        encoder.encode(tick, up(1.0), up(depth))
        return encoder.bound

    assert [moved(0, 0.0), moved(1, 0.001), moved(3, 0.004)] == pytest.approx([0.0, 0.001, 0.003])
    encoder.reset()
    assert moved(9, 1.0) == pytest.approx(0.0)
    encoder.retune(ForceDeadband(K, FLOOR), [0])
    moved(10, 2.0)
    encoder.retune(deadband, [0])
    assert [moved(11, 3.0), moved(12, 3.002)] == pytest.approx([0.0, 0.002])


# All.


@every
@given(f=any_numbers, g=any_numbers, weber=st.sampled_from([0.0, 0.1, 1.0]))
def test_any_finite_forces_have_an_error_and_a_bound(name: str, f: Vector, g: Vector, weber: float) -> None:
    deadband = make(name, weber)
    error, bound = deadband.error(g, f), deadband.bound(f, g, f, 0.0)
    assert error >= 0.0
    assert bound >= 0.0
    assert isfinite(bound)
    assert deadband.error(f, f) == 0.0
    if deadband.is_ball:
        assert error == deadband.error(f, g) == distance(f, g)


@every
@given(f=vectors, aside=st.tuples(*[st.floats(-0.2, 0.2)] * 3), turn=st.floats(0.0, 2.0 * pi))
def test_no_shape_depends_on_the_axes(name: str, f: Vector, aside: Vector, turn: float) -> None:
    deadband, c, s = make(name), cos(turn), sin(turn)
    g = add(f, scale(aside, norm(f)))
    # Away from where rounding decides: whether a level is reached, and whether a difference is above the floor.
    assume(abs(distance(f, g) - FLOOR) > 1e-9)
    nearby = [deadband.error(g, scale(f, size)) for size in (1.0 - 1e-9, 1.0 + 1e-9)]
    nearby += [deadband.error(scale(g, size), f) for size in (1.0 - 1e-9, 1.0 + 1e-9)]
    assume(max(nearby) - min(nearby) < 1e-6)
    turned = ((c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]) for v in (g, f))
    assert deadband.error(*turned) == pytest.approx(deadband.error(g, f), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(("shape", "arguments"), [
    (ForceDeadband, [("weber", K), ("floor", K), ("displayed", "actual", "wanted")]),
    (PositionDeadband, [("weber", K), ("bound", K)]),
    (PerAxisDeadband, [("weber", K), ("threshold of an axis", (K, K, K), (K, 0.0, K), (K, nan, K)), ("resolution", K)]),
])  # fmt: skip
def test_refuses_what_is_out_of_range(shape: Callable[..., Deadband], arguments: list[tuple[Any, ...]]) -> None:
    check_refusals(shape, arguments)
