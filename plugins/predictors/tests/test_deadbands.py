"""Shapes of the deadband: what each accepts, at its edges; the contract of all is in tests/codec/test_deadband.py."""

from collections.abc import Callable
from math import inf, pi, radians, sin
from typing import Any

import pytest
from hypothesis import given, strategies as st

from tests.codec.signals import up
from tests.codec.test_deadband import FLOOR, OVER, UNDER, K, accepts, at, check_refusals, vectors
from weberlink.codec import force_channel
from weberlink.codec.deadband import Deadband, ForceDeadband
from weberlink.codec.replay import code
from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink_predictors.cone import ConeDeadband
from weberlink_predictors.level_crossing import POWERS, LevelCrossingDeadband, level_after, level_below, past_level
from weberlink_predictors.velocity import VelocityDeadband

CONE = ConeDeadband(K, FLOOR, radians(20.0))
SHELL = ConeDeadband(0.5, 0.25, pi)
LEVELS = LevelCrossingDeadband(K, 1.0, radians(20.0), 0.25)
"""Levels of 1, 2... 10, 11, 12.1 N; a quarter of the spacing, 10 % or 1 N, is the hysteresis."""


@pytest.mark.parametrize(
    ("deadband", "displayed", "actual", "expected"),
    [
        # Exactly at the threshold nothing is sent, beside it a sample is; with numbers that floats hold exactly.
        *((SHELL, up(shown), up(force), expected) for shown, force, expected in [
            (3.0, 2.0, True), (3.0 * OVER, 2.0, False), (1.0, 2.0, True), (UNDER, 2.0, False),
            (0.25, 0.0, True), (0.25 * OVER, 0.0, False), (0.0, 0.25, True), (0.5, 0.25, True), (-0.25, 0.0, True),
        ]),
        (SHELL, (0.0, 2.9, 0.0), up(2.0), True),
        # A cone keeps magnitude and direction apart, at any size.
        *((CONE, at(turn, n * size), up(n), expected) for n in (1.0, 20.0) for turn, size, expected in [
            (0.0, 1.09, True), (0.0, 1.11, False), (0.0, 0.91, True), (0.0, 0.89, False), (19.99, 1.0, True),
            (20.01, 1.0, False), (-19.99, 1.09, True), (19.9, 1.11, False), (180.0, 1.0, False),
        ]),
        # Below the floor it has no direction; the difference may exceed the floor, though neither force does.
        (CONE, at(180.0, 0.009), at(0.0, 0.01), True), (CONE, at(180.0, 0.011), at(0.0, 0.01), False),
        (CONE, at(180.0, 0.02), at(0.0, 0.02), False), (CONE, ZERO, up(0.02), True), (CONE, ZERO, up(0.021), False),
        (CONE, up(0.02), ZERO, True), (CONE, up(0.021), ZERO, False),
        (ConeDeadband(K), at(180.0, 1e-9), at(0.0, 1e-9), False), (ConeDeadband(0.0), at(1.0), at(0.0), False),
        # A level is crossed when the hysteresis is exceeded.
        (LEVELS, up(11.01), up(12.09), True), (LEVELS, up(11.01), up(12.1 * 1.025), True),
        (LEVELS, up(11.01), up(12.1 * 1.027), False), (LEVELS, up(12.09), up(11.0 * 0.976), True),
        (LEVELS, up(12.09), up(11.0 * 0.975), False), (LEVELS, ZERO, up(0.99), True), (LEVELS, ZERO, up(1.25), True),
        (LEVELS, ZERO, up(1.25 * OVER), False), (LEVELS, up(4.0), up(5.25), True), (LEVELS, up(4.0), up(5.26), False),
        (LEVELS, up(5.0), up(4.75), True), (LEVELS, up(5.0), up(4.74), False),
        # A force that turns crosses no level but leaves the cone, unless the difference is below the floor of 1 N.
        (LEVELS, at(19.99, 5.0), at(0.0, 5.0), True), (LEVELS, at(20.01, 5.0), at(0.0, 5.0), False),
        (LEVELS, at(20.1, 1.05), at(0.0, 1.05), True), (LEVELS, at(33.0, 0.0), at(33.0, 0.99), True),
    ],
)  # fmt: skip
def test_what_may_stay_unsent(deadband: Deadband, displayed: Vector, actual: Vector, expected: bool) -> None:
    assert accepts(deadband, displayed, actual) == expected


@pytest.mark.parametrize(
    ("deadband", "displayed", "actual", "error"),
    [
        (CONE, up(3.15), up(3.0), 0.15), (CONE, at(20.0, 3.0), up(3.0), 0.3),
        (CONE, at(60.0, 3.0), up(3.0), 0.3 * sin(radians(30)) / sin(radians(10))),
        (LEVELS, up(10.5), up(13.0), 2.0), (LEVELS, up(13.0), up(10.5), 1.6), (LEVELS, up(2.5), up(9.5), 6.5),
        (LEVELS, at(60.0, 5.0), up(5.0), sin(radians(30)) / sin(radians(10))),
        (LEVELS, at(180.0, 0.9), up(0.99), 1.0 / sin(radians(10))),
    ],
)  # fmt: skip
def test_an_error_is_in_units_of_the_bound(deadband: Deadband, displayed: Vector, actual: Vector, error: float) -> None:
    assert deadband.error(displayed, actual) == pytest.approx(error)


@pytest.mark.parametrize(("speed", "expected"), [(0.0, 0.10), (0.1, 0.15), (0.2, 0.20), (0.3, 0.25), (5.0, 0.25)])
def test_the_weber_factor_grows_with_the_speed_of_the_hand(speed: float, expected: float) -> None:
    for period in (1e-3, 1e-2):
        deadband = VelocityDeadband(K, FLOOR, slope=0.5, most=0.25, period=period)
        assert deadband.bound(up(4.0), ZERO, ZERO, speed * period) == pytest.approx(4.0 * expected)
        assert deadband.bound(ZERO, ZERO, ZERO, speed * period) == FLOOR
    for reference, size in (("actual", 3.0), ("displayed", 4.0), ("sent", 5.0)):
        deadband = VelocityDeadband(0.1, 0.02, reference)  # type: ignore[arg-type]
        assert deadband.bound(up(3.0), up(4.0), up(5.0), 0.0) == pytest.approx(0.1 * size)
    # A factor above the most does not shrink, and an infinite distance is no problem.
    assert VelocityDeadband(0.5, most=0.25).bound(up(1.0), ZERO, ZERO, 1.0) == pytest.approx(0.5)
    assert VelocityDeadband(0.1, slope=0.0).bound(up(1.0), ZERO, ZERO, inf) <= 0.25


@given(f=vectors, g=vectors)
def test_a_cone_of_all_directions_is_a_shell_and_a_wide_one_contains_the_ball(f: Vector, g: Vector) -> None:
    shell = ConeDeadband(K, FLOOR, pi)
    bound = shell.bound(f, g, f, 0.0)
    assert accepts(shell, g, f) == (abs(norm(g) - norm(f)) <= bound or distance(f, g) <= FLOOR)
    # The angle of the ball is asin(k) where the floor does not matter.
    if accepts(ForceDeadband(K, FLOOR), g, f) and norm(f) * K >= FLOOR:
        assert accepts(ConeDeadband(K, FLOOR, radians(6.0)), g, f)


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
    noise = [(up(2.0 + 0.1 * (-1) ** tick), ZERO) for tick in range(100)]
    channel = force_channel(predictor="zoh", deadband=LevelCrossingDeadband(K, 1.0, pi, hysteresis))
    assert sum(update is not None for update in code(channel, noise).updates) == expected


@pytest.mark.parametrize(("shape", "arguments"), [
    (ConeDeadband, [("weber", K), ("floor", K), ("direction", 1.0, 0.0, 3.15)]),
    (LevelCrossingDeadband, [("weber", K), ("floor", K, 0.0), ("direction", 1.0, 0.0, 3.15), ("hysteresis", K, 1.01)]),
    (VelocityDeadband, [("weber", K), ("floor", K), ("displayed", "actual", "wanted"), ("slope", K), ("most", K),
                        ("period", K, 0.0)]),
])  # fmt: skip
def test_refuses_what_is_out_of_range(shape: Callable[..., Deadband], arguments: list[tuple[Any, ...]]) -> None:
    check_refusals(shape, arguments)
