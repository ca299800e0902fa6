from itertools import pairwise
from math import dist, hypot, inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.operator_port import Display
from weberlink.master.safety import ForceGate, ForceLimiter, SlewLimiter

components = st.floats(-1e6, 1e6)
FORCE = (0.0, 0.0, 4.0)
TICK = 1e-3


def gate() -> ForceGate:
    return ForceGate(ramp=0.05, silence=0.1, fade_share=0.6)


def opened() -> ForceGate:
    ready = gate()
    for _ in range(51):
        ready.update(engaged=True, age=0.0, elapsed=TICK)
    return ready


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


def test_limiter_refuses_a_limit_that_is_none() -> None:
    with pytest.raises(ValueError, match="limit"):
        ForceLimiter(0.0)


def test_gate_opens_over_the_ramp_without_a_jump() -> None:
    fading_in = gate()
    gains = [fading_in.update(engaged=True, age=0.0, elapsed=TICK) for _ in range(60)]
    assert max(b - a for a, b in pairwise([0.0, *gains])) <= TICK / 0.05 * (1 + 1e-9)
    assert gains[-1] == 1.0
    assert not fading_in.ramping


def test_gate_is_shut_at_the_silence_limit_and_open_before_the_fade() -> None:
    silent = opened()
    gains = {ms: silent.update(engaged=True, age=ms * TICK, elapsed=TICK) for ms in range(1, 101)}
    assert gains[60] == 1.0
    assert gains[80] == pytest.approx(0.5)
    assert gains[100] == pytest.approx(0.0, abs=1e-12)


def test_gate_is_shut_at_the_limit_despite_missed_ticks() -> None:
    slow = ForceGate(ramp=0.1, silence=0.1, fade_share=0.6)
    for _ in range(300):
        slow.update(engaged=True, age=0.001, elapsed=0.001)
    assert slow.update(engaged=True, age=0.08, elapsed=0.02) == pytest.approx(0.5)
    assert slow.update(engaged=False, age=0.1, elapsed=0.02) == 0.0


def test_a_force_that_returns_after_silence_fades_in() -> None:
    returning = opened()
    returning.update(engaged=False, age=5.0, elapsed=0.1)
    assert returning.update(engaged=True, age=0.0, elapsed=TICK) == pytest.approx(TICK / 0.05)


def test_gate_fades_at_the_end_and_closes_at_once_when_told() -> None:
    ending = opened()
    assert ending.update(engaged=False, age=0.0, elapsed=TICK) == pytest.approx(0.98)
    assert ending.ramping
    ending.close()
    assert ending.update(engaged=False, age=0.0, elapsed=TICK) == 0.0


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
    with pytest.raises(ValueError, match="slew"):
        SlewLimiter(0.0)


TICKS = st.lists(st.tuples(forces, st.booleans(), st.floats(0.0, 0.15), st.booleans()), min_size=2, max_size=80)


@given(TICKS)
def test_a_displayed_force_obeys_slew_ramp_silence_and_stalls(ticks: list[tuple[Vector, bool, float, bool]]) -> None:
    """A display with limiter and slew limit behind a gate, in the order of the operator's port."""
    display, fading = Display(ForceLimiter(10.0), SlewLimiter(3000.0), None), gate()
    outputs, gains = [ZERO], [0.0]
    for force, engaged, age, stalled in ticks:
        step = 0.0 if stalled else TICK
        if stalled:
            fading.close()
        slew_step = step if fading.gain > 0.0 else None
        display.show(force, fading.update(engaged=engaged, age=age, elapsed=step), slew_step, 0.0)
        outputs.append(display.output)
        gains.append(fading.gain)
        if age >= 0.1 or stalled:
            assert outputs[-1] == ZERO
    for (before, after), (closed, opened_) in zip(pairwise(outputs), pairwise(gains), strict=True):
        bound = 3000.0 * TICK + 10.0 * abs(opened_ - closed)
        assert dist(before, after) <= bound * (1 + 1e-9)
        assert opened_ - closed <= TICK / 0.05 * (1 + 1e-9)
