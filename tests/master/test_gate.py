"""What leaves for the operator's hand: in every state of a session, within every limit."""

from collections.abc import Callable
from math import dist, hypot, inf, isfinite, nan
from typing import Any, NamedTuple

import pytest
from hypothesis import example, given, strategies as st

from tests.examples import examples
from weberlink.geometry.joints import Joints
from weberlink.master.gate import Bound, OutputGate

TICK, RAMP, SILENCE, FADE_SHARE = 1e-3, 0.05, 0.1, 0.8
ROUNDING = 1.0 + 1e-8
KINDS: dict[str, tuple[Joints, Joints, int]] = {
    "force": ((10.0,), (3000.0,), 3),
    "slow force": ((10.0,), (50.0,), 3),
    "torque": ((0.5,), (100.0,), 3),
    "arm": ((1.0, 0.8, 0.5, 0.0), (50.0, 50.0, 20.0, 50.0), 1),
}
"""Largest and fastest, and the axes of a part."""


def made(kind: str) -> OutputGate:
    most, slew, width = KINDS[kind]
    return OutputGate([Bound(most, slew, RAMP, width=width)], ramp=RAMP, silence=SILENCE, fade_share=FADE_SHARE)


class Part(NamedTuple):
    """Of a session: a state that lasts for some ticks, in which something is wanted, in units of the limit."""

    state: str
    wanted: tuple[float, float, float, float]
    ticks: int


wild = st.floats(-3.0, 3.0) | st.sampled_from([0.0, 1.0, -1.0, 1e300, inf, nan])
courses = st.lists(
    st.builds(
        Part,
        st.sampled_from(["engaged", "idle", "silent", "stalled", "closed"]),
        st.tuples(wild, wild, wild, wild),
        st.sampled_from([1, 3, 30, 85, 110]),
    ),
    max_size=8,
)
PUSH, PULL = (1.0, -1.0, 1.0, 1.0), (-1.0, 1.0, -1.0, 1.0)


@examples(40)
@given(st.sampled_from(sorted(KINDS)), courses)
@example(
    "arm", [Part("engaged", PUSH, 110), Part("engaged", PULL, 30), Part("idle", PULL, 30), Part("engaged", PUSH, 30)]
)
@example("slow force", [Part("engaged", PUSH, 110), Part("idle", PUSH, 3), Part("engaged", PULL, 110)])
@example("force", [Part("engaged", PUSH, 60), Part("silent", PUSH, 85), Part("engaged", PULL, 60)])
@example("torque", [Part("engaged", PUSH, 60), Part("closed", PULL, 1), Part("engaged", PULL, 30)])
@example("force", [Part("engaged", PUSH, 49), Part("engaged", PULL, 30)])  # another one as the gate has opened
def test_what_leaves_obeys_every_limit_in_every_state(kind: str, course: list[Part]) -> None:
    gate, (most, slew, width) = made(kind), KINDS[kind]
    last, gain, silent, idle, follows = gate.bounds[0].held, 0.0, 0.0, 1.0, False
    for state, wanted, count in course:
        values = tuple(value * most[0] for value in wanted[: width * len(most)])
        for _ in range(count):
            if state == "closed":
                gate.close()
                last, gain = (0.0,) * len(last), 0.0
            silent, idle = ((value + TICK) * (state == name) for value, name in ((silent, "silent"), (idle, "idle")))
            step = 0.0 if state == "stalled" else TICK
            gate.fade(engaged=state != "idle", age=silent, step=step)
            out = gate.passed(0, values, values, step)
            assert gate.gain - gain <= step / RAMP * ROUNDING, "it opens in the ramp"
            kept = gate.gain / gain if gate.gain < gain else 1.0
            follows = follows and gate.gain == 1.0
            for index, (limit, rate) in enumerate(zip(most, slew, strict=True)):
                axes = slice(index * width, (index + 1) * width)
                here, there = tuple(value * kept for value in last[axes]), out[axes]
                assert hypot(*there) <= limit * gate.gain * ROUNDING
                assert dist(here, there) <= rate * step * ROUNDING + 1e-12, "of what leaves, but for the fade"
                both = max(rate * step, dist(last[axes], here))
                assert dist(last[axes], there) <= both * ROUNDING + 1e-12, "and with it no more than either alone"
                if not follows:
                    assert hypot(*there) - hypot(*here) <= limit * step / RAMP * ROUNDING + 1e-12, (
                        "it comes back slowly"
                    )
            if silent >= SILENCE or idle >= RAMP + TICK or (gain == 0.0 and (idle > 0.0 or step == 0.0)):
                assert not any(out)
            last, gain = out, gate.gain
            follows = follows or (gain == 1.0 and dist(out, shortened(values, most, width)) < 1e-9)


def shortened(values: Joints, most: Joints, width: int) -> Joints:
    """The values within their limits; nothing where they are not finite."""
    goal: Joints = ()
    for limit, first in zip(most, range(0, len(values), width), strict=True):
        part = values[first : first + width]
        length = hypot(*part)
        scale = 0.0 if not isfinite(length) else min(1.0, limit / length) if length > 0.0 else 1.0
        goal += tuple(value * scale if scale > 0.0 else 0.0 for value in part)
    return goal


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_peer_that_starts_and_stops_gets_nothing_past_the_slew_limit(kind: str) -> None:
    """The way in is that of the slew limit even while the fade is faster."""
    gate, (most, slew, width) = made(kind), KINDS[kind]
    wanted = (most[0],) + (0.0,) * (width * len(most) - 1)
    last, rises, largest = 0.0, [0.0], 0.0
    for tick in range(3000):
        gate.fade(engaged=tick // 60 % 2 == 0, age=0.0, step=TICK)
        out = gate.passed(0, wanted, wanted, TICK)[0]
        rises.append(out - last)
        last, largest = out, max(largest, out)
    assert max(rises) <= min(slew[0] * TICK, most[0] * TICK / RAMP) * ROUNDING
    assert largest >= min(0.99 * most[0], slew[0] * 0.059), "and no more is taken than that"


def test_the_fade_begins_late_in_the_silence_and_ramps_tell_of_a_session_alone() -> None:
    gate = made("force")

    def faded(age: float, *, engaged: bool = True, step: float = TICK) -> tuple[float, bool]:
        gate.fade(engaged=engaged, age=age, step=step)
        return gate.gain, gate.ramping

    assert gate.ramping
    opened = [faded(0.0) for _ in range(52)]
    assert opened[0] == (pytest.approx(0.02), True)
    assert (opened[48][1], opened[-1]) == (True, (1.0, False))
    assert [faded(age)[0] for age in (0.08, 0.0801, 0.09, 0.1)] == pytest.approx([1.0, 0.995, 0.5, 0.0], abs=1e-12)
    assert not gate.ramping, "silence is no ramp"
    faded(0.0, step=RAMP)
    assert faded(0.0, engaged=False) == (pytest.approx(0.98), True)
    gate.close()
    assert faded(0.0, engaged=False) == (0.0, True)
    for _ in range(60):
        faded(0.0)
    assert faded(0.09, step=0.02)[0] == pytest.approx(0.5), "despite missed ticks"
    assert faded(0.1, engaged=False, step=0.02)[0] == 0.0


def test_a_force_falls_at_its_rate_and_grows_in_the_approach() -> None:
    bound = Bound((100.0,), (1000.0,), 1.0, width=1)
    assert [bound.advance((5.0,), TICK)[0] for _ in range(3)] == pytest.approx([0.1, 0.2, 0.3])
    assert [bound.advance((-5.0,), TICK)[0] for _ in range(2)] == pytest.approx([-0.4, -0.5])
    assert not bound.held_back, "the approach is no slew limit"
    assert [bound.advance((0.05,), TICK)[0] for _ in range(2)] == pytest.approx([0.05, 0.05])
    assert bound.advance((5.0,), TICK)[0] == pytest.approx(1.05), "it follows"
    assert bound.held_back


@pytest.mark.parametrize(
    ("wanted", "asked", "clipped"),
    [
        ((0.5, -0.4, 0.2, 0.0), 0.5, False),
        ((1.0, -0.8, 0.5, 3.0), 1.0, False),  # an axis that displays none clips nothing
        ((0.1, -0.9, 0.0, 0.0), 0.8, True),
        ((nan, 9.0, -inf, 0.0), 0.8, True),
    ],
)
def test_what_is_asked_for_and_clipped_is_told(wanted: Joints, asked: float, clipped: bool) -> None:
    bound = made("arm").bounds[0]
    assert all(map(isfinite, bound.limited(wanted)))
    assert (bound.asked, bound.clipped) == (asked, clipped)


@pytest.mark.parametrize(
    ("made", "says"),
    [
        *((lambda slew=slew: Bound((1.0,), (slew,), RAMP), "must be positive") for slew in (0.0, -1.0, nan)),
        (lambda: Bound((1.0,), (1.0, 1.0), RAMP), "1 limits but 2 slew limits"),
        *((lambda most=most: Bound((0.0, most), (1.0, 1.0), RAMP), "must not be negative") for most in (-1e-9, nan)),
    ],
)
def test_a_limit_that_is_none_is_refused(made: Callable[[], Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        made()
