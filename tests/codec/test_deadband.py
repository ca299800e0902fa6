"""Deadbands: closed forms, the claims of each, and the law of the codec with each of them."""

from collections.abc import Callable
from dataclasses import replace
from math import cos, inf, isfinite, nan, pi, radians, sin

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.codec.signals import contact_stream
from tests.examples import examples
from weberlink.codec import Encoder, force_channel, position_channel
from weberlink.codec.deadband import (
    DEADBANDS,
    ConeDeadband,
    Deadband,
    DeadbandSetup,
    ForceDeadband,
    LevelCrossingDeadband,
    PositionDeadband,
    VelocityDeadband,
)
from weberlink.codec.deadband.level_crossing import POWERS, level_after, level_below, past_level
from weberlink.codec.replay import code
from weberlink.geometry.vector import ZERO, Vector, add, distance, norm, scale

K, FLOOR = 0.10, 0.02
CONE = ConeDeadband(K, FLOOR, radians(20.0))
LEVELS = LevelCrossingDeadband(K, 1.0, radians(20.0), 0.25)

components = st.floats(-40.0, 40.0) | st.sampled_from([0.0, -0.0, 1e-3, 0.02, 1.0])
vectors = st.tuples(components, components, components)
any_numbers = st.tuples(*[st.floats(-1e150, 1e150) | st.sampled_from([5e-324, 1e-310, 1e150, 0.0])] * 3)
every = pytest.mark.parametrize("name", DEADBANDS)


def make(name: str, weber: float = K, floor: float = FLOOR) -> Deadband:
    shape = DEADBANDS[name]
    return shape.configured(DeadbandSetup(weber, floor, "actual", 1e-3, shape.defaults()))


def at(degrees: float, size: float = 1.0) -> Vector:
    """In a plane, from z."""
    return (size * sin(radians(degrees)), 0.0, size * cos(radians(degrees)))


def accepts(deadband: Deadband, displayed: Vector, actual: Vector, moved: float = 0.0) -> bool:
    return deadband.error(displayed, actual) <= deadband.bound(actual, displayed, actual, moved)


# Balls.


@pytest.mark.parametrize(("reference", "expected"), [("actual", 0.3), ("displayed", 0.4), ("sent", 0.5)])
def test_weber_bound_scales_with_the_chosen_reference(reference: str, expected: float) -> None:
    forces = (0.0, 0.0, 3.0), (0.0, 4.0, 0.0), (5.0, 0.0, 0.0)
    for shape in (ForceDeadband, VelocityDeadband):
        deadband = shape(0.1, 0.02, reference)  # type: ignore[arg-type]
        assert deadband.bound(*forces, 0.0) == pytest.approx(expected)
        assert deadband.bound(ZERO, ZERO, ZERO, 0.0) == 0.02
    assert ForceDeadband(0.1).bound(ZERO, *forces[1:], 0.0) == 0.0


def test_position_bound_grows_with_the_distance_moved_in_a_tick() -> None:
    deadband = PositionDeadband(0.1, 2e-4)
    assert deadband.bound((0.01, 0.0, 0.0), ZERO, ZERO, 0.0) == 2e-4
    assert deadband.bound((0.01, 0.0, 0.0), ZERO, ZERO, 0.01) == pytest.approx(2e-4 + 0.1 * 0.01)
    encoder = Encoder(position_channel(weber=0.1, bound=2e-4))
    encoder.encode(0, ZERO, (5.0, 0.0, 0.0))
    encoder.encode(1, (0.0, 0.0, 0.01), ZERO)
    assert encoder.bound == pytest.approx(2e-4 + 0.1 * 0.01)


# Cone.


@pytest.mark.parametrize(("degrees", "size", "expected"), [
    (0.0, 1.09, True), (0.0, 1.11, False), (0.0, 0.91, True), (0.0, 0.89, False),
    (19.9, 1.0, True), (20.1, 1.0, False), (-19.9, 1.09, True), (19.9, 1.11, False), (180.0, 1.0, False),
])  # fmt: skip
def test_a_cone_keeps_magnitude_and_direction_apart(degrees: float, size: float, expected: bool) -> None:
    assert accepts(CONE, at(degrees, size), at(0.0)) == expected
    assert accepts(CONE, at(degrees, 20.0 * size), at(0.0, 20.0)) == expected


def test_the_error_of_a_cone_is_in_units_of_its_bound() -> None:
    bound = CONE.bound(at(0.0, 3.0), ZERO, ZERO, 0.0)
    assert bound == pytest.approx(0.3)
    assert CONE.error(at(0.0, 3.15), at(0.0, 3.0)) == pytest.approx(0.15)
    assert CONE.error(at(20.0, 3.0), at(0.0, 3.0)) == pytest.approx(bound)
    assert CONE.error(at(60.0, 3.0), at(0.0, 3.0)) == pytest.approx(bound * sin(radians(30)) / sin(radians(10)))


def test_below_the_floor_a_cone_has_no_direction() -> None:
    assert accepts(CONE, at(180.0, 0.009), at(0.0, 0.01))
    assert not accepts(CONE, at(180.0, 0.011), at(0.0, 0.01))
    # The difference exceeds the floor, though neither force does.
    assert not accepts(CONE, at(180.0, 0.02), at(0.0, 0.02))
    assert accepts(CONE, ZERO, at(0.0, 0.02))
    assert not accepts(CONE, ZERO, at(0.0, 0.021))
    assert not accepts(ConeDeadband(K), at(180.0, 1e-9), at(0.0, 1e-9))
    assert not accepts(ConeDeadband(0.0), at(1.0), at(0.0))


@given(f=vectors, g=vectors)
def test_a_cone_of_all_directions_is_a_shell_and_a_wide_one_contains_the_ball(f: Vector, g: Vector) -> None:
    shell = ConeDeadband(K, FLOOR, pi)
    bound = shell.bound(f, g, f, 0.0)
    assert accepts(shell, g, f) == (abs(norm(g) - norm(f)) <= bound or distance(f, g) <= FLOOR)
    # The angle of the ball is asin(k) where the floor does not matter.
    if accepts(ForceDeadband(K, FLOOR), g, f) and norm(f) * K >= FLOOR:
        assert accepts(ConeDeadband(K, FLOOR, radians(6.0)), g, f)


@given(seed=st.integers(0, 2**32 - 1))
@examples(20)
def test_on_one_axis_a_cone_is_a_ball(seed: int) -> None:
    stream = contact_stream(seed, axes="z")
    one, other = (code(force_channel(deadband=each), stream) for each in (ForceDeadband(K, FLOOR), CONE))
    assert [tick.update for tick in one] == [tick.update for tick in other]


# Level crossing.


def test_a_level_is_crossed_when_the_hysteresis_is_exceeded() -> None:
    """Levels of 1, 2... 10, 11, 12.1 N; a quarter of the spacing, 10 % or 1 N, is the hysteresis."""
    assert accepts(LEVELS, at(0.0, 11.01), at(0.0, 12.09))
    assert accepts(LEVELS, at(0.0, 11.01), at(0.0, 12.1 * 1.02))
    assert not accepts(LEVELS, at(0.0, 11.01), at(0.0, 12.1 * 1.03))
    assert accepts(LEVELS, at(0.0, 12.09), at(0.0, 11.0 * 0.98))
    assert not accepts(LEVELS, at(0.0, 12.09), at(0.0, 11.0 * 0.97))
    assert LEVELS.error(at(0.0, 10.5), at(0.0, 13.0)) == pytest.approx(13.0 - 11.0)
    assert LEVELS.error(at(0.0, 13.0), at(0.0, 10.5)) == pytest.approx(12.1 - 10.5)
    assert LEVELS.error(at(0.0, 2.5), at(0.0, 9.5)) == pytest.approx(9.5 - 3.0)
    # Below the lowest level the magnitude counts as 0, but a difference above the floor counts in any direction.
    assert LEVELS.error(at(180.0, 0.9), at(0.0, 0.99)) > 0.0
    assert accepts(LEVELS, ZERO, at(33.0, 0.99))
    assert accepts(LEVELS, ZERO, at(0.0, 1.24))
    assert not accepts(LEVELS, ZERO, at(0.0, 1.26))
    # A force that turns crosses no level but leaves the cone, unless the difference is below the floor of 1 N.
    assert accepts(LEVELS, at(19.9, 5.0), at(0.0, 5.0))
    assert not accepts(LEVELS, at(20.1, 5.0), at(0.0, 5.0))
    assert accepts(LEVELS, at(20.1, 1.05), at(0.0, 1.05))


@given(
    size=st.floats(1e-6, 1e150), weber=st.sampled_from([0.0, 1e-4, 0.025, 0.1, 0.3, 1.0]), floor=st.floats(1e-4, 1.0)
)
def test_levels_are_multiples_below_the_knee_and_powers_above(size: float, weber: float, floor: float) -> None:
    deadband = LevelCrossingDeadband(weber, floor)
    grid = floor, deadband.knee, deadband.powers
    level = level_below(size, *grid)
    assert len(deadband.powers) == POWERS
    assert level * (1.0 - 1e-12) <= size < level_after(level, *grid) * (1.0 + 1e-12)
    assert level_after(deadband.knee, *grid) == deadband.knee * (1.0 + deadband.spacing)
    if level >= deadband.knee:
        assert level_after(level, *grid) == pytest.approx(level * (1.0 + deadband.spacing))
        assert level_below(level, *grid) == level
    elif level < deadband.knee * (1.0 - 1e-12):
        assert level == pytest.approx(floor * round(level / floor))
        assert deadband.spacing * level <= floor


@given(f=vectors, g=vectors)
def test_an_unsent_error_is_at_most_a_level_and_its_hysteresis(f: Vector, g: Vector) -> None:
    deadband = LevelCrossingDeadband(K, FLOOR, pi)
    if accepts(deadband, g, f):
        wider = (1.0 + deadband.hysteresis) * max(K * max(norm(f), norm(g)), FLOOR)
        assert abs(norm(f) - norm(g)) <= wider * (1.0 + 1e-9)
    grid = LEVELS.floor, LEVELS.knee, LEVELS.powers
    one, other = (past_level(a, b, *grid) for a, b in ((norm(f), norm(g)), (norm(g), norm(f))))
    if level_below(norm(f), *grid) == level_below(norm(g), *grid):
        assert one == other == 0.0
    assert max(one, other) <= abs(norm(f) - norm(g)) * (1.0 + 1e-12)


@pytest.mark.parametrize(("hysteresis", "expected"), [(0.25, 1), (0.0, 100)])
def test_noise_on_a_level_is_not_sent_with_hysteresis(hysteresis: float, expected: int) -> None:
    noise = [(at(0.0, 2.0 + 0.1 * (-1) ** tick), ZERO) for tick in range(100)]
    channel = force_channel(predictor="zoh", deadband=LevelCrossingDeadband(K, 1.0, pi, hysteresis))
    assert sum(tick.update is not None for tick in code(channel, noise)) == expected


# Velocity-adaptive.


@pytest.mark.parametrize(("speed", "expected"), [(0.0, 0.10), (0.1, 0.15), (0.2, 0.20), (0.3, 0.25), (5.0, 0.25)])
def test_the_weber_factor_grows_with_the_speed_of_the_hand(speed: float, expected: float) -> None:
    for period in (1e-3, 1e-2):
        deadband = VelocityDeadband(K, FLOOR, slope=0.5, most=0.25, period=period)
        assert deadband.bound(at(0.0, 4.0), ZERO, ZERO, speed * period) == pytest.approx(4.0 * expected)
        assert deadband.bound(ZERO, ZERO, ZERO, speed * period) == FLOOR
    # A factor above the most does not shrink, and an infinite distance is no problem.
    assert VelocityDeadband(0.5, most=0.25).bound(at(0.0), ZERO, ZERO, 1.0) == pytest.approx(0.5)
    assert VelocityDeadband(0.1, slope=0.0).bound(at(0.0), ZERO, ZERO, inf) <= 0.25


def test_moved_is_the_distance_since_the_sample_before() -> None:
    seen: list[float] = []

    class Watching(VelocityDeadband):
        __slots__ = ()

        def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:
            seen.append(moved)
            return super().bound(actual, displayed, sent, moved)

    encoder = Encoder(force_channel(deadband=Watching(K, FLOOR)))
    for tick, depth in enumerate((0.0, 0.001, nan, 0.004)):
        encoder.encode(tick, at(0.0), (0.0, 0.0, depth))
    assert seen == pytest.approx([0.0, 0.001, 0.003])
    # Neither after a reset nor after a deadband that did not read it is an earlier motion counted.
    encoder.reset()
    encoder.encode(9, at(0.0), (1.0, 0.0, 0.0))
    encoder.retune(ForceDeadband(K, FLOOR), [0])
    encoder.encode(10, at(0.0), (2.0, 0.0, 0.0))
    encoder.retune(Watching(K, FLOOR), [0])
    encoder.encode(11, at(0.0), (2.0, 0.0, 0.0))
    assert seen[3:] == [0.0, 0.0]


# All.


@every
@given(f=any_numbers, g=any_numbers, weber=st.sampled_from([0.0, 0.1, 1.0]))
@examples(50)
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
@examples(50)
def test_no_shape_depends_on_the_axes(name: str, f: Vector, aside: Vector, turn: float) -> None:
    deadband, c, s = make(name), cos(turn), sin(turn)
    g = add(f, scale(aside, norm(f)))
    # Away from where rounding decides: whether a level is reached, and whether a difference is above the floor.
    assume(abs(distance(f, g) - FLOOR) > 1e-9)
    if isinstance(deadband, LevelCrossingDeadband):
        grid = FLOOR, deadband.knee, deadband.powers
        for size in (norm(f), norm(g)):
            assume(level_below(size * (1.0 - 1e-9), *grid) == level_below(size * (1.0 + 1e-9), *grid))
    turned = ((c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]) for v in (g, f))
    assert deadband.error(*turned) == pytest.approx(deadband.error(g, f), rel=1e-6, abs=1e-9)


@every
@given(seed=st.integers(0, 2**32 - 1), floor=st.sampled_from([1e-3, 0.02, 0.3]),
       bank=st.sampled_from([("zoh",), ("plane",), ("zoh", "linear", "plane", "sphere")]),
       axes=st.sampled_from(["xyz", "z"]))  # fmt: skip
@examples(20)
def test_the_law_holds_with_every_shape(name: str, seed: int, floor: float, bank: tuple[str, ...], axes: str) -> None:
    deadband = make(name, floor=floor)
    channel = force_channel(bank=bank, axes=axes, deadband=deadband)
    stream, before = contact_stream(seed, ticks=200, axes=axes), None
    for tick, (force, position) in zip(code(channel, stream), stream, strict=True):
        held, actual = tick.displayed, channel.value_quantizer.confine(force)
        moved = 0.0 if before is None else distance(position, before)
        before = position
        bound = deadband.bound(actual, held, held, moved)
        assert deadband.error(held, actual) <= max(
            bound, deadband.error(channel.value_quantizer.rounded(actual), actual)
        )


@every
@pytest.mark.parametrize("value", [nan, inf, -inf, 1e300, 5e-324])
def test_invalid_samples_are_rejected_and_extreme_ones_coded(name: str, value: float) -> None:
    encoder = Encoder(force_channel(deadband=make(name)))
    for tick in range(20):
        encoder.encode(tick, (0.0, 0.0, value), ZERO)
    assert encoder.rejected == (0 if isfinite(value) else 20)
    assert isfinite(encoder.bound)


@pytest.mark.parametrize(("build", "named"), [
    (ForceDeadband, "weber"),
    (lambda bad: ForceDeadband(K, bad), "floor"),
    (lambda bad: PositionDeadband(K, bad), "bound"),
    (ConeDeadband, "weber"),
    (lambda bad: ConeDeadband(K, bad), "floor"),
    (lambda bad: ConeDeadband(K, FLOOR, bad), "direction"),
    (lambda bad: LevelCrossingDeadband(bad, FLOOR), "weber"),
    (lambda bad: LevelCrossingDeadband(K, bad), "floor"),
    (lambda bad: LevelCrossingDeadband(K, FLOOR, bad), "direction"),
    (lambda bad: LevelCrossingDeadband(K, FLOOR, 1.0, bad), "hysteresis"),
    (VelocityDeadband, "weber"),
    (lambda bad: VelocityDeadband(K, slope=bad), "slope"),
    (lambda bad: VelocityDeadband(K, most=bad), "most"),
    (lambda bad: VelocityDeadband(K, period=bad), "period"),
])  # fmt: skip
@pytest.mark.parametrize("bad", [-0.1, nan, inf])
def test_refuses_numbers_that_are_out_of_range(build: Callable[[float], Deadband], named: str, bad: float) -> None:
    with pytest.raises(ValueError, match=named):
        build(bad)


def test_refuses_a_missing_lowest_level_and_an_unknown_reference() -> None:
    with pytest.raises(ValueError, match="lowest level"):
        LevelCrossingDeadband(K, 0.0)
    for shape in (ForceDeadband, VelocityDeadband):
        with pytest.raises(ValueError, match="displayed"):
            shape(K, 0.0, "wanted")  # type: ignore[arg-type]


def test_a_deadband_can_be_made_again_with_one_change() -> None:
    assert replace(CONE, direction=pi) == ConeDeadband(K, FLOOR, pi)
    assert replace(LEVELS, weber=0.2).powers[-1] == 1.2
