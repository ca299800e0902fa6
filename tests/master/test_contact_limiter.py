"""No force without a contact: how long a force may last that the robot's end states no contact for."""

from collections.abc import Iterable
from itertools import pairwise
from math import inf

import pytest
from hypothesis import given, strategies as st

from tests.protocol.harness import make_endpoint
from weberlink.master.gate import FADE, FALL, GRACE, PATIENCE, Bound, ContactLimiter, ContactWatch, OutputGate
from weberlink.protocol.states import Role

TICK = 1e-3
MOST, FREE = 10.0, 1.0
LONGEST = 0.6
round_trips = st.floats(0.0, 0.5)


def limiter() -> ContactLimiter:
    return ContactLimiter(MOST, FREE, LONGEST)


def bounds(limited: ContactLimiter, asked: Iterable[float], round_trip: float | None) -> list[float]:
    return [limited.bound(force, TICK, round_trip, stated=inf) for force in asked]


def ticks(seconds: float) -> int:
    return round(seconds / TICK)


forces = st.sampled_from([0.0, 0.5, FREE, 1.5, 4.0, 100.0])
phases = st.lists(st.tuples(forces, st.booleans(), st.integers(1, 400)), min_size=1, max_size=8)


@given(phases, round_trips)
def test_without_a_contact_no_force_lasts_longer_than_the_answer_takes(
    course: list[tuple[float, bool, int]], round_trip: float
) -> None:
    """Whatever was before: from then on it is free or less, and falls to nothing. What does not end is at fault."""
    limited, alone, lasted, before = limiter(), 0, 0.0, inf
    for asked, stated, count in course:
        for _ in range(count):
            bound = limited.bound(asked, TICK, round_trip, stated=0.0 if stated else inf)
            alone = alone + 1 if asked > FREE and not stated else 0
            lasted = 0.0 if stated else lasted + TICK * (asked > FREE)
            assert not limited.unfounded or lasted >= round_trip + PATIENCE + GRACE - TICK
            over = alone * TICK - round_trip - PATIENCE
            if over >= 0.0:
                assert bound <= FREE
                assert bound <= before
            if over >= FADE + TICK:
                assert bound == 0.0
            before = bound


def test_taps_ahead_of_the_robot_do_not_add_up_and_a_force_that_flickers_does() -> None:
    tap, ghost = [4.0] * 100 + [0.0] * 110, [4.0] * 100 + [0.0] * 20
    assert set(bounds(limiter(), tap * 20, 0.2)) == {inf}
    limited = limiter()
    assert min(bounds(limited, ghost * 20, 0.2)) == 0.0
    assert limited.unfounded


@given(round_trips, st.integers(1, 40))
def test_a_claim_of_a_model_that_is_contradicted_gains_no_time(round_trip: float, claimed: int) -> None:
    limited = limiter()
    ahead = ticks(round_trip + PATIENCE - FALL) - 1
    bounds(limited, [5.0] * ahead, round_trip)
    for tick in range(claimed):
        assert limited.bound(5.0, TICK, round_trip, stated=inf, claimed=(tick + 1) * TICK) == inf
    left = max(0, ticks(FALL) + 1 - claimed)
    met = bounds(limited, [5.0] * (left + 2 * ticks(FALL)), round_trip)
    assert met[max(left, ticks(FALL) + 1)] <= FREE
    steps = [before - after for before, after in pairwise([MOST, *(min(bound, MOST) for bound in met)])]
    assert max(steps) <= MOST * TICK / FALL * (1.0 + 1e-9)


@given(round_trips)
def test_a_contact_that_was_stated_a_while_ago_leaves_the_rest_of_the_time(round_trip: float) -> None:
    limited, ago = limiter(), 0.02
    bounds(limited, [5.0] * 1000, round_trip)
    limited.bound(5.0, TICK, round_trip, stated=ago)
    assert limited.lasted == ago
    assert not limited.doubtful
    assert bounds(limited, [5.0] * (ticks(round_trip + PATIENCE - ago) + 1), round_trip)[-1] <= FREE


def test_the_bound_falls_in_a_line_to_what_is_free_and_on_to_nothing() -> None:
    limited, round_trip = limiter(), 0.1
    patience = round_trip + PATIENCE
    for tick in range(1, ticks(patience + FADE) + 1):
        left = patience - tick * TICK
        falling = FREE + (MOST - FREE) * left / FALL if left > 0.0 else FREE * (1.0 + left / FADE)
        met = limited.bound(5.0, TICK, round_trip, stated=inf)
        assert not limited.quiet
        assert min(met, MOST) == pytest.approx(min(falling, MOST), abs=1e-9)


def test_the_force_comes_back_slowly_when_a_contact_is_stated() -> None:
    limited, ramp = ContactLimiter(MOST, FREE, 0.1), 0.05
    watch = ContactWatch(limited, make_endpoint(Role.INITIATOR), (0.1,), 0.0)
    bound = Bound((MOST,), (inf,), ramp, width=1, contact=watch)
    gate = OutputGate([bound], ramp=ramp, silence=0.1, fade_share=0.8)
    for _ in range(2):
        gate.fade(engaged=True, age=0.0, step=ramp)

    def passed(decoded: float, count: int) -> list[float]:
        return [gate.passed(0, (5.0,), (decoded,), TICK)[0] for _ in range(count)]

    assert passed(0.1, 1000)[-1] == 0.0
    assert limited.unfounded
    risen = passed(5.0, ticks(ramp))
    assert risen[:3] == pytest.approx([MOST * TICK / ramp * tick for tick in (1, 2, 3)])
    assert risen[-1] == 5.0
    assert (limited.unfounded, limited.quiet) == (False, True)


def test_without_a_round_trip_the_longest_one_is_assumed_and_a_longer_one_is_not_believed() -> None:
    for round_trip in (None, 100.0):
        met = bounds(limiter(), [5.0] * 2000, round_trip)
        assert met.index(next(bound for bound in met if bound <= FREE)) == pytest.approx(
            ticks(LONGEST + PATIENCE), abs=2
        )
