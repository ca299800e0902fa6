from collections.abc import Callable
from math import dist, hypot, inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.safety import ForceGate, ForceLimiter, SlewLimiter, TorqueLimiter

components = st.floats(-1e6, 1e6)
FORCE = (0.0, 0.0, 4.0)
TICK = 1e-3
TICK_2 = 2.0**-8


@given(force=st.tuples(components, components, components))
def test_limiter_keeps_the_direction_and_bounds_the_length(force: tuple[float, float, float]) -> None:
    limiter = ForceLimiter(10.0)
    limited = limiter.limit(force)
    assert hypot(*limited) <= 10.0 * (1.0 + 1e-12)
    assert limiter.clipped is (hypot(*force) > 10.0)
    if not limiter.clipped:
        assert limited == force
    else:
        assert [c * hypot(*force) for c in limited] == pytest.approx([c * 10.0 for c in force], rel=1e-9, abs=1e-9)


def test_gate_is_shut_at_the_limit_despite_missed_ticks() -> None:
    slow = ForceGate(ramp=0.1, silence=0.1, fade_share=0.6)
    for _ in range(300):
        slow.update(engaged=True, age=0.001, elapsed=0.001)
    assert slow.update(engaged=True, age=0.08, elapsed=0.02) == pytest.approx(0.5)
    assert slow.update(engaged=False, age=0.1, elapsed=0.02) == 0.0


forces = st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))


@given(wanted=st.lists(st.tuples(forces, st.floats(0.0, 0.002)), min_size=1, max_size=50), rate=st.floats(1.0, 1e4))
def test_slew_limit_bounds_every_step_and_tells_when_it_did(wanted: list[tuple[Vector, float]], rate: float) -> None:
    slew, before = SlewLimiter(rate), ZERO
    for force, elapsed in wanted:
        after = slew.limit(force, elapsed)
        assert dist(after, before) <= rate * elapsed * (1 + 1e-9) + 1e-12
        assert slew.limited == (after != force)
        assert dist(after, force) <= dist(before, force) * (1 + 1e-9)
        before = after


def test_a_slew_limit_without_end_changes_nothing() -> None:
    slew = SlewLimiter(inf)
    assert [slew.limit(force, TICK) for force in (FORCE, ZERO, FORCE)] == [FORCE, ZERO, FORCE]


@pytest.mark.parametrize(("size", "clips"), [(0.0, False), (10.0 - 1e-9, False), (10.0, False), (10.0 + 1e-9, True)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_limiter_clips_beyond_the_limit_alone(size: float, clips: bool, sign: float) -> None:
    limiter = ForceLimiter(10.0)
    assert not limiter.clipped
    assert limiter.limit((0.0, sign * size, 0.0)) == pytest.approx((0.0, sign * min(size, 10.0), 0.0))
    assert limiter.clipped is clips


@pytest.mark.parametrize(
    ("made", "says"),
    [
        *((lambda limit=limit: ForceLimiter(limit), "limit must be positive") for limit in (0.0, -1.0, nan)),
        *((lambda limit=limit: SlewLimiter(limit), "limit must be positive") for limit in (0.0, -1.0, nan)),
        (lambda: TorqueLimiter((1.0,), (1.0, 1.0)), "1 torque limits but 2 slew limits"),
        (lambda: TorqueLimiter((0.0, -1e-9), (1.0, 1.0)), "must not be negative"),
        (lambda: TorqueLimiter((nan,), (1.0,)), "must not be negative"),
        (lambda: TorqueLimiter((1.0, 1.0), (1.0, 0.0)), "slew limits must be positive"),
    ],
)
def test_a_limit_that_is_none_is_refused(made: Callable[[], object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        made()


@pytest.mark.parametrize(
    ("torques", "elapsed", "shown", "clipped", "held_back"),
    [
        ((0.5, -0.4, 0.0), None, (0.5, -0.4, 0.0), False, False),
        ((1.0, -0.8, 3.0), None, (1.0, -0.8, 0.0), False, False),  # an axis that displays none clips nothing
        ((1.1, -0.9, 0.0), None, (1.0, -0.8, 0.0), True, False),
        ((0.125, -0.125, 0.0), TICK_2, (0.125, -0.125, 0.0), False, False),
        ((0.126, 0.0, 0.0), TICK_2, (0.125, 0.0, 0.0), False, True),
        ((0.0, -0.126, 0.0), TICK_2, (0.0, -0.125, 0.0), False, True),
        ((9.0, 9.0, 9.0), TICK_2, (0.125, 0.125, 0.0), True, True),
    ],
)
def test_torques_are_limited_axis_by_axis(
    torques: Joints, elapsed: float | None, shown: Joints, clipped: bool, held_back: bool
) -> None:
    limiter = TorqueLimiter((1.0, 0.8, 0.0), (32.0, 32.0, inf))
    assert (limiter.clipped, limiter.held_back) == (False, False)
    assert limiter.limit(torques, elapsed) == shown
    assert (limiter.clipped, limiter.held_back) == (clipped, held_back)
    limiter.limit(shown, None)
    assert (limiter.clipped, limiter.held_back) == (False, False)


@pytest.mark.parametrize(("wanted", "shown"), [(-0.4, 0.375), (0.9, 0.625), (0.6, 0.6), (0.4, 0.4)])
def test_slew_of_a_torque_counts_from_the_last_one(wanted: float, shown: float) -> None:
    limiter = TorqueLimiter((0.7,), (32.0,))
    limiter.limit((0.5,), None)
    assert limiter.limit((wanted,), TICK_2) == (shown,)
    assert limiter.held_back is (shown != wanted)


def test_limits_below_one_newton_metre_hold() -> None:
    limiter = TorqueLimiter((0.3, 0.3), (0.5, inf))
    assert limiter.limit((0.5, -0.5), None) == (0.3, -0.3)


@pytest.mark.parametrize(("change", "held"), [(3.0, False), (3.0 + 1e-9, True), (-3.0, False), (-3.0 - 1e-9, True)])
def test_slew_holds_back_beyond_the_rate_alone(change: float, held: bool) -> None:
    slew = SlewLimiter(3000.0)
    assert not slew.limited
    assert slew.place((0.0, 0.0, 5.0)) == (0.0, 0.0, 5.0)
    assert slew.limit((0.0, 0.0, 5.0 + change), TICK) == pytest.approx((0.0, 0.0, 5.0 + change), abs=1e-8)
    assert slew.limited is held
    slew.limit((0.0, 0.0, 50.0), TICK)
    assert slew.limited
    reached = slew.limit((0.0, 0.0, 50.0), 0.0)
    assert slew.limit(reached, TICK) == reached
    assert not slew.limited, "it is there"
    slew.limit((0.0, 0.0, 50.0), TICK)
    slew.place((0.0, 0.0, 9.0))
    assert not slew.limited, "behind a closed gate nothing is held back"


def test_gate_is_open_to_the_beginning_of_the_fade_and_ramps_tell_so() -> None:
    gate = ForceGate(ramp=0.05, silence=0.1, fade_share=0.6)
    assert gate.ramping
    opened = [(gate.update(engaged=True, age=0.0, elapsed=TICK), gate.ramping) for _ in range(52)]
    assert opened[0] == (pytest.approx(0.02), True)
    assert (opened[48][1], opened[-1]) == (True, (1.0, False))
    assert not next(ramping for gain, ramping in opened if gain == 1.0)
    faded = {age: gate.update(engaged=True, age=age, elapsed=TICK) for age in (0.06, 0.0601, 0.08, 0.1)}
    assert faded == pytest.approx({0.06: 1.0, 0.0601: 0.9975, 0.08: 0.5, 0.1: 0.0}, abs=1e-12)
    assert not gate.ramping, "silence is no ramp"
    gate.update(engaged=True, age=0.0, elapsed=0.05)
    assert (gate.update(engaged=False, age=0.0, elapsed=TICK), gate.ramping) == (pytest.approx(0.98), True)
    gate.close()
    assert gate.update(engaged=False, age=0.0, elapsed=TICK) == 0.0
