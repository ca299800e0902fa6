from math import hypot

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.vector import ZERO
from master.safety import ForceGate, ForceLimiter

components = st.floats(-1e6, 1e6)
FORCE = (0.0, 0.0, 4.0)
TICK = 1e-3


def gate() -> ForceGate:
    return ForceGate(ramp=0.05, silence=0.1, fade_share=0.6)


def opened() -> ForceGate:
    ready = gate()
    for _ in range(51):
        ready.pass_through(FORCE, engaged=True, age=0.0, elapsed=TICK)
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


def test_gate_opens_over_the_ramp_without_a_step_larger_than_its_share() -> None:
    fading_in = gate()
    outputs = [fading_in.pass_through(FORCE, engaged=True, age=0.0, elapsed=TICK)[2] for _ in range(60)]
    steps = [b - a for a, b in zip([0.0, *outputs], outputs, strict=False)]
    assert max(steps) <= 4.0 * TICK / 0.05 * (1 + 1e-9)
    assert outputs[-1] == 4.0
    assert not fading_in.ramping


def test_gate_is_shut_when_the_silence_limit_is_reached_and_untouched_before_the_fade() -> None:
    silent = opened()
    outputs = {
        ms: silent.pass_through(FORCE, engaged=True, age=ms * TICK, elapsed=TICK)[2] for ms in range(1, 101)
    }
    assert outputs[60] == 4.0
    assert outputs[80] == pytest.approx(2.0)
    assert outputs[100] == pytest.approx(0.0, abs=1e-12)


def test_gate_is_shut_at_the_limit_also_where_ticks_were_missed_before_it() -> None:
    gate = ForceGate(ramp=0.1, silence=0.1, fade_share=0.6)
    for _ in range(300):
        gate.pass_through((1.0, 0.0, 0.0), engaged=True, age=0.001, elapsed=0.001)
    gate.pass_through((1.0, 0.0, 0.0), engaged=True, age=0.08, elapsed=0.02)
    assert gate.gain == pytest.approx(0.5)
    gate.pass_through((1.0, 0.0, 0.0), engaged=False, age=0.1, elapsed=0.02)
    assert gate.gain == 0.0


def test_a_force_that_returns_after_silence_fades_in() -> None:
    returning = opened()
    returning.pass_through(FORCE, engaged=False, age=5.0, elapsed=0.1)
    first = returning.pass_through(FORCE, engaged=True, age=0.0, elapsed=TICK)
    assert first[2] == pytest.approx(4.0 * TICK / 0.05)


def test_gate_closes_over_the_ramp_when_the_session_ends_and_at_once_when_told() -> None:
    ending = opened()
    assert ending.pass_through(FORCE, engaged=False, age=0.0, elapsed=TICK)[2] == pytest.approx(4.0 * 0.98)
    assert ending.ramping
    ending.close()
    assert ending.pass_through(FORCE, engaged=False, age=0.0, elapsed=TICK) == ZERO


@given(st.lists(st.tuples(st.booleans(), st.floats(0.0, 0.12)), min_size=1, max_size=80))
def test_a_torque_passes_in_the_share_in_which_the_force_does(ticks: list[tuple[bool, float]]) -> None:
    both = gate()
    for engaged, age in ticks:
        force = both.pass_through(FORCE, engaged=engaged, age=age, elapsed=10 * TICK)
        assert both.share((0.0, 0.4, 0.0))[1] == pytest.approx(0.1 * force[2])
